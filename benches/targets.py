"""What an edit costs on the paper's five scenes, on the CPU: milliseconds as `biscale profile` prints them, beside a yardstick
of this machine, and the most memory that any of it took.

    python benches/targets.py

MERL files of Table 3's paints are looked for in the folder that BISCALE_DATA names; without them that row says SKIPPED.
"""

import json
import os
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/interop"))
from common import BISCALE, Table, biscale, resource  # noqa: E402

SCENES = ["table4_plate", "table4_teapot", "table4_pillow", "table4_cup", "table4_skirt"]
EDITS = [("geometry", "standard"), ("geometry", "draft"), ("brdf", "standard"), ("color", "standard"), ("camera", "standard")]
PAINTS = ["gold-metallic-paint", "silver-paint", "pearl-paint", "blue-metallic-paint"]


def yardstick_ms():
    """A million dependent square roots in Python."""
    x, start = 0.0, time.perf_counter()
    for k in range(1_000_000):
        x = (x + k) ** 0.5
    return 1e3 * (time.perf_counter() - start)


def profile(scene, *options):
    out, _ = biscale("profile", scene, "--backend", "cpu", "--repeat", 5, "--json", "--quiet", *options)
    return json.loads(out)["total_ms"]


def main():
    print(f"{BISCALE}, {os.cpu_count()} cores; yardstick {yardstick_ms():.0f} ms")
    table = Table("edit, quality", *SCENES)
    for edit, quality in EDITS:
        times = [profile(scene, "--edit", edit, "--quality", quality) for scene in SCENES]
        table.row(f"{edit}, {quality}", *(f"{ms:.1f} ms" for ms in times))
    paint = next((path for name in PAINTS if (path := Path(os.environ.get("BISCALE_DATA", ".")) / f"{name}.binary").exists()), None)
    if paint:
        swapped = [profile(scene, "--set", f'material.default.brdf={{ kind = "merl", path = "{paint}" }}') for scene in SCENES]
        plain = [profile(scene) for scene in SCENES]
        table.row("from nothing", *(f"{ms:.1f} ms" for ms in plain))
        table.row(f"the same, {paint.name}", *(f"{ms:.1f} ms" for ms in swapped))
    else:
        print("SKIPPED: a MERL paint (BISCALE_DATA names no folder with one)")
    rows = json.loads(biscale("basis", "table3", "--json", "--quiet")[0])
    print(f"Table 3, {len(rows)} materials: {sum(row['seconds'] for row in rows):.2f} s")
    if resource:
        print(f"most memory: {resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024:.0f} MB")
    print(f"yardstick {yardstick_ms():.0f} ms")


if __name__ == "__main__":
    main()
