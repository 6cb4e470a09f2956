"""Costs of an edit on the paper's five scenes, on the CPU: the milliseconds that `biscale profile` prints, the error of
`biscale eval` with the same settings, and the peak memory. Times above a millisecond are also multiples of a yardstick of
the machine.

    python benches/targets.py [--no-errors]

The reference for the errors takes minutes. BISCALE_MERL names a folder with MERL files of Table 3's paints; without one, that
row is SKIPPED.
"""

import json
import os
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/interop"))
from common import BISCALE, Table, biscale, evaluate, np, random_pairs, resource  # noqa: E402

SCENES = ["table4_plate", "table4_teapot", "table4_pillow", "table4_cup", "table4_skirt"]
EDITS = [("geometry", "standard"), ("geometry", "draft"), ("brdf", "standard"), ("color", "standard"), ("camera", "standard")]
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
    out, _ = biscale("profile", scene, "--backend", "cpu", "--repeat", 5, "--json", "--quiet", *options)
    return json.loads(out)["total_ms"]


def errors(table, qualities):
    """Adds rows of PSNR and relative L2 for 200 pairs up to 85 degrees, half of them near the mirror direction."""
    pairs = random_pairs(200)
    with tempfile.TemporaryDirectory() as folder:
        references = [evaluate(scene, pairs, folder, "--quality", "reference") for scene in SCENES]
        for quality in qualities:
            cells = []
            for scene, reference in zip(SCENES, references):
                difference = evaluate(scene, pairs, folder, "--quality", quality, "--backend", "cpu") - reference
                psnr = 20 * np.log10(reference.max() / np.sqrt(np.mean(difference**2)))
                cells.append(f"{psnr:.1f} dB, {100 * np.linalg.norm(difference) / np.linalg.norm(reference):.1f} %")
            table.row(f"error, {quality}", *cells)


def main():
    yardstick = yardstick_ms()
    print(f"{BISCALE}, {os.cpu_count()} cores; yardstick y = {yardstick:.0f} ms")
    table = Table("edit, quality", *SCENES)
    for edit, quality in EDITS:
        times = [profile(scene, "--edit", edit, "--quality", quality) for scene in SCENES]
        table.row(f"{edit}, {quality}", *(f"{ms:.1f} ms" + f", {ms / yardstick:.2f} y" * (ms > 1) for ms in times))
    paint = next((path for name in PAINTS if (path := Path(os.environ.get("BISCALE_MERL", ".")) / f"{name}.binary").exists()), None)
    if paint:
        swapped = [profile(scene, "--set", f'material.default.brdf={{ kind = "merl", path = "{paint}" }}') for scene in SCENES]
        plain = [profile(scene) for scene in SCENES]
        table.row("all stages", *(f"{ms:.1f} ms" for ms in plain))
        table.row(f"all stages, {paint.name}", *(f"{ms:.1f} ms" for ms in swapped))
    else:
        print("SKIPPED: a MERL paint (BISCALE_MERL names no folder with one)")
    rows = json.loads(biscale("basis", "table3", "--json", "--quiet")[0])
    print(f"Table 3, {len(rows)} materials: {sum(row['seconds'] for row in rows):.2f} s")
    if resource:
        print(f"peak memory: {resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024:.0f} MB")
    print(f"yardstick {yardstick_ms():.0f} ms", flush=True)
    if "--no-errors" not in sys.argv:
        errors(table, ["standard", "draft"])


if __name__ == "__main__":
    main()
