"""Bi-scale material design: structure in, BRDF values out, with known error.

>>> import biscale as bs
>>> scene = bs.Scene("fig5c_uneven")
>>> scene["tile.geometry.height"] = 0.08
>>> brdf = scene.effective(quality="draft")
>>> f = brdf.eval(bs.from_angles(0.3, 0.0), bs.from_angles(0.5, 3.1))  # f̄ [1/sr], with the light's cosine

Directions are unit vectors in the frame of the tile: z is the large-scale normal, x and y lie along the tile.
"""

from ._core import EffectiveBrdf, Scene, __version__, from_angles, mirror_biased_pairs, scenes, to_angles
from ._errors import Cancelled, DeviceError, Error, InputError, InternalError

__all__ = [
    "Cancelled",
    "DeviceError",
    "EffectiveBrdf",
    "Error",
    "InputError",
    "InternalError",
    "Scene",
    "__version__",
    "from_angles",
    "mirror_biased_pairs",
    "scenes",
    "to_angles",
]
