"""Light transport of Radiance on the exported tile, against the Klems matrix of biscale. Diffuse grooves are computed as genBSDF
does, by rfluxmtx with one bounce. Grooves of Radiance's rough metal, which biscale reads as a MERL file, are computed direction by
direction with rtrace and a light source. rfluxmtx does not fit there, because it scales the light scattered by a rough metal to the
full reflectance at every angle: a flat sheet of 0.75 returns 0.75 at 85 degrees, while its formula returns 0.59.

    python tests/interop/genbsdf_check.py
"""

import re
import subprocess
import tempfile
from pathlib import Path

from common import Table, biscale, children_seconds, direction, evaluate, export, mean_error, random_pairs, skip

try:
    import numpy as np

    from glossy_metal import write_merl
    from radiance_check import ENVIRONMENT, RINGS, radiance
except ImportError as error:
    skip(f"the Radiance checks need `pip install pyradiance numpy` ({error})")

PERIODS, ALBEDO, ROUGHNESS = 17, 0.75, 0.3
# Radiance follows one reflection.
SCENE = ["fig1e_lambertian", "--set", "material.sides.color=[1,1,1]", "--set", "effects.interreflection=off"]
# Pairs of the glossy check, rays over the period (a lattice), and the angular width of the source.
PAIRS, RAYS, GOLDEN, SOURCE_DEG = 80, 2000, 0.618034, 0.5
SLOTS = ["bottom", "sides"]
RECEIVER = "#@rfluxmtx h=kf u=+Y\nvoid glow g\n0\n0\n4 1 1 1 0\n\ng source s\n0\n0\n4 0 0 1 180\n"
# One period in the middle of the others, viewed from just above.
LOW, HIGH, TOP = PERIODS // 2, PERIODS // 2 + 1, 0.001
SENDER = f"#@rfluxmtx h=-kf u=+Y\nvoid glow b\n0\n0\n4 0 0 0 0\n\nb polygon p\n0\n0\n12 {LOW} {LOW} {TOP} {HIGH} {LOW} {TOP} {HIGH} {HIGH} {TOP} {LOW} {HIGH} {TOP}\n"


def projected():
    """Returns the projected solid angle of each patch."""
    area = [np.pi * (np.sin(np.radians(high)) ** 2 - np.sin(np.radians(low)) ** 2) / count for low, high, count in RINGS]
    return np.repeat(area, [count for _, _, count in RINGS])


def klems(path):
    """Returns the luminance on the lit side, indexed [leaving, incident]."""
    text = Path(path).read_text()
    block = re.search(r">Visible<.*?Reflection Back.*?<ScatteringData>(.*?)</ScatteringData>", text, re.S).group(1)
    return np.array(block.split(), float).reshape(145, 145)


def device(folder, scene, material):
    """Returns the exported tile in a material of Radiance."""
    biscale("tile", *scene, "-o", folder / "tile.obj", "--repeat", f"{PERIODS}x{PERIODS}", "--quiet")
    return "".join(f"void {material.format(slot)}" for slot in SLOTS) + radiance("obj2rad", folder / "tile.obj")


def check_matte(folder):
    table = Table("diffuse grooves", "rfluxmtx [CPU s]", "biscale [CPU s]", "mean difference", "allowed", "difference of totals", "allowed")
    _, ours = export(SCENE[0], folder / "tile.xml", *SCENE[1:])
    fluxes = klems(folder / "tile.xml") * projected()[:, None]
    start = children_seconds()
    material = f"plastic {{}}\n0\n0\n5 {ALBEDO} {ALBEDO} {ALBEDO} 0 0\n\n"
    (folder / "device.rad").write_text(device(folder, SCENE, material))
    (folder / "receiver.rad").write_text(RECEIVER)
    (folder / "sender.rad").write_text(SENDER)
    options = "-h -ab 1 -ad 32 -lw 1e-9 -c 4000 -n 2".split()
    text = radiance("rfluxmtx", *options, "sender.rad", "receiver.rad", "device.rad", cwd=folder)
    theirs = children_seconds() - start
    matrix = np.array(text.split(), float).reshape(145, 145, 3)[:, :, 1]
    # By reciprocity, rays that leave through a patch correspond to light that enters through it.
    difference = mean_error(matrix.T, fluxes)
    totals = np.abs(matrix.sum(1) / fluxes.sum(0) - 1).max()
    table.check(
        difference < 0.06 and totals < 0.03, "Klems, 145 x 145", f"{theirs:.1f}", f"{ours:.1f}",
        f"{100 * difference:.1f} %", "6 %", f"{100 * totals:.1f} %", "3 %",
    )
    return table.passed


def check_glossy(folder):
    table = Table(f"metal {ROUGHNESS} grooves", "rtrace [CPU s]", "biscale [CPU s]", "mean difference", "allowed")
    write_merl(folder / "metal.binary", ALBEDO, ROUGHNESS)
    scene = [*SCENE, "--set", f'material.default.brdf={{ kind = "merl", path = "{folder / "metal.binary"}" }}']
    pairs = random_pairs(PAIRS, lowest_deg=75)
    lights, views = direction(pairs[:, 0], pairs[:, 1]), direction(pairs[:, 2], pairs[:, 3])
    start = children_seconds()
    ours = evaluate(scene[0], pairs, folder, *scene[1:])[:, 1]
    seconds = children_seconds() - start
    start = children_seconds()
    grooves = device(folder, scene, f"metal {{}}\n0\n0\n5 {ALBEDO} {ALBEDO} {ALBEDO} 1 {ROUGHNESS}\n\n")
    theirs = np.array([lit(folder, grooves, light, view) for light, view in zip(lights, views)])
    took = children_seconds() - start
    difference = mean_error(theirs, ours)
    table.check(difference < 0.02, f"f_bar of {PAIRS} pairs", f"{took:.1f}", f"{seconds:.1f}", f"{100 * difference:.1f} %", "2 %")
    return table.passed


def lit(folder, grooves, light, view):
    """Returns f_bar by rtrace: the mean radiance of parallel rays over one period, divided by the irradiance of a small source."""
    source = f"void light l\n0\n0\n3 1 1 1\n\nl source s\n0\n0\n4 {light[0]} {light[1]} {light[2]} {SOURCE_DEG}\n"
    (folder / "lit.rad").write_text(grooves + "\n" + source)
    with open(folder / "lit.oct", "wb") as octree:
        subprocess.run(["oconv", "lit.rad"], env=ENVIRONMENT, cwd=folder, stdout=octree, check=True)
    count = np.arange(RAYS)
    x, y = LOW + (count + 0.5) / RAYS, LOW + np.mod(count * GOLDEN, 1)
    rows = np.column_stack([x + view[0], y + view[1], TOP + view[2] + 0 * x, *np.outer(-view, np.ones(len(x)))])
    text = radiance("rtrace", *"-h -ab 0 -st 1 -ss 0 -dj 0 -ds 0".split(), "lit.oct", cwd=folder, input="\n".join(" ".join(map(str, row)) for row in rows))
    return np.array(text.split(), float).reshape(-1, 3)[:, 1].mean() / (2 * np.pi * (1 - np.cos(np.radians(SOURCE_DEG / 2))))


def main():
    with tempfile.TemporaryDirectory() as folder:
        passed = check_matte(Path(folder))
        passed &= check_glossy(Path(folder))
    raise SystemExit(0 if passed else 1)


if __name__ == "__main__":
    main()
