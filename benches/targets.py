"""Costs of an edit on the paper's five scenes, on the CPU: the milliseconds that `biscale profile` prints, the error of
`biscale eval` with the same settings, and the peak memory. Times above a millisecond are also multiples of a yardstick of
the machine.

    python benches/targets.py [--no-errors | --write]

The reference for the errors takes minutes. With --write, the table of README.md and that of docs/measurements/speed.md are
replaced, so that their figures come from one run. BISCALE_MERL names a folder with MERL files of Table 3's paints; without one, that
row is SKIPPED.
"""

import json
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/interop"))
from common import BISCALE, ROOT, Table, biscale, evaluate, np, random_pairs, resource  # noqa: E402

SCENES = ["table4_plate", "table4_teapot", "table4_pillow", "table4_cup", "table4_skirt"]
EDITS = [("geometry", "standard"), ("geometry", "draft"), ("brdf", "standard"), ("color", "standard"), ("camera", "standard")]
# The paper leaves interreflection out.
DIRECT = ("--effect", "interreflection=off")
PAINTS = ["gold-metallic-paint", "silver-paint", "pearl-paint", "blue-metallic-paint"]


def yardstick_ms():
    """Returns the shortest of five times of a million dependent square roots in Python."""

    def once():
        x, start = 0.0, time.perf_counter()
        for k in range(1_000_000):
            x = (x + k) ** 0.5
        return time.perf_counter() - start

    return 1e3 * min(once() for _ in range(5))


def profile(scene, *options):
    out, _ = biscale("profile", scene, "--backend", "cpu", "--repeat", 5, "--json", "--quiet", *DIRECT, *options)
    return json.loads(out)["total_ms"]


def errors(qualities):
    """Returns PSNR and relative L2 per quality and scene, for 200 pairs up to 85 degrees, half of them near the mirror direction."""
    pairs = random_pairs(200)
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        references = [evaluate(scene, pairs, folder, "--quality", "reference", *DIRECT) for scene in SCENES]
        for quality in qualities:
            found[quality] = []
            for scene, reference in zip(SCENES, references):
                difference = evaluate(scene, pairs, folder, "--quality", quality, "--backend", "cpu", *DIRECT) - reference
                psnr = 20 * np.log10(reference.max() / np.sqrt(np.mean(difference**2)))
                found[quality].append((psnr, 100 * np.linalg.norm(difference) / np.linalg.norm(reference)))
    return found


def origin():
    """Returns the commit and the machine."""
    git = lambda *arguments: subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True).stdout.strip()
    changed = git("status", "--porcelain", "--", "src", "shaders", "Cargo.toml", "Cargo.lock")
    commit = git("rev-parse", "--short", "HEAD") + (" with changes" if changed else "")
    info = Path("/proc/cpuinfo")
    name = re.search(r"model name\s*:\s*(.*)", info.read_text()) if info.exists() else None
    return f"commit {commit}, {name[1] if name else platform.machine()}, {os.cpu_count()} cores"


def write_pages(times, psnr, notes):
    """Writes the figures into README.md and docs/measurements/speed.md."""
    readme = ROOT / "README.md"
    text = readme.read_text()
    for k, scene in enumerate(SCENES):
        row = [f"{times['geometry', q][k]:.1f} ms, {psnr[q][k][0]:.1f} dB" for q in ("draft", "standard")]
        row.append(f"{times['camera', 'standard'][k]:.1f} ms")
        text = re.sub(rf"^(\| `{scene}` \|[^|]*\|).*$", lambda found: f"{found[1]} {' | '.join(row)} |", text, flags=re.M)
    readme.write_text(text)
    lines = ["| edit, quality | " + " | ".join(f"`{scene}`" for scene in SCENES) + " |", "|---" * (len(SCENES) + 1) + "|"]
    for (edit, quality), row in times.items():
        lines.append(f"| {edit}, {quality} | " + " | ".join(f"{ms:.1f} ms" for ms in row) + " |")
    for quality, row in psnr.items():
        lines.append(f"| error, `{quality}` | " + " | ".join(f"{db:.1f} dB, {percent:.1f} %" for db, percent in row) + " |")
    block = "\n".join([*lines, "", f"{origin()}. {' '.join(notes)}", ""])
    speed = ROOT / "docs/measurements/speed.md"
    start, end = "<!-- targets -->\n", "<!-- end -->"
    before, rest = speed.read_text().split(start, 1)
    speed.write_text(before + start + block + end + rest.split(end, 1)[1])
    print(f"wrote {readme} and {speed}")


def main():
    yardstick = yardstick_ms()
    print(f"{BISCALE}, {os.cpu_count()} cores; yardstick y = {yardstick:.0f} ms")
    table = Table("edit, quality", *SCENES)
    times = {}

    def measure(edit, quality, *options):
        row = times[edit, quality] = [profile(scene, *options) for scene in SCENES]
        table.row(f"{edit}, {quality}", *(f"{ms:.1f} ms" + f", {ms / yardstick:.2f} y" * (ms > 1) for ms in row))

    for edit, quality in EDITS:
        measure(edit, quality, "--edit", edit, "--quality", quality)
    measure("all stages", "standard")
    paint = next((path for name in PAINTS if (path := Path(os.environ.get("BISCALE_MERL", ".")) / f"{name}.binary").exists()), None)
    if paint:
        measure("all stages", paint.name, "--set", f'material.default.brdf={{ kind = "merl", path = "{paint}" }}')
    else:
        print("SKIPPED: a MERL paint (BISCALE_MERL names no folder with one)")
    rows = json.loads(biscale("basis", "table3", "--json", "--quiet")[0])
    notes = [f"The yardstick of the machine, a million square roots in Python, took {yardstick:.0f} ms."]
    notes.append(f"The bases of Table 3's eleven materials and of `default` take {sum(row['seconds'] for row in rows):.2f} s (`biscale basis table3`).")
    if resource:
        memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
        notes.append(f"No command of this table uses more than {memory:.0f} MB.")
    print(*notes, sep="\n")
    print(f"yardstick {yardstick_ms():.0f} ms", flush=True)
    if "--no-errors" in sys.argv:
        return
    psnr = errors(["draft", "standard"])
    for quality, row in psnr.items():
        table.row(f"error, {quality}", *(f"{db:.1f} dB, {percent:.1f} %" for db, percent in row))
    if "--write" in sys.argv:
        write_pages(times, psnr, notes)


if __name__ == "__main__":
    main()
