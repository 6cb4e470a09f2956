"""Mitsuba's path tracer on tiles that reflect light between their facets. It renders the tile itself, repeated, without any
table of biscale, with one scattering and with all; the difference is the bounced light, as that of `biscale eval` with
`interreflection` on and off.

    python tests/interop/bounces_check.py

BISCALE names the program, DRJIT_LIBLLVM_PATH an LLVM library of version 15 or later if that of the system is older. Without
LLVM, Mitsuba traces one path at a time, which is too slow: the check is skipped.
"""

import tempfile
from pathlib import Path

from common import Table, biscale, direction, evaluate, random_pairs, skip

try:
    import mitsuba as mi
    import numpy as np
except ImportError as error:
    skip(f"the check of bounced light needs `pip install mitsuba numpy` ({error})")

from mitsuba_check import llvm_works

# Tiles, and how often they are repeated, so that the part in the middle sees no edge.
HEIGHTS = [[0.15 * np.sin(2 * np.pi * (i + 0.5) / 32) * np.sin(2 * np.pi * (j + 0.5) / 32) for i in range(32)] for j in range(32)]
TILES = {
    "V-grooves": ('{ kind = "grooves", profile = "v", count = 2, depth = 0.25, side_angle_deg = 45, rotation_deg = 0 }', 21),
    "egg-crate": (f'{{ kind = "heightfield", values = {[[round(float(h), 6) for h in row] for row in HEIGHTS]} }}', 9),
    "pyramids": ('{ kind = "pyramids", height = 0.3, spacing = 0.5 }', 21),
}
MATERIALS = {
    "matte 0.9": ('{ kind = "lambertian", albedo = 0.9 }', {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.9}}),
    "GGX 0.2": ('{ kind = "ggx", roughness = 0.2, f0 = 1 }', {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": 0.2}),
    "GGX 0.3": ('{ kind = "ggx", roughness = 0.3, f0 = 1 }', {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": 0.3}),
}
# Allowed relative L2 of matte and of glossy bounced light. Where it is a smaller share, `standard` spends a third of the rays on it.
LARGE_SHARE, LARGE, SMALL = 0.35, (0.01, 0.03), (0.03, 0.07)
PAIRS, LOWEST_DEG = 12, 60
# Independent renderings, whose spread is the standard error.
RENDERINGS = 6


def radiance(mesh, middle, material, pair, depth, paths, seed):
    """Returns the mean radiance of the middle tile towards the viewer, for a light of irradiance 1."""
    towards, viewer = direction(pair[0], pair[1]), direction(pair[2], pair[3])
    x, y, z = middle
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": depth, "rr_depth": 64},
        "sensor": {
            "type": "distant",
            "direction": [-float(c) for c in viewer],
            # Rays through all points of one period have the weights of what the viewer sees.
            "target": {
                "type": "rectangle",
                "to_world": mi.ScalarTransform4f().translate([x, y, z]).scale([0.5, 0.5, 1.0]),
            },
            "film": {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}, "pixel_format": "rgb"},
        },
        "tile": {"type": "obj", "filename": str(mesh), "face_normals": True, "material": material},
        "light": {"type": "directional", "direction": [-float(c) for c in towards], "irradiance": {"type": "rgb", "value": 1.0}},
    })
    return float(np.array(mi.render(scene, spp=paths, seed=seed))[0, 0, 0])


def scattered_light(mesh, middle, material, pairs, paths):
    """Returns the light of one scattering, that of two and more, and the standard error of the latter."""
    found, direct = np.empty((RENDERINGS, len(pairs))), np.empty((RENDERINGS, len(pairs)))
    for k in range(RENDERINGS):
        for at, pair in enumerate(pairs):
            # The same seed gives both renderings the same first points.
            everything, first = (radiance(mesh, middle, material, pair, depth, paths, 1 + k) for depth in (64, 2))
            found[k, at], direct[k, at] = everything - first, first
    return direct.mean(0), found.mean(0), found.std(0, ddof=1) / np.sqrt(RENDERINGS)


def main():
    print(f"Mitsuba {mi.__version__}")
    if not llvm_works():
        skip("Mitsuba finds no LLVM that works")
    mi.set_variant("llvm_ad_rgb")
    paths = 1 << 16
    pairs = random_pairs(PAIRS, seed=5, lowest_deg=LOWEST_DEG)
    table = Table("tile, material", "direct light", "share bounced", "difference", "Mitsuba's error", "allowed")
    with tempfile.TemporaryDirectory() as folder:
        for tile, (geometry, repeats) in TILES.items():
            for name, (brdf, material) in MATERIALS.items():
                scene, mesh = Path(folder) / "tile.toml", Path(folder) / "tile.obj"
                scene.write_text(f'[tile]\ngeometry = {geometry}\n[[material]]\nname = "default"\nbrdf = {brdf}\n')
                biscale("tile", scene, "-o", mesh, "--repeat", f"{repeats}x{repeats}", "--quiet")
                ours = [evaluate(scene, pairs, folder, "--effect", f"interreflection={switch}")[:, 0] for switch in ("on", "off")]
                middle = (0.5 * repeats, 0.5 * repeats, 0.0)
                direct, expected, errors = scattered_light(mesh, middle, material, pairs, paths)
                norm = np.linalg.norm(expected)
                direct = np.linalg.norm(ours[1] - direct) / np.linalg.norm(direct)
                difference = np.linalg.norm(ours[0] - ours[1] - expected) / norm
                noise = np.linalg.norm(errors) / norm
                share = norm / np.linalg.norm(ours[0])
                allowed = (LARGE if share >= LARGE_SHARE else SMALL)["matte" not in name]
                percent = (f"{100 * value:.2f} %" for value in (direct, share, difference, noise, allowed))
                table.check(direct < 0.01 and noise < 0.5 * allowed and difference < allowed + 2 * noise, f"{tile}, {name}", *percent)
    table.finish()


if __name__ == "__main__":
    main()
