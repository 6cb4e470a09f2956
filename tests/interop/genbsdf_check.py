"""Radiance's own light transport on the exported tile against our Klems matrix: what genBSDF does, with rfluxmtx and one
bounce, which is what both compute. Matte grooves, for Radiance's bounces are matte.

    python tests/interop/genbsdf_check.py
"""

import re
import subprocess
import tempfile
import time
from pathlib import Path

from common import Table, biscale, export, mean_error, skip

try:
    import numpy as np

    from radiance_check import RINGS, radiance
except ImportError as error:
    skip(f"the Radiance checks need `pip install pyradiance numpy` ({error})")

PERIODS, ALBEDO = 17, 0.75
SCENE = ["fig1e_lambertian", "--set", "material.sides.color=[1,1,1]"]
RECEIVER = "#@rfluxmtx h=kf u=+Y\nvoid glow g\n0\n0\n4 1 1 1 0\n\ng source s\n0\n0\n4 0 0 1 180\n"
# One period in the middle of the others, seen from just above.
LOW, HIGH, TOP = PERIODS // 2, PERIODS // 2 + 1, 0.001
SENDER = f"#@rfluxmtx h=-kf u=+Y\nvoid glow b\n0\n0\n4 0 0 0 0\n\nb polygon p\n0\n0\n12 {LOW} {LOW} {TOP} {HIGH} {LOW} {TOP} {HIGH} {HIGH} {TOP} {LOW} {HIGH} {TOP}\n"


def projected():
    """Projected solid angle of each patch."""
    area = [np.pi * (np.sin(np.radians(high)) ** 2 - np.sin(np.radians(low)) ** 2) / count for low, high, count in RINGS]
    return np.repeat(area, [count for _, _, count in RINGS])


def klems(path):
    """The luminance of the lit side, [leaving, incident]."""
    text = Path(path).read_text()
    block = re.search(r">Visible<.*?Reflection Back.*?<ScatteringData>(.*?)</ScatteringData>", text, re.S).group(1)
    return np.array(block.split(), float).reshape(145, 145)


def main():
    table = Table("matte grooves", "seconds", "mean difference", "allowed", "totals apart", "allowed")
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        report, ours = export(SCENE[0], folder / "tile.xml", *SCENE[1:])
        fluxes = klems(folder / "tile.xml") * projected()[:, None]
        biscale("tile", *SCENE, "-o", folder / "tile.obj", "--repeat", f"{PERIODS}x{PERIODS}", "--quiet")
        start = time.time()
        materials = "".join(f"void plastic {name}\n0\n0\n5 {ALBEDO} {ALBEDO} {ALBEDO} 0 0\n\n" for name in ["bottom", "sides"])
        (folder / "device.rad").write_text(materials + radiance("obj2rad", folder / "tile.obj"))
        (folder / "receiver.rad").write_text(RECEIVER)
        (folder / "sender.rad").write_text(SENDER)
        options = "-h -ab 1 -ad 32 -lw 1e-9 -c 4000 -n 2".split()
        text = radiance("rfluxmtx", *options, "sender.rad", "receiver.rad", "device.rad", cwd=folder)
        theirs = time.time() - start
        matrix = np.array(text.split(), float).reshape(145, 145, 3)[:, :, 1]
        # Reciprocal: rays that Radiance sends out of a patch are our light that comes in through it.
        difference = mean_error(matrix.T, fluxes)
        totals = np.abs(matrix.sum(1) / fluxes.sum(0) - 1).max()
        table.row("Radiance", f"{theirs:.1f}")
        table.check(
            difference < 0.06 and totals < 0.03, "biscale", f"{ours:.1f}", f"{100 * difference:.1f} %", "6 %", f"{100 * totals:.1f} %", "3 %"
        )
    table.finish()


if __name__ == "__main__":
    main()
