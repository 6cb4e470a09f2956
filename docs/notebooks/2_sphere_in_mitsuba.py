# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # 2. A structure on a sphere in Mitsuba
#
# An effective BRDF is a BRDF like any other, so that every renderer that can read a table can show it. This notebook exports one as an
# `.bsdf` file, the format of Mitsuba's material `measured`, and renders it on a sphere. It then compares the picture with biscale's own.
#
# It needs `biscale`, `mitsuba` (3.5 or newer) and matplotlib. The variant `scalar_rgb` needs nothing else.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import mitsuba as mi
import numpy as np

import biscale as bs

mi.set_variant("scalar_rgb")
SIZE = 160
folder = Path(tempfile.mkdtemp(prefix="biscale-notebook-"))

# %% [markdown]
# ## The material
#
# Shot silk: warp threads in red and weft threads in blue cross each other. Threads are too thin to see, but each kind has a highlight of its
# own, so that the hue changes with the direction. `export` returns a report. It states, among other things, how far the values that a program
# reads from the table are from those of biscale.

# %%
scene = bs.Scene("fig7a_shot_silk")
brdf = scene.effective(quality="draft")
report = brdf.export(folder / "silk.bsdf")
print(f"{report['bytes'] / 1e6:.1f} MB")
print({key: value for key, value in report.items() if "error" in key or "read" in key})

# %% [markdown]
# ## The picture
#
# A sphere, a camera and one directional light. Two details matter with a material that depends on the azimuth, as woven cloth does:
#
# - The material's x axis lies along the first tangent of the surface (∂p/∂u). On Mitsuba's sphere this is the direction around the z axis,
#   here that of the circles of latitude about the vertical, as the sphere is turned by 90°.
# - The direct integrator samples the light only: a directional light cannot be hit by chance.

# %%
LIGHT = np.array([0.3, 0.5, 0.8]) / np.linalg.norm([0.3, 0.5, 0.8])
DISTANCE, FOV_DEG, AZIMUTH_DEG, ELEVATION_DEG = 5.0, 30.0, 25.0, 20.0
azimuth, elevation = np.radians([AZIMUTH_DEG, ELEVATION_DEG])
EYE = DISTANCE * np.array([np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)])


def sphere(material):
    """A sphere with its pole upwards."""
    return {
        "type": "scene",
        "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
        "sensor": {
            "type": "perspective",
            "fov": FOV_DEG,
            "to_world": mi.ScalarTransform4f().look_at(EYE.tolist(), [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}, "pixel_format": "rgb"},
        },
        "sphere": {"type": "sphere", "to_world": mi.ScalarTransform4f().rotate([1, 0, 0], -90), "material": material},
        "light": {"type": "directional", "direction": (-LIGHT).tolist(), "irradiance": {"type": "rgb", "value": [2.0, 2.0, 2.0]}},
    }


def rendered(material, spp=16):
    return np.array(mi.render(mi.load_dict(sphere(material)), spp=spp))[:, :, :3]


silk = rendered({"type": "measured", "filename": str(folder / "silk.bsdf")})

# %% [markdown]
# ## The same in biscale
#
# `scene.render` shades the scene's own object. Keys of the scene select the same sphere, light and camera. Both programs compute the same
# function, so that the pictures differ by the interpolation in the table, and by the different rays at the outline.

# %%
scene.set({
    "object.kind": "sphere",
    "light.environment": "none",
    "light.directional": [{"direction": LIGHT.tolist(), "irradiance": 2.0}],
    "camera": {"azimuth_deg": AZIMUTH_DEG, "elevation_deg": ELEVATION_DEG, "distance": DISTANCE, "fov_deg": FOV_DEG},
})
ours = scene.render(size=(SIZE, SIZE), quality="draft")


def srgb(linear):
    linear = np.clip(linear, 0, 1)
    return np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def show(pictures, columns=3):
    figure, axes = plt.subplots(1, columns, figsize=(3.2 * columns, 3.5), layout="constrained")
    for axis, (title, picture) in zip(axes, pictures.items()):
        axis.imshow(srgb(picture))
        axis.set_title(title)
        axis.axis("off")
    plt.show()


half = np.tan(np.radians(FOV_DEG) / 2)
x, y = np.meshgrid(*2 * [(np.arange(SIZE) + 0.5) / SIZE * 2 * half - half])
inside = np.hypot(x, y) / np.sqrt(1 + x**2 + y**2) < 0.99 / DISTANCE
difference = np.abs(silk - ours)[inside].sum() / ours[inside].sum()
print(f"mean difference inside of the outline: {100 * difference:.1f} %")
ours_on_black = ours * inside[..., None]
show({"Mitsuba": silk * inside[..., None], "biscale": ours_on_black, "10 x difference": 10 * np.abs(silk - ours) * inside[..., None]})
