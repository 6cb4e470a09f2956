"""Values of a MERL export, read by a reader written here from the published layout, and by the importer of biscale.

The scene must be nearly isotropic. Both are compared with `biscale eval` of the exported scene.

    python tests/interop/merl_check.py [SCENE]
"""

import os
import sys
import tempfile
import time
from pathlib import Path

from common import Table, direction, evaluate, export, mean_error, random_pairs, skip

try:
    import numpy as np
except ImportError as error:
    skip(f"the MERL check needs numpy ({error})")

SHAPE, SCALES = (90, 90, 180), np.array([1.0, 1.15, 1.66]) / 1500


def read(path):
    """Returns the BRDF [1/sr] as an array [theta_h, theta_d, phi_d, rgb]."""
    dimensions = np.fromfile(path, "<i4", 3)
    assert tuple(dimensions) == SHAPE, dimensions
    planes = np.fromfile(path, "<f8", offset=12).reshape(3, *SHAPE)
    return np.moveaxis(planes, 0, -1) * SCALES


def half_difference(i, o):
    """Returns theta_h, theta_d and phi_d of pairs, by rotating the half vector onto the pole."""
    h = (i + o) / np.linalg.norm(i + o, axis=1, keepdims=True)
    theta_h, phi_h = np.arccos(np.clip(h[:, 2], -1, 1)), np.arctan2(h[:, 1], h[:, 0])
    c, s = np.cos(-phi_h), np.sin(-phi_h)
    x, y, z = c * i[:, 0] - s * i[:, 1], s * i[:, 0] + c * i[:, 1], i[:, 2]
    c, s = np.cos(-theta_h), np.sin(-theta_h)
    x, z = c * x + s * z, -s * x + c * z
    return theta_h, np.arccos(np.clip(z, -1, 1)), np.mod(np.arctan2(y, x), np.pi)


def look_up(table, i, o):
    """Interpolates trilinearly between bin centres. Cells with an invalid corner use the nearest bin."""
    theta_h, theta_d, phi_d = half_difference(i, o)
    at = np.stack([90 * np.sqrt(theta_h / (np.pi / 2)), 90 * theta_d / (np.pi / 2), 180 * phi_d / np.pi], 1) - 0.5
    at[:, :2] = np.clip(at[:, :2], 0, 89)
    base = np.floor(at).astype(int)
    value, valid = 0, True
    for corner in np.ndindex(2, 2, 2):
        k = base + corner
        k = np.minimum(k[:, 0], 89), np.minimum(k[:, 1], 89), k[:, 2] % 180
        weight = np.prod(np.where(corner, at - base, 1 - (at - base)), axis=1)
        value = value + weight[:, None] * table[k]
        valid = valid & (table[k].min(1) >= 0)
    nearest = np.rint(at).astype(int)
    nearest = table[np.minimum(nearest[:, 0], 89), np.minimum(nearest[:, 1], 89), nearest[:, 2] % 180]
    return np.where(valid[:, None], value, np.maximum(nearest, 0))


def main():
    scene = sys.argv[1] if len(sys.argv) > 1 else "fig5a_isotropic"
    table = Table("reader", "scene", "bytes", "seconds", "mean error", "allowed", "anisotropy lost")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "material.binary"
        report, written = export(scene, path)
        pairs = random_pairs(1000, lowest_deg=75)
        i, o = direction(pairs[:, 0], pairs[:, 1]), direction(pairs[:, 2], pairs[:, 3])
        expected = evaluate(scene, pairs, folder)
        lost = f"{100 * report['anisotropy_lost']:.2f} %"
        start = time.time()
        found = look_up(read(path), i, o) * i[:, 2:]
        error = mean_error(found, expected)
        table.check(error < 0.03, "this script", scene, os.path.getsize(path), f"{time.time() - start:.2f}", f"{100 * error:.2f} %", "3 %", lost)
        flat = Path(folder) / "flat.toml"
        flat.write_text(f'[tile]\ngeometry = {{ kind = "flat" }}\n[[material]]\nname = "default"\nbrdf = {{ kind = "merl", path = "{path}" }}\n')
        start = time.time()
        error = mean_error(evaluate(flat, pairs, folder), expected)
        table.check(error < 0.03, "biscale", scene, os.path.getsize(path), f"{time.time() - start:.2f}", f"{100 * error:.2f} %", "3 %", lost)
    table.finish()


if __name__ == "__main__":
    main()
