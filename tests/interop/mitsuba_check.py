"""Mitsuba 3 on exported RGL tables: `measured` loads them, its `eval` agrees with `biscale eval`, its `sample` and `pdf` pass
its chi-squared test, and a sphere that it renders agrees with the one of biscale. The importer of RGL files is compared with
Mitsuba's `eval` of the same files.

    python tests/interop/mitsuba_check.py [--pictures SPHERES.png] [SCENE:LIMIT[:RESOLUTION:RESOLUTION_O] ...]

LIMIT is the largest mean error [%]. BISCALE names the program, BISCALE_DATA a folder of measured files, DRJIT_LIBLLVM_PATH
an LLVM library of version 15 or later if that of the system is older (the chi-squared test needs it).
"""

import argparse
import contextlib
import os
import tempfile
import time
from pathlib import Path

from common import Table, biscale, direction, evaluate, export, mean_error, random_pairs, skip

try:
    import mitsuba as mi
    import numpy as np
except ImportError as error:
    skip(f"the Mitsuba checks need `pip install mitsuba numpy` ({error})")

# The bound is 1 % for smooth and 3 % for glossy scenes. The light that bounces between the glossy facets of `default` adds lobes, which
# need more steps of the light than the default has.
FLAT = Path(__file__).parent / "flat_metal.toml"
SCENES = [f"{FLAT}:1", "fig5a_isotropic:1", "fig4b_bicolor_cup:3", "fig7a_shot_silk:3", "default:3:24x64:64x64"]
LIGHTS = [([0.3, 0.5, 0.8], [2.0, 1.6, 1.2]), ([-0.8, 0.4, 0.4], [0.3, 0.6, 1.2]), ([0.2, -0.6, 0.7], [0.5, 0.4, 0.3])]
DISTANCE, FOV_DEG, SIZE = 5.0, 30.0, 256
EYE = [DISTANCE * np.sin(np.radians(25)) * np.cos(np.radians(20)), DISTANCE * np.sin(np.radians(20)), DISTANCE * np.cos(np.radians(25)) * np.cos(np.radians(20))]
MEASURED = ["chm_orange_rgb", "irid_flake_paint1_rgb", "vch_silk_blue_rgb"]
# Directions of the viewer (theta, phi in degrees) of the chi-squared tests, and the level of all of them together.
VIEWERS, LEVEL = [(5, 20), (35, 70), (60, 200), (75, 310)], 0.01


def bsdf_values(path, pairs):
    """Returns the `eval` of `measured` with the viewer as its wi."""
    bsdf = mi.load_dict({"type": "measured", "filename": str(path)})
    interaction = mi.SurfaceInteraction3f()
    out = np.empty((len(pairs), 3))
    for k, (i, o) in enumerate(zip(direction(pairs[:, 0], pairs[:, 1]), direction(pairs[:, 2], pairs[:, 3]))):
        interaction.wi = mi.Vector3f(*o)
        out[k] = bsdf.eval(mi.BSDFContext(), interaction, mi.Vector3f(*i))
    return out


def sphere(material):
    """Renders the unit sphere with the pole upwards, with the light and the camera of the scene of `ours`."""
    material = mi.load_dict(material)

    def lit_by(towards, irradiance):
        return mi.load_dict({
            "type": "scene",
            "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
            "sensor": {
                "type": "perspective",
                "fov": FOV_DEG,
                "fov_axis": "smaller",
                "to_world": mi.ScalarTransform4f().look_at(EYE, [0, 0, 0], [0, 1, 0]),
                "film": {
                    "type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}, "pixel_format": "rgb"
                },
            },
            # The pole of Mitsuba's sphere is +z and its tangent points east; that of biscale is +y.
            "sphere": {
                "type": "sphere",
                "to_world": mi.ScalarTransform4f().rotate([1, 0, 0], -90),
                "material": material,
            },
            "light": {
                "type": "directional",
                "direction": [-x for x in towards],
                "irradiance": {"type": "rgb", "value": irradiance},
            },
        })

    # One light at a time: with several, Mitsuba samples one per ray, which makes the image noisy.
    images = [np.array(mi.render(lit_by(*light), spp=32))[:, :, :3] for light in LIGHTS]
    return np.sum(images, axis=0)


