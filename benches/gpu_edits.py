"""Times of edits on a GPU: prints the table of docs/measurements/speed.md. It needs a machine with a GPU.

Usage: python benches/gpu_edits.py [PROGRAM]
"""

import json
import subprocess
import sys

PROGRAM = sys.argv[1] if len(sys.argv) > 1 else "target/release/biscale"
SCENES = ["table4_plate", "table4_teapot", "table4_pillow", "table4_cup", "table4_skirt"]
# Stages of the GPU; all others are those of the CPU.
GPU_STAGES = ["visibility_and_product", "g_buffer", "shadows", "shading"]
ROWS = [
    ("geometry", "draft", ["--edit", "geometry"]),
    ("geometry", "standard", ["--edit", "geometry"]),
    ("camera", "standard", ["--edit", "camera"]),
]


def profile(scene, quality, arguments):
    command = [PROGRAM, "profile", scene, "--picture", "--size", "1920x1080", "--backend", "gpu"]
    command += ["--quality", quality, "--repeat", "9", "--json", "--quiet", *arguments]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def main():
    print("| scene | edit, quality | total | CPU and upload | visibility and product | points | shadows | shading |")
    print("|---|---|---|---|---|---|---|---|")
    for scene in SCENES:
        for edit, quality, arguments in ROWS:
            report = profile(scene, quality, arguments)
            stages = report["stages"]
            gpu = [stages.get(name, 0.0) for name in GPU_STAGES]
            cells = [report["total_ms"], report["total_ms"] - sum(gpu), *gpu]
            print(f"| `{scene}` | {edit}, {quality} | " + " | ".join(f"{ms:.1f}" for ms in cells) + " |", flush=True)


main()
