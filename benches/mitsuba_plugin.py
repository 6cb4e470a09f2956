"""Compares the plugin of `biscale.mitsuba` with `biscale render` and with Mitsuba's `measured` on an exported table.

    python benches/mitsuba_plugin.py [SCENE ...]

It prints, for each scene: wall and CPU time and the memory that loading the plugin takes in a process of its own, the difference of its sphere from
the one of `biscale render`, the least p-value of Mitsuba's chi-squared test over four viewers, and the time of evaluating and sampling a
million pairs over that of `measured`. BISCALE names the program, DRJIT_LIBLLVM_PATH an LLVM library of version 15 or later.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "interop"))

import drjit as dr
import mitsuba as mi
import numpy as np
from common import Table, export, mean_error
from mitsuba_check import FLAT, LEVEL, VIEWERS, chi_squared, inside, ours, sphere

SCENES = [str(FLAT), "fig5a_isotropic", "fig4b_bicolor_cup", "fig7a_shot_silk", "default"]
COUNT = 1_000_000
#: Loads a scene and prints seconds, and megabytes that stay.
LOAD = """
import os, resource, sys, time
import mitsuba as mi
mi.set_variant(sys.argv[2])
import biscale.mitsuba
def resident():
    return int(open("/proc/self/statm").read().split()[1]) * os.sysconf("SC_PAGESIZE") / 1e6
mi.load_dict({"type": "diffuse"})
before, start, busy = resident(), time.perf_counter(), time.process_time()
bsdf = mi.load_dict({"type": "biscale", "scene": sys.argv[1]})
print(time.perf_counter() - start, time.process_time() - busy, resident() - before)
"""


def loading(scene, variant):
    done = subprocess.run([sys.executable, "-c", LOAD, scene, variant], capture_output=True, text=True, check=True)
    return [float(word) for word in done.stdout.split()[-3:]]


def seconds(bsdf):
    """The shortest of five times for one million pairs: sampling, and evaluating with the density."""
    mi.set_variant("llvm_ad_rgb")
    rng = mi.PCG32(size=COUNT)
    si = dr.zeros(mi.SurfaceInteraction3f, COUNT)
    si.wi = mi.warp.square_to_uniform_hemisphere(mi.Point2f(rng.next_float32(), rng.next_float32()))
    wo = mi.warp.square_to_uniform_hemisphere(mi.Point2f(rng.next_float32(), rng.next_float32()))
    one, two = rng.next_float32(), mi.Point2f(rng.next_float32(), rng.next_float32())
    dr.eval(si, wo, one, two)
    context, times = mi.BSDFContext(), []
    for _ in range(5):
        dr.sync_thread()
        start = time.perf_counter()
        dr.eval(bsdf.sample(context, si, one, two, True), bsdf.eval_pdf(context, si, wo, True))
        dr.sync_thread()
        times.append(time.perf_counter() - start)
    return min(times)


def main():
    scenes = sys.argv[1:] or SCENES
    mi.set_variant("llvm_ad_rgb")
    import biscale.mitsuba  # noqa: F401  (registers the plugin)

    table = Table("scene", "loaded [s]", "CPU [s]", "memory [MB]", "sphere", "chi2 least p", "measured [s]", "plugin [s]", "speed")
    with tempfile.TemporaryDirectory() as folder:
        for scene in scenes:
            mi.set_variant("llvm_ad_rgb")
            material = {"type": "biscale", "scene": scene}
            loaded, busy, memory = loading(scene, "llvm_ad_rgb")
            mask = inside()
            error = mean_error(sphere(material)[mask], ours(scene, folder)[mask])
            path = Path(folder) / "table.bsdf"
            export(scene, path)
            theirs = seconds(mi.load_dict({"type": "measured", "filename": str(path)}))
            mine = seconds(mi.load_dict(material))
            p, passes = chi_squared("biscale", f'<string name="scene" value="{scene}"/>', len(VIEWERS) * len(scenes))
            table.check(
                passes and error < 0.015 and loaded <= 1 and memory <= 60 and theirs / mine >= 0.5,
                Path(scene).stem, f"{loaded:.2f}", f"{busy:.2f}", f"{memory:.0f}", f"{100 * error:.2f} %", f"{p:.3f}", f"{theirs:.3f}", f"{mine:.3f}",
                f"{theirs / mine:.2f}",
            )
    print(f"level of all chi-squared tests together: {LEVEL}")
    table.finish()


if __name__ == "__main__":
    main()
