"""What the cache on disk saves and costs: seconds of a whole `biscale render` without it, with an empty one and with a full one.

    python benches/cache.py [SCENE ...]

Medians of three runs each, in turns. BISCALE names the program. Files that were just written are still in memory.
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
    """What the program prints as JSON, and its seconds."""
    start = time.perf_counter()
    done = subprocess.run(
        [BISCALE, *arguments, "--json"],
        check=True,
        stdout=subprocess.PIPE,
        env={**os.environ, "BISCALE_CACHE": str(folder)},
    )
    return json.loads(done.stdout), time.perf_counter() - start


with tempfile.TemporaryDirectory() as work:
    folder, picture = Path(work, "cache"), Path(work, "picture.png")
    print(f"{'scene':22}{'without':>10}{'empty':>10}{'full':>10}   {'visibility':>20}{'picture table':>22}   kept")
    for scene in SCENES:
        seconds, stages = {}, {}
        render = ["render", scene, "-o", str(picture), "--backend", "cpu", "--quiet"]
        pictures = set()
        for _ in range(REPEAT):
            for name in ["without", "empty", "full"]:
                if name == "empty":
                    run(folder, "cache", "--clear")
                report, took = run(folder, *render, *(["--no-cache"] if name == "without" else []))
                seconds.setdefault(name, []).append(took)
                for stage, ms in report["stages"].items():
                    stages.setdefault(stage, []).append(ms)
                pictures.add(picture.read_bytes())
        assert len(pictures) == 1, f"{scene}: the pictures differ"
        kept, _ = run(folder, "cache")
        took = "".join(f"{statistics.median(seconds[name]):8.2f} s" for name in ["without", "empty", "full"])
        saved = [
            f"{statistics.median(stages[stage]):9.0f} to {statistics.median(stages['cached_' + stage]):4.0f} ms"
            if "cached_" + stage in stages
            else f"{statistics.median(stages[stage]):9.0f} ms, not kept"
            for stage in ["visibility", "picture_table"]
        ]
        print(f"{scene:22}{took}   {saved[0]:>20}{saved[1]:>22}   {kept['files']} files, {kept['bytes']:,} bytes")
