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
# # 1. A lobe and its sliders
#
# A material often gets its look from structure that is too small to see: grooves in brushed metal, threads in silk, pits in hammered
# copper. biscale takes such a structure as a *tile* of geometry that repeats without end, and a BRDF for each of its parts. It computes how
# the whole surface reflects light when it is seen from so far away that the tile has shrunk to a point. The result is a BRDF again, the
# *effective BRDF*.
#
# This notebook computes one effective BRDF, draws its lobe, and moves the parameters of the structure. It needs `biscale` and matplotlib;
# with `ipywidgets`, the last cell has sliders.

# %%
import time

import matplotlib.pyplot as plt
import numpy as np

import biscale as bs

# %% [markdown]
# The scene `default` is made of shallow V-grooves in a copper-like metal. The grooves run along y, so their sides are tilted towards +x and
# -x. Every key of the scene has a unit, a range and a default:

# %%
scene = bs.Scene("default")
numeric = [field for field in scene.fields() if field["key"].startswith(("tile.geometry.", "material.default.brdf.")) and field["range"]]
for field in numeric:
    print(f"{field['key']:34} {field['value']!s:16} {field['unit']!s:12} range {field['range']}")

# %% [markdown]
# `effective` computes the effective BRDF. `eval(wi, wo)` returns $\bar f$ in 1/sr, in linear RGB. Directions are unit vectors in the frame
# of the tile: z is the normal of the surface that you see from afar. `wi` points to the light and `wo` to the viewer, and they broadcast as
# NumPy arrays do. $\bar f$ contains the cosine of the light; `brdf.brdf` is the function without it.

# %%
brdf = scene.effective(quality="standard")
wi = bs.from_angles(np.radians(30), 0.0)
wo = bs.from_angles(np.radians([0, 30, 60]), np.pi)
print(brdf.eval(wi, wo))
print(brdf.form)

# %% [markdown]
# ## The lobe
#
# The light is fixed, and the viewer moves over the hemisphere. The left image looks at the hemisphere from above: the centre is the
# normal, the rim is the horizon, and the cross marks the direction in which a mirror would reflect the light. Brightness is the logarithm
# of the mean of the three channels. The right image is the section through the normal and the light.


# %%
def disc(count=161):
    """Directions over the unit disc, seen from above, and which of them are above the horizon."""
    x, y = np.meshgrid(*2 * [np.linspace(-1, 1, count)])
    inside = x**2 + y**2 < 0.996
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    w = np.where(inside[..., None], np.stack([x, y, z], axis=-1), [0, 0, 1])
    return w / np.linalg.norm(w, axis=-1, keepdims=True), inside


W, INSIDE = disc()
ANGLES = np.radians(np.linspace(-89, 89, 357))


def draw(brdf, theta_deg=30.0, phi_deg=0.0, title=""):
    """Draws the lobe of one light from above, and its section through the plane of the light."""
    wi = bs.from_angles(np.radians(theta_deg), np.radians(phi_deg))
    values = brdf.eval(wi, W).mean(axis=-1)
    figure = plt.figure(figsize=(9, 4))
    above = figure.add_subplot(1, 2, 1)
    shown = np.where(INSIDE, np.log10(np.maximum(values, 1e-4)), np.nan)
    picture = above.imshow(shown, origin="lower", extent=(-1, 1, -1, 1), cmap="inferno", vmin=-3, vmax=1)
    above.plot(-wi[0], -wi[1], "x", color="white", markersize=9)
    above.set(xlabel="x of the viewer", ylabel="y of the viewer", title=title)
    figure.colorbar(picture, ax=above, label=r"$\log_{10}\,\bar f$  [1/sr]", shrink=0.8)
    section = figure.add_subplot(1, 2, 2, projection="polar")
    turned = np.where(ANGLES < 0, np.radians(phi_deg), np.radians(phi_deg) + np.pi)
    f = brdf.eval(wi, bs.from_angles(np.abs(ANGLES), turned))
    for channel, colour in enumerate(["tab:red", "tab:green", "tab:blue"]):
        section.plot(ANGLES, f[:, channel], color=colour)
    section.set(theta_zero_location="N", theta_direction=-1, thetamin=-90, thetamax=90)
    section.plot([-np.radians(theta_deg)] * 2, [0, section.get_rmax()], "--", color="gray", label="light")
    section.yaxis.set_major_locator(plt.MaxNLocator(3))
    section.legend(loc="lower center")
    section.set_title(r"section in the plane of the light, $\bar f$ [1/sr]")
    figure.tight_layout()
    plt.show()