def ours(name, folder):
    """Renders the same sphere with `biscale render`."""
    listed = ", ".join(f"{{ direction = {towards}, irradiance = {irradiance} }}" for towards, irradiance in LIGHTS)
    image = Path(folder) / "ours.exr"
    biscale(
        "render", name, "-o", image, "--size", f"{SIZE}x{SIZE}", "--samples", 4, "--quiet",
        "--set", "object.kind=\"sphere\"", "--set", "light.environment=\"none\"", "--set", f"light.directional=[{listed}]",
        "--set", f"camera={{ azimuth_deg = 25, elevation_deg = 20, distance = {DISTANCE}, fov_deg = {FOV_DEG} }}",
    )
    return np.array(mi.Bitmap(str(image)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32))


def inside():
    """Returns the pixels well inside the outline of the sphere."""
    half = np.tan(np.radians(FOV_DEG) / 2)
    x, y = np.meshgrid(*2 * [(np.arange(SIZE) + 0.5) / SIZE * 2 * half - half])
    sine = np.hypot(x, y) / np.sqrt(1 + x * x + y * y)
    return sine < 0.99 / DISTANCE


def side_by_side(mitsuba_image, our_image):
    """Writes Mitsuba's image, that of biscale, and ten times their difference."""
    mask = inside()[..., None]
    both = [mitsuba_image * mask, our_image * mask, 10 * np.abs(mitsuba_image - our_image) * mask]
    return np.concatenate(both, axis=1).astype(np.float32)


def chi_squared(plugin, properties, count):
    """Returns the smallest p-value over the viewers, and whether all pass at the level of `count` tests. `properties` is XML."""
    from mitsuba import chi2

    least = 1.0
    for theta, phi in VIEWERS:
        wi = direction(np.radians(theta), np.radians(phi)).tolist()
        sample, pdf = chi2.BSDFAdapter(plugin, properties, wi=wi)
        test = chi2.ChiSquareTest(
            domain=chi2.SphericalDomain(), sample_func=sample, pdf_func=pdf, sample_dim=3, sample_count=1_000_000, ires=32, seed=0
        )
        # The test prints details and writes a file if it fails. The table holds the result.
        with contextlib.redirect_stdout(None), tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            test.run(LEVEL)
        least = min(least, float(np.ravel(test.p_value)[0]))
    # The level of each of many tests (Sidak).
    return least, least > 1 - (1 - LEVEL) ** (1 / count)


def check_exports(arguments, folder):
    table = Table("scene", "bytes", "written [CPU s]", "loaded [s]", "mean error", "allowed", "chi2 least p", "sphere")
    chi_works, rows = llvm_works(), []
    if not chi_works:
        print("SKIPPED: the chi-squared test (Mitsuba's LLVM does not work here)")
    for entry in arguments.scenes:
        scene, limit, *sizes = entry.split(":")
        name = Path(scene).stem
        path = Path(folder) / f"{name}.bsdf"
        options = ["--resolution", sizes[0], "--resolution-o", sizes[1]] if sizes else []
        report, written = export(scene, path, *options)
        pairs = random_pairs(1000)
        values = evaluate(scene, pairs, folder)
        mi.set_variant("scalar_rgb")
        start = time.time()
        mi.load_dict({"type": "measured", "filename": str(path)})
        loaded = time.time() - start
        error = mean_error(bsdf_values(path, pairs), values)
        mitsuba_image, our_image = sphere({"type": "measured", "filename": str(path)}), ours(scene, folder)
        mask = inside()
        image_error = mean_error(mitsuba_image[mask], our_image[mask])
        if arguments.pictures:
            rows.append(side_by_side(mitsuba_image, our_image))
            arguments.pictures.parent.mkdir(parents=True, exist_ok=True)
            mi.util.write_bitmap(str(arguments.pictures), mi.Bitmap(np.concatenate(rows)))
        p, passes = (1.0, True)
        if chi_works:
            mi.set_variant("llvm_ad_rgb")
            properties = f'<string name="filename" value="{path}"/>'
            p, passes = chi_squared("measured", properties, len(VIEWERS) * len(arguments.scenes))
        allowed = f"{limit} %"
        table.check(
            error < float(limit) / 100 and passes and image_error < float(limit) / 100,
            name, report["bytes"], f"{written:.1f}", f"{loaded:.2f}", f"{100 * error:.2f} %", allowed,
            f"{p:.3f}" if chi_works else "skipped", f"{100 * image_error:.2f} %",
        )
    return table.passed


