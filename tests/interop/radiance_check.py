"""Radiance reads our XML: `checkBSDF` accepts it, and its hemispherical totals are ours.

    python tests/interop/radiance_check.py [SCENE ...]
"""

import argparse
import os
import subprocess
import tempfile
import time
from pathlib import Path

from common import Table, evaluate, export, mean_error, random_pairs, skip

try:
    import numpy as np
    import pyradiance
except ImportError as error:
    skip(f"the Radiance checks need `pip install pyradiance numpy` ({error})")

RADIANCE = Path(pyradiance.__file__).parent
ENVIRONMENT = {
    **os.environ,
    "PATH": f"{RADIANCE / 'bin'}{os.pathsep}{os.environ['PATH']}",
    "RAYPATH": f".{os.pathsep}/{os.pathsep}{RADIANCE / 'lib'}",
}
# Rings of Klems' basis (bounds in degrees, patches), and the patches whose totals are compared (ring, patch).
RINGS = [(0, 5, 1), (5, 15, 8), (15, 25, 16), (25, 35, 20), (35, 45, 24), (45, 55, 24), (55, 65, 24), (65, 75, 16), (75, 90, 12)]
PATCHES = [(0, 0), (1, 0), (2, 5), (4, 6), (6, 12), (7, 3)]


def radiance(*command, **options):
    return subprocess.run([*map(str, command)], env=ENVIRONMENT, capture_output=True, text=True, check=True, **options).stdout


def light_over_patch(ring, patch, side=4):
    """Source directions spread over an incident patch: those that light travelling in the patch's directions comes from."""
    low, high, count = RINGS[ring]
    sines = np.sin(np.radians([low, high])) ** 2
    at = (np.arange(side) + 0.5) / side
    theta = np.arcsin(np.sqrt(sines[0] + (sines[1] - sines[0]) * at))
    phi = (patch - 0.5 + at) / count * 2 * np.pi + np.pi
    return [grid.ravel() for grid in np.meshgrid(theta, phi)]


def leaving(rings=24, steps=96):
    """Directions of equal projected solid angle."""
    theta = np.arcsin(np.sqrt((np.arange(rings) + 0.5) / rings))
    phi = (np.arange(steps) + 0.5) / steps * 2 * np.pi
    return [grid.ravel() for grid in np.meshgrid(theta, phi)]


def our_total(scene, folder, ring, patch):
    """The luminance reflected of light from a patch. f_bar(i, o) / cos(theta_i) is the BRDF, so its mean over leaving
    directions of equal projected solid angle, times pi, is the total."""
    theta_i, phi_i = light_over_patch(ring, patch)
    theta_o, phi_o = leaving()
    pairs = np.array([(ti, pi, to, po) for ti, pi in zip(theta_i, phi_i) for to, po in zip(theta_o, phi_o)])
    brdf = evaluate(scene, pairs, folder) / np.cos(pairs[:, :1])
    return np.pi * (brdf @ [0.2126, 0.7152, 0.0722]).mean()


def radiance_total(bsdf, ring, patch):
    """Radiance's own hemispherical reflectance, over the same directions."""
    theta, phi = np.degrees(light_over_patch(ring, patch))
    return float(np.mean([pyradiance.bsdf.direct_hemi(bsdf, *at, pyradiance.bsdf.SAMPLE_ALL) for at in zip(theta, phi)]))


def values(bsdf, pairs):
    """Radiance's own value of the luminance, times the cosine of the light."""
    found = [pyradiance.bsdf.query(bsdf, *row)[1] for row in np.degrees(pairs)]
    return np.array(found) * np.cos(pairs[:, 0])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=["fig1e_lambertian", "fig5a_isotropic", "default"])
    table = Table("scene", "basis", "bytes", "written [s]", "loaded [s]", "accepted", "total Radiance", "total ours", "worst", "allowed", "values apart")
    with tempfile.TemporaryDirectory() as folder:
        for scene in parser.parse_args().scenes:
            # Values between patches differ by the width of the patches; that they agree at all shows which angle is which.
            pairs = random_pairs(500, lowest_deg=75)
            expected = evaluate(scene, pairs, folder) @ [0.2126, 0.7152, 0.0722]
            ours = [our_total(scene, folder, *patch) for patch in PATCHES]
            for basis in ["klems", "tensor-tree"]:
                path = Path(folder) / f"{scene}_{basis}.xml"
                report, seconds = export(scene, path, "--radiance", basis)
                told = radiance("checkBSDF", path)
                kind = {"klems": "Klems_Full", "tensor-tree": "Anisotropic_Tensor_Tree"}[basis]
                accepted = f"Type: {kind}" in told and "Color: 1" in told
                start = time.time()
                bsdf = pyradiance.bsdf.load_file(str(path))
                loaded = time.time() - start
                theirs = [radiance_total(bsdf, *patch) for patch in PATCHES]
                worst = max(abs(a / b - 1) for a, b in zip(theirs, ours))
                # A cell of the tree is 1/32 of the square and has one incident direction.
                limit = {"klems": 0.01, "tensor-tree": 0.02}[basis]
                table.check(
                    accepted and worst < limit, scene, basis, report["bytes"], f"{seconds:.1f}", f"{loaded:.2f}",
                    "yes" if accepted else "no", f"{theirs[3]:.4f}", f"{ours[3]:.4f}", f"{100 * worst:.2f} %", f"{100 * limit:.0f} %",
                    f"{100 * mean_error(values(bsdf, pairs), expected):.0f} %",
                )
    table.finish()


if __name__ == "__main__":
    main()