draw(brdf, title="V-grooves, light at 30°")

# %% [markdown]
# There is no highlight at the cross, because no part of the tile faces up; the faint light there was reflected twice, by one side of a groove
# and then by the other. Each side makes a highlight of its own. The side that is tilted towards the light sends it back towards the light,
# and the other side sends it down, close to the horizon.
#
# ## Moving a slider
#
# A scene keeps what it has computed. After an edit, only what depends on the edit is computed again. `times_ms` lists the stages that ran:
# a new angle changes the geometry and all that follows from it; a new roughness leaves geometry and visibility as they are. (The stages
# about bounced light, transport and interreflection compute the light that the sides of the grooves send to each other.)

# %%
for key, value in [("tile.geometry.side_angle_deg", 20.0), ("material.default.brdf.roughness", 0.15)]:
    scene[key] = value
    start = time.perf_counter()
    edited = scene.effective(quality="standard")
    milliseconds = 1e3 * (time.perf_counter() - start)
    print(f"{key} = {value}: {milliseconds:.1f} ms in the stages {', '.join(edited.times_ms)}")

# %% [markdown]
# Here are five positions of the slider of the angle of the sides, in the section of before. Sides with an angle of 5° give almost the lobe
# of a plane. A facet that is tilted by an angle α turns the mirror direction by 2α, so steeper sides move the two highlights apart: from the
# sides that face the light to 2α - 30° on the light's own side, and from the others to 2α + 30° on the opposite side, until the horizon
# hides it. These are peaks for small highlights; wide ones, as here, lie a few degrees off.


# %%
def grooves(side_angle_deg):
    """V-grooves whose sides meet: four of them share a tile of side 1, so that a side is 1/8 wide."""
    depth = float(np.tan(np.radians(side_angle_deg)) / 8)
    return {"tile.geometry.side_angle_deg": side_angle_deg, "tile.geometry.depth": depth}


scene = bs.Scene("default")
figure, axis = plt.subplots(figsize=(8, 4))
wi = bs.from_angles(np.radians(30), 0.0)
viewers = bs.from_angles(np.abs(ANGLES), np.where(ANGLES < 0, 0.0, np.pi))
sides = [5, 15, 25, 35, 45]
for k, angle in enumerate(sides):
    scene.set(grooves(angle))
    f = scene.effective(quality="standard").eval(wi, viewers)
    axis.plot(np.degrees(ANGLES), f.mean(axis=-1), color=plt.cm.viridis(k / len(sides)), label=f"{angle}°")
axis.axvline(-30, linestyle="--", color="gray")
axis.text(-29, axis.get_ylim()[1] * 0.92, "light", color="gray")
axis.axvline(30, linestyle=":", color="gray")
axis.text(31, axis.get_ylim()[1] * 0.92, "mirror direction", color="gray")
axis.set(xlabel="angle of the viewer from the normal [°]; negative is the side of the light", ylabel=r"mean of $\bar f$ [1/sr]", xlim=(-90, 90))
axis.set_ylim(bottom=0)
axis.legend(title="sides")
plt.show()

# %% [markdown]
# ## Sliders
#
# With `ipywidgets` this cell has sliders whose ranges come from the scene; without it, and outside of a notebook, it draws one more lobe.

# %%
scene = bs.Scene("default")


def show(side_angle_deg=25.0, roughness=0.2, theta_deg=30.0, phi_deg=30.0):
    scene.set({**grooves(side_angle_deg), "material.default.brdf.roughness": roughness})
    draw(scene.effective(quality="draft"), theta_deg, phi_deg, f"sides {side_angle_deg:.0f}°, roughness {roughness:.2f}")


try:
    import ipywidgets
    from IPython import get_ipython
except ImportError:
    ipywidgets = None
if ipywidgets is not None and get_ipython() is not None:
    ipywidgets.interact(show, side_angle_deg=(1.0, 60.0), roughness=(0.05, 0.6, 0.01), theta_deg=(0.0, 80.0), phi_deg=(0.0, 360.0))
else:
    show()

# %% [markdown]
# The light is now at an azimuth of 30°, between the direction across the grooves (0°) and the one along them (90°). Both highlights have
# left the plane of the light. This is why the highlights of a brushed pan move when the pan turns under a fixed lamp.
