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
# An effective BRDF is a BRDF like any other, so that every renderer that reads tables can show it. For Mitsuba 3 there are two ways: the
# plugin `biscale`, which computes the BRDF of a scene when Mitsuba loads it, and a file for Mitsuba's own material `measured`. This notebook
# renders shot silk on a sphere both ways, compares the images with biscale's own, and changes the weave from Python.
#
# It needs `biscale`, `mitsuba` (3.7 or newer) and matplotlib. With an LLVM library Mitsuba evaluates all rays at once; without one, it calls
# the plugin for each ray, so that this notebook renders smaller and noisier images.

# %%
import tempfile
import time
from pathlib import Path

import matplotlib.pyplot as plt
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb", "scalar_rgb")  # the first one that works

import biscale as bs
import biscale.mitsuba  # registers the plugin

FAST = mi.variant() == "llvm_ad_rgb"
SIZE, SPP = (200, 16) if FAST else (48, 2)
print(mi.variant())

# %% [markdown]
# ## The image
#
# Shot silk: warp threads in red and weft threads in blue cross each other. Threads are too thin to see, but each kind has a highlight of its
# own, so that the hue changes with the direction.
#
# The scene is a sphere, a camera and one directional light. Two details matter:
#
# - Woven cloth depends on the azimuth. The material's x axis lies along the first tangent of the surface (∂p/∂u). On Mitsuba's sphere this is
#   the direction around the z axis; the sphere is turned by 90°, so that here it is along the circles of latitude about the vertical.
# - The direct integrator samples the light only, because a directional light cannot be hit by chance.

# %%
LIGHT = np.array([0.3, 0.5, 0.8]) / np.linalg.norm([0.3, 0.5, 0.8])
DISTANCE, FOV_DEG, AZIMUTH_DEG, ELEVATION_DEG = 5.0, 30.0, 25.0, 20.0
azimuth, elevation = np.radians([AZIMUTH_DEG, ELEVATION_DEG])
EYE = DISTANCE * np.array([np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)])


def sphere(material):
    """A sphere with its pole upwards."""
    return mi.load_dict({
        "type": "scene",
        "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
        "sensor": {
            "type": "perspective",
            "fov": FOV_DEG,
            "to_world": mi.ScalarTransform4f().look_at(EYE.tolist(), [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}, "pixel_format": "rgb"},
        },
        "sphere": {"type": "sphere", "to_world": mi.ScalarTransform4f().rotate([1, 0, 0], -90), "material": material},
        "light": {"type": "directional", "direction": (-LIGHT).tolist(), "irradiance": {"type": "rgb", "value": [3.0, 3.0, 3.0]}},
    })


def rendered(scene):
    return np.array(mi.render(scene, spp=SPP))[:, :, :3]


start = time.perf_counter()
silk = sphere({"type": "biscale", "scene": "fig7a_shot_silk", "quality": "draft"})
loaded = time.perf_counter()
by_plugin = rendered(silk)
print(f"loaded in {loaded - start:.1f} s, rendered in {time.perf_counter() - loaded:.1f} s")

# %% [markdown]
# ## The same as a file
#
# `export` writes an `.bsdf` file, which Mitsuba reads without biscale. Its size and error follow from the resolution: of the viewer, and of the
# light. This is a small one; without `resolution`, it has about 100 MB.

# %%
folder = Path(tempfile.mkdtemp(prefix="biscale-notebook-"))
scene = bs.Scene("fig7a_shot_silk")
report = scene.effective(quality="draft").export(folder / "silk.bsdf", resolution=(12, 24), resolution_o=(32, 32))
print(f"{report['bytes'] / 1e6:.1f} MB")
by_file = rendered(sphere({"type": "measured", "filename": str(folder / "silk.bsdf")}))

# %% [markdown]
# ## The same in biscale
#
# `scene.render` shades the scene's own object. These keys select the same sphere, light and camera. All three images show the same function
# $\bar f$. They differ by the interpolation in the tables, and by the rays at the outline, which is left out of the comparison.

# %%
scene.set({
    "object.kind": "sphere",
    "light.environment": "none",
    "light.directional": [{"direction": LIGHT.tolist(), "irradiance": 3.0}],
    "camera": {"azimuth_deg": AZIMUTH_DEG, "elevation_deg": ELEVATION_DEG, "distance": DISTANCE, "fov_deg": FOV_DEG},
})
ours = scene.render(size=(SIZE, SIZE), quality="draft")

half = np.tan(np.radians(FOV_DEG) / 2)
x, y = np.meshgrid(*2 * [(np.arange(SIZE) + 0.5) / SIZE * 2 * half - half])
inside = np.hypot(x, y) / np.sqrt(1 + x**2 + y**2) < 0.99 / DISTANCE


def srgb(linear):
    linear = np.clip(linear, 0, 1)
    return np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def show(pictures):
    figure, axes = plt.subplots(1, len(pictures), figsize=(2.6 * len(pictures), 2.9), layout="constrained")
    for axis, (title, picture) in zip(axes, pictures.items()):
        axis.imshow(srgb(picture * inside[..., None]))
        axis.set_title(title)
        axis.axis("off")
    plt.show()


for name, picture in {"plugin": by_plugin, "file": by_file}.items():
    print(f"{name}: mean difference from biscale {100 * np.abs(picture - ours)[inside].sum() / ours[inside].sum():.1f} %")
show({"plugin": by_plugin, "file": by_file, "biscale": ours, "10 x |plugin - biscale|": 10 * np.abs(by_plugin - ours)})

# %% [markdown]
# ## Changing the structure
#
# `mi.traverse` shows the keys of the structure that are numbers or colours, with underscores for the dots of the scene file. After a change,
# the plugin computes its table again. Here the warp threads become narrower, so that the weft shows and the silk turns from red to blue.

# %%
parameters = mi.traverse(silk)
names = {name.rsplit(".", 1)[1]: name for name in parameters.keys() if "geometry" in name}
print(sorted(names))
pictures = {}
for width in [0.9, 0.7, 0.5, 0.3]:
    parameters[names["tile_geometry_warp_width"]] = width
    start = time.perf_counter()
    parameters.update()
    print(f"warp width {width}: {time.perf_counter() - start:.1f} s")
    pictures[f"warp width {width}"] = rendered(silk)
show(pictures)
