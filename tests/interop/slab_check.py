"""Mitsuba 3 on exported slabs: a checkerboard seen through two sheets of `roughdielectric` agrees with `biscale render`.

    python tests/interop/slab_check.py [--paths N]

BISCALE names the program.
"""

import argparse
import sys
import tempfile
from pathlib import Path

from common import biscale, skip

try:
    import mitsuba as mi
    import numpy as np
except ImportError as error:
    skip(f"the Mitsuba checks need `pip install mitsuba numpy` ({error})")

# Overrides of slab_fig3_both, and the largest RMS of grey over blocks of pixels.
SCENES = [([], 0.02), (["slab.top={ kind = \"ggx\", roughness = 0.1 }", "slab.absorption=0.3", "slab.thickness=1.0"], 0.02)]
SIZE, BLOCK = 384, 8
# The middle of the image, in which both programs see the sheet.
MIDDLE = slice(130, 250)


def blocks(image):
    """Returns means over blocks, which take out the noise of both programs."""
    grey = image[MIDDLE, MIDDLE].mean(axis=-1)
    count = grey.shape[0] // BLOCK
    return grey.reshape(count, BLOCK, count, BLOCK).mean(axis=(1, 3))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--paths", type=int, default=64)
    arguments = parser.parse_args()
    mi.set_variant("scalar_rgb")
    failed = False
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        source = (Path(__file__).parents[2] / "materials/slab_fig3_both.toml").read_text()
        (folder / "slab.toml").write_text(source)
        mi.Bitmap(np.ones((16, 32, 3), dtype=np.float32)).write(str(folder / "white.exr"))
        for overrides, limit in SCENES:
            options = ["slab.bounces=on", "light.environment=\"white.exr\"", *overrides]
            options = [part for override in options for part in ("--set", override)]
            biscale("render", folder / "slab.toml", "-o", folder / "ours.exr", "--size", f"{SIZE}x{SIZE}", "--quiet", *options)
            biscale("export", folder / "slab.toml", "-o", folder / "slab_mitsuba.xml", "--quiet", *options)
            ours = blocks(np.array(mi.Bitmap(str(folder / "ours.exr")))[..., :3])
            theirs = blocks(np.array(mi.render(mi.load_file(str(folder / "slab_mitsuba.xml")), spp=arguments.paths))[..., :3])
            rms = float(np.sqrt(np.mean((ours - theirs) ** 2)))
            print(f"{' '.join(overrides) or 'slab_fig3_both'}: mean {ours.mean():.4f}, Mitsuba {theirs.mean():.4f}; contrast {ours.std():.4f}, "
                  f"Mitsuba {theirs.std():.4f}; RMS of blocks {rms:.4f} (limit {limit})")
            failed |= rms > limit
    sys.exit(1 if failed else 0)


main()
