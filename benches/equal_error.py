"""Time at equal error. f_bar of the same pairs by `biscale eval`, by its reference, and by Mitsuba 3 (LLVM, all cores), against
many more rays of Mitsuba; and a Klems matrix by `biscale export` and by Radiance's rfluxmtx, which genBSDF runs.

    python benches/equal_error.py [SCENE... | klems] [--pairs 400] [--truth-rays 524288] [--no-reference]

It needs `pip install mitsuba pyradiance numpy`. BISCALE names the program. Times are wall-clock seconds. Those of biscale include
the whole process; those of Mitsuba exclude its import and the loading of the tile.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/interop"))
from common import Table, biscale, direction, evaluate, export, random_pairs, skip  # noqa: E402

try:
    import drjit as dr
    import mitsuba as mi
    import numpy as np
except ImportError as error:
    skip(f"the comparison needs `pip install mitsuba numpy` ({error})")

mi.set_variant("llvm_ad_rgb")
ROUGHNESS, REPEAT, GOLDEN = 0.2, 13, 0.6180339887
# A white material has a Fresnel factor of 1 in both programs.
GLOSSY = f'material=[{{ name = "default", brdf = {{ kind = "ggx", roughness = {ROUGHNESS}, f0 = 1 }} }}]'
# Mitsuba follows one reflection.
DIRECT = ("--effect", "interreflection=off")
SCENES = ["table4_plate", "table4_skirt", "table4_pillow", "klems"]
RAYS = [16, 64, 256, 1024, 4096, 16384]
# Most rays of one launch.
LAUNCH = 1 << 23


def psnr(found, truth):
    return 20 * np.log10(truth.max() / np.sqrt(np.mean((found - truth) ** 2)))


def rel_l2(found, truth):
    return np.linalg.norm(found - truth) / np.linalg.norm(truth)


def tile(scene, folder):
    """Returns a scene of many periods of the tile, and the height of its top."""
    path = Path(folder) / f"{scene}.obj"
    biscale("tile", scene, "-o", path, "--repeat", f"{REPEAT}x{REPEAT}", "--quiet")
    heights = [float(line.split()[3]) for line in path.open() if line.startswith("v ")]
    return mi.load_dict({"type": "scene", "tile": {"type": "obj", "filename": str(path), "face_normals": True}}), max(heights)


def ggx(n, i, o):
    """Returns f times the cosine of the light, for white GGX with height-correlated shadowing."""
    squared = ROUGHNESS**2
    to_light, to_view = dr.dot(n, i), dr.dot(n, o)
    h = dr.normalize(i + o)
    across = dr.squared_norm(dr.cross(n, h))
    peak = squared / (dr.pi * dr.square(across + squared * dr.square(dr.dot(n, h))))
    def slope(cosine):
        return dr.sqrt(squared + (1 - squared) * cosine * cosine)
    shadowing = 2 * to_light * to_view / (to_view * slope(to_light) + to_light * slope(to_view))
    return dr.select((to_light > 0) & (to_view > 0), peak * shadowing / (4 * to_view), 0)


def traced(scene, top, pairs, rays, seed):
    """Returns f_bar as the mean over rays from one period of a plane above the tile."""
    lights, views = direction(pairs[:, 0], pairs[:, 1]), direction(pairs[:, 2], pairs[:, 3])
    offsets = np.random.default_rng(seed).random((len(pairs), 2))
    together = max(1, LAUNCH // rays)
    values = []
    for first in range(0, len(pairs), together):
        part = slice(first, first + together)
        count = len(lights[part])
        index = dr.arange(mi.UInt32, count * rays)
        pair, ray = index // rays, index % rays
        def of(array):
            columns = [mi.Float(array[part, axis].astype(np.float32)) for axis in range(array.shape[1])]
            return [dr.gather(mi.Float, column, pair) for column in columns]
        i, o, (x0, y0) = mi.Vector3f(*of(lights)), mi.Vector3f(*of(views)), of(offsets)
        x, y = (mi.Float(ray) + x0) / rays, mi.Float(ray) * GOLDEN + y0
        start = mi.Point3f(REPEAT // 2 + x - dr.floor(x), REPEAT // 2 + y - dr.floor(y), top + 1e-4)
        met = scene.ray_intersect_preliminary(mi.Ray3f(start, -o))
        surface = met.compute_surface_interaction(mi.Ray3f(start, -o))
        valid = met.is_valid()
        blocked = scene.ray_test(mi.Ray3f(surface.p + 2e-5 * surface.n, i), valid)
        value = dr.select(valid & ~blocked, ggx(surface.n, i, o), 0)
        values.append(np.array(dr.block_sum(value, rays)) / rays)
    return np.concatenate(values)


def timed(work):
    """Returns the seconds and the result of the second run, because the first compiles."""
    work()
    start = time.time()
    result = work()
    return time.time() - start, result


def compare(name, folder, options):
    scene, top = tile(name, folder)
    pairs, rays = random_pairs(options.pairs), options.truth_rays
    truth = traced(scene, top, pairs, rays, 1)
    again = traced(scene, top, pairs, rays // 4, 2)
    print(f"\n{name}, GGX {ROUGHNESS}, {len(pairs)} pairs; truth: {rays} rays per pair, {psnr(again, truth):.1f} dB from an independent quarter as many")
    table = Table("by", "setting", "seconds", "PSNR [dB]", "relative L2")
    def row(by, setting, seconds, values):
        table.row(by, setting, f"{seconds:.3f}", f"{psnr(values, truth):.1f}", f"{100 * rel_l2(values, truth):.2f} %")
        return seconds, psnr(values, truth)
    def eval_with(*flags):
        return lambda: evaluate(name, pairs, folder, "--set", GLOSSY, "--backend", "cpu", *DIRECT, *flags)[:, 1]
    ours = [row("biscale", preset, *timed(eval_with("--quality", preset))) for preset in ["draft", "standard", "fine"]]
    fewer = [rays for rays in RAYS if 4 * rays <= options.truth_rays]
    theirs = [row("Mitsuba", f"{rays} rays", *timed(lambda: traced(scene, top, pairs, rays, 3))) for rays in fewer]
    for seconds, db in ours:
        print(f"at {db:.1f} dB: {seconds_at(theirs, db) / seconds:.1f} times as fast as Mitsuba for {len(pairs)} pairs", flush=True)
    if not options.reference:
        return
    start = time.time()
    values = eval_with("--quality", "reference")()
    row("reference", "rays, no tables", time.time() - start, values)


def seconds_at(points, db):
    """Returns the seconds for a PSNR, by log-linear interpolation of the points, or by extrapolation of the last two."""
    k = next((k for k in range(1, len(points)) if points[k][1] >= db), len(points) - 1)
    (t0, d0), (t1, d1) = points[k - 1], points[k]
    return np.exp(np.log(t0) + (np.log(t1) - np.log(t0)) * (db - d0) / (d1 - d0))


def compare_klems(folder):
    try:
        from genbsdf_check import ALBEDO, RECEIVER, SCENE, SENDER, device, klems, projected
        from radiance_check import ENVIRONMENT  # noqa: F401
        from radiance_check import radiance
    except (ImportError, SystemExit) as error:
        print(f"SKIPPED: Radiance needs `pip install pyradiance` ({error})")
        return
    print(f"\nKlems matrix, 145 x 145, of {SCENE[0]} in one diffuse material; truth: `biscale export --quality fine --seed 9`")
    export(SCENE[0], folder / "truth.xml", *SCENE[1:], "--quality", "fine", "--seed", 9)
    truth = klems(folder / "truth.xml") * projected()[:, None]
    table = Table("by", "setting", "seconds", "PSNR [dB]", "relative L2")
    def row(by, setting, seconds, values):
        table.row(by, setting, f"{seconds:.1f}", f"{psnr(values, truth):.1f}", f"{100 * rel_l2(values, truth):.2f} %")
    for preset in ["draft", "standard"]:
        start = time.time()
        export(SCENE[0], folder / "tile.xml", *SCENE[1:], "--quality", preset)
        row("biscale export", preset, time.time() - start, klems(folder / "tile.xml") * projected()[:, None])
    material = f"plastic {{}}\n0\n0\n5 {ALBEDO} {ALBEDO} {ALBEDO} 0 0\n\n"
    (folder / "device.rad").write_text(device(folder, SCENE, material))
    (folder / "receiver.rad").write_text(RECEIVER)
    (folder / "sender.rad").write_text(SENDER)
    for rays in [250, 1000, 4000]:
        start = time.time()
        options = f"-h -ab 1 -ad 32 -lw 1e-9 -c {rays} -n 2".split()
        text = radiance("rfluxmtx", *options, "sender.rad", "receiver.rad", "device.rad", cwd=folder)
        matrix = np.array(text.split(), float).reshape(145, 145, 3)[:, :, 1].T
        row("rfluxmtx", f"{rays} rays per patch", time.time() - start, matrix)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--pairs", type=int, default=400)
    parser.add_argument("--truth-rays", type=int, default=1 << 19)
    parser.add_argument("--no-reference", dest="reference", action="store_false", help="omit the reference, which takes minutes")
    options = parser.parse_args()
    print(f"Mitsuba {mi.__version__}")
    with tempfile.TemporaryDirectory() as folder:
        for name in options.scenes:
            if name == "klems":
                compare_klems(Path(folder))
            else:
                compare(name, folder, options)


if __name__ == "__main__":
    main()
