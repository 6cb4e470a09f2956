"""Savings and costs of the disk cache: seconds of a whole `biscale render` without the cache, with an empty and with a full one.

    python benches/cache.py [SCENE ...]

The figures are medians of three runs in turns. BISCALE names the program. New files are still in memory when they are read.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BISCALE = os.environ.get("BISCALE", str(ROOT / "target/release/biscale"))
SCENES = sys.argv[1:] or ["table4_pillow", "fig6a_velvet_spread", "table4_plate"]
REPEAT = 3


def run(folder, *arguments):
    """Returns the JSON that the program prints, and its seconds."""
    start = time.perf_counter()
    done = subprocess.run(
        [BISCALE, *arguments, "--json"],
        check=True,
        stdout=subprocess.PIPE,
        env={**os.environ, "BISCALE_CACHE": str(folder)},
    )
    return json.loads(done.stdout), time.perf_counter() - start


with tempfile.TemporaryDirectory() as work:
    folder, image = Path(work, "cache"), Path(work, "image.png")
    print(f"{'scene':22}{'without':>10}{'empty':>10}{'full':>10}   {'visibility':>20}{'picture_table':>22}   cached")
    for scene in SCENES:
        seconds, stages = {}, {}
        render = ["render", scene, "-o", str(image), "--backend", "cpu", "--quiet"]
        images = set()
        for _ in range(REPEAT):
            for name in ["without", "empty", "full"]:
                if name == "empty":
                    run(folder, "cache", "--clear")
                report, took = run(folder, *render, *(["--no-cache"] if name == "without" else []))
                seconds.setdefault(name, []).append(took)
                for stage, ms in report["stages"].items():
                    stages.setdefault(stage, []).append(ms)
                images.add(image.read_bytes())
        assert len(images) == 1, f"{scene}: the images differ"
        usage, _ = run(folder, "cache")
        took = "".join(f"{statistics.median(seconds[name]):8.2f} s" for name in ["without", "empty", "full"])
        saved = [
            f"{statistics.median(stages[stage]):9.0f} to {statistics.median(stages['cached_' + stage]):4.0f} ms"
            if "cached_" + stage in stages
            else f"{statistics.median(stages[stage]):9.0f} ms, not cached"
            for stage in ["visibility", "picture_table"]
        ]
        print(f"{scene:22}{took}   {saved[0]:>20}{saved[1]:>22}   {usage['files']} files, {usage['bytes']:,} bytes")