def check_spectral(folder):
    """Compares the colour of a spectral file in daylight with that of a spectral variant of Mitsuba."""
    scene, count = "fig5a_isotropic", 60
    path = Path(folder) / f"{scene}_spec.bsdf"
    report, written = export(scene, path)
    pairs = random_pairs(count, lowest_deg=75)
    mi.set_variant("scalar_spectral")
    bsdf = mi.load_dict({"type": "measured", "filename": str(path)})
    daylight = mi.load_dict({"type": "d65"})
    interaction = mi.SurfaceInteraction3f()
    wavelengths = np.arange(380, 780, 5.0)
    found, white = np.zeros((count, 3)), np.zeros(3)
    for chunk in wavelengths.reshape(-1, 4):
        interaction.wavelengths = chunk.tolist()
        power = np.array(daylight.eval(interaction))[:, None] * np.array([np.ravel(mi.cie1931_xyz(nm)) for nm in chunk])
        white += power.sum(0)
        for k, (i, o) in enumerate(zip(direction(pairs[:, 0], pairs[:, 1]), direction(pairs[:, 2], pairs[:, 3]))):
            interaction.wi = mi.Vector3f(*o)
            found[k] += np.array(bsdf.eval(mi.BSDFContext(), interaction, mi.Vector3f(*i))) @ power
    srgb = np.array([[3.2409699, -1.5373832, -0.4986108], [-0.9692436, 1.8759675, 0.0415551], [0.0556301, -0.203977, 1.0569715]])
    found = found @ srgb.T / (srgb @ white)
    error = mean_error(found, evaluate(scene, pairs, folder))
    table = Table("spectral file", "bytes", "written [CPU s]", "mean error", "allowed")
    table.check(error < 0.02, f"{scene}_spec", report["bytes"], f"{written:.1f}", f"{100 * error:.2f} %", "2 %")
    return table.passed


def llvm_works():
    """Returns whether the chi-squared test can run. It tries in another process, because a bad LLVM ends the process."""
    import subprocess
    import sys

    trial = "import mitsuba as mi; mi.set_variant('llvm_ad_rgb'); import drjit as dr; print(dr.sin(mi.Float([1, 2])), mi.warp.square_to_uniform_hemisphere(mi.Point2f(mi.Float([.1, .2]), .5)), dr.minimum(dr.maximum(mi.Float([1,2]),0),1))"
    return subprocess.run([sys.executable, "-c", trial], capture_output=True).returncode == 0


def check_import(folder):
    """Compares `biscale eval` of a flat tile of a measured material with Mitsuba's `eval` of the file. biscale averages both
    directions of light, so that its values are reciprocal."""
    data = Path(os.environ.get("BISCALE_DATA", "."))
    table = Table("measured file", "mean error", "allowed", "file itself")
    mi.set_variant("scalar_rgb")
    for name in MEASURED:
        path = data / f"{name}.bsdf"
        if not path.exists():
            print(f"SKIPPED: {path} is not there (BISCALE_DATA names its folder)")
            continue
        scene = Path(folder) / "flat.toml"
        scene.write_text(f'[tile]\ngeometry = {{ kind = "flat" }}\n[[material]]\nname = "default"\nbrdf = {{ kind = "rgl", path = "{path}" }}\n')
        pairs = random_pairs(1000, lowest_deg=75)
        swapped = pairs[:, [2, 3, 0, 1]]
        there, back = bsdf_values(path, pairs), bsdf_values(path, swapped)
        cosines = np.cos(pairs[:, [0, 2]])
        # Values include the cosine of the light. biscale stores the mean of both directions.
        mean = 0.5 * (np.maximum(there, 0) + np.maximum(back, 0) * (cosines[:, :1] / cosines[:, 1:]))
        error = mean_error(evaluate(scene, pairs, folder), mean)
        asymmetry = mean_error(there, mean)
        table.check(error < 0.02, name, f"{100 * error:.2f} %", "2 %", f"{100 * asymmetry:.1f} % from reciprocal")
    return table.passed


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", type=Path, help="a .png of the spheres by Mitsuba, by biscale, and ten times their difference; one row per scene")
    parser.add_argument("scenes", nargs="*", default=SCENES, metavar="SCENE:LIMIT")
    arguments = parser.parse_args()
    print(f"Mitsuba {mi.__version__}")
    with tempfile.TemporaryDirectory() as folder:
        passed = check_import(folder)
        passed &= check_spectral(folder)
        passed &= check_exports(arguments, folder)
    raise SystemExit(0 if passed else 1)


if __name__ == "__main__":
    main()
