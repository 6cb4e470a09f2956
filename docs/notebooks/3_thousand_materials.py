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
# # 3. A thousand materials, and a small regression
#
# Can you tell from the reflection how deep the grooves of a surface are, without seeing them? This notebook makes a data set of 1000 grooved
# metals with known depth, and trains a small regression on it. It shows the way from a specification to arrays; the regression is the
# simplest one there is.
#
# It needs `biscale[batch]` (Dask and pyarrow) and matplotlib. `BISCALE_NOTEBOOK_ROWS` in the environment makes fewer materials.

# %%
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import biscale as bs
import biscale.dataset

ROWS = int(os.environ.get("BISCALE_NOTEBOOK_ROWS", "1000"))

# %% [markdown]
# ## The specification
#
# A row of the data set is a material. The base is a scene with grooves that have a trapezoid profile: flat bottoms and ridges, and steep
# sides. Three keys vary: the depth, which is to be found, and the roughness and the angle of the sides, which are unknown, too, and make the
# task harder. Lengths are in tile units: the tile has the side 1 and four grooves.
#
# The output of a row is $\bar f$ at 256 pairs of directions, the same for all rows.

# %%
folder = Path(tempfile.mkdtemp(prefix="biscale-notebook-"))
(folder / "base.toml").write_text(
    """
[tile]
geometry = { kind = "grooves", profile = "trapezoid", count = 4, depth = 0.1, side_angle_deg = 60 }

[[material]]
name = "default"
brdf = { kind = "cook_torrance", roughness = 0.3, f0 = [0.9, 0.6, 0.3] }
"""
)
(folder / "spec.toml").write_text(
    f"""
base = ["{(folder / "base.toml").as_posix()}"]
count = {ROWS}
seed = 7

[sample]
"tile.geometry.depth" = {{ uniform = [0.01, 0.2] }}
"tile.geometry.side_angle_deg" = {{ uniform = [50.0, 70.0] }}
"material.default.brdf.roughness" = {{ uniform = [0.15, 0.5] }}

[output]
what = "pairs"
directions = 256
quality = "draft"
dtype = "float32"
rows_per_file = 250
"""
)
print((folder / "spec.toml").read_text())

# %% [markdown]
# ## The run
#
# `python -m biscale.batch run` starts one Dask worker per core of this machine. On a cluster you call `biscale.batch.run(spec, folder,
# client)` with the Dask client of your scheduler, or `--shard 3/16` in an array job. A killed run goes on where it stopped. (Here it is a
# command, because a plain script may not start worker processes from its top level.)

# %%
command = [sys.executable, "-m", "biscale.batch", "run", str(folder / "spec.toml"), "-o", str(folder / "materials")]
finished = subprocess.run(command, capture_output=True, text=True)
print(finished.stdout, finished.stderr[-600:])
finished.check_returncode()

# %%
data = biscale.dataset.open(folder / "materials")
table = data.table(["index", "tile.geometry.depth", "material.default.brdf.roughness", "milliseconds", "relative_error", "state"])
depth = table.column("tile.geometry.depth").to_numpy()
roughness = table.column("material.default.brdf.roughness").to_numpy()
values = np.stack([data[k]["values"] for k in range(len(data))])
errors = [error for error in table.column("relative_error").to_pylist() if error is not None]
print(f"{len(data)} rows, values of shape {values.shape}, {np.mean(table.column('milliseconds').to_numpy()):.0f} ms a material")
print(f"error of the values themselves, from two seeds: {100 * np.median(errors):.2f} % in the median of {len(errors)} rows")

# %% [markdown]
# Each dot is a material. Brightness at one pair of directions depends on the depth, but also on everything else, so that one number is not
# enough. The left pair is near the mirror direction of the parts that face up: the deeper the grooves are, the wider their sides become, and
# the less faces up, until the ridges have vanished. The right pair is near the mirror direction of the sides.

# %%
theta_i, theta_o = (np.degrees(bs.to_angles(w)[0]) for w in (data.wi, data.wo))
half = (data.wi + data.wo) / np.linalg.norm(data.wi + data.wo, axis=-1, keepdims=True)
up = np.argmin(theta_i + theta_o + 1000 * (half[:, 2] < 0.99))
side = np.argmin(np.linalg.norm(abs(half) - [np.sin(np.radians(60)), 0, np.cos(np.radians(60))], axis=-1))
figure, axes = plt.subplots(1, 2, figsize=(10, 4), sharex=True, layout="constrained")
for axis, pair in zip(axes, [up, side]):
    dots = axis.scatter(depth, values[:, pair].mean(axis=-1), c=roughness, s=5, cmap="viridis")
    axis.set(xlabel="depth of the grooves [tile units]", ylabel=r"mean of $\bar f$ [1/sr]", yscale="log")
    axis.set_title(f"light at {theta_i[pair]:.0f}°, viewer at {theta_o[pair]:.0f}°")
figure.colorbar(dots, ax=axes, label="roughness")
plt.show()

# %% [markdown]
# ## The regression
#
# Ridge regression is a straight line with a penalty on large weights. The features are logarithms of $\bar f$ at some of the pairs,
# standardised. The weight of the penalty is chosen on a part of the training rows; a fifth of the rows is kept aside and used for the figures
# only.
#
# A data set without noise flatters every method. So the regression is trained and tested twice: on the values as they are, and on values to
# which normal noise of 5 % was added, as a camera would.

# %%
order = np.random.default_rng(1).permutation(len(values))
test, valid, train = np.split(order, [len(order) // 5, 2 * len(order) // 5])


def features(pairs, noise):
    """Logarithms of the values at the first pairs, with relative noise."""
    f = values[:, :pairs]
    f = f * np.maximum(1 + noise * np.random.default_rng(2).standard_normal(f.shape), 0.1)
    return np.log(np.maximum(f, 1e-3)).reshape(len(f), -1)


def ridge(x, rows, weight):
    """Trains on some rows and returns the prediction for all rows."""
    mean, scale = x[rows].mean(axis=0), x[rows].std(axis=0) + 1e-6
    x = (x - mean) / scale
    system = x[rows].T @ x[rows] + weight * len(rows) * np.eye(x.shape[1])
    return x @ np.linalg.solve(system, x[rows].T @ (depth[rows] - depth[rows].mean())) + depth[rows].mean()


def rms(found, rows):
    return np.sqrt(np.mean((found[rows] - depth[rows]) ** 2))


def trained(pairs, noise):
    x = features(pairs, noise)
    weight = min(10.0 ** np.arange(-7, 1), key=lambda weight: rms(ridge(x, train, weight), valid))
    return ridge(x, np.concatenate([train, valid]), weight)


spread = depth[test].std()
print(f"always the mean depth: rms error {spread:.4f}")
counts, noises = [1, 2, 4, 8, 16, 32, 64, 128, 256], [0.0, 0.05]
found = {(pairs, noise): trained(pairs, noise) for pairs in counts for noise in noises}
for noise in noises:
    print(f"noise {noise:.0%}:", ", ".join(f"{pairs} pairs {rms(found[pairs, noise], test):.4f}" for pairs in counts))

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.5), layout="constrained")
for noise, colour in zip(noises, ["tab:blue", "tab:orange"]):
    left.loglog(counts, [rms(found[pairs, noise], test) for pairs in counts], "o-", color=colour, label=f"noise {noise:.0%}")
left.axhline(spread, color="gray", label="always the mean depth")
left.set(xlabel="pairs of directions", ylabel="rms error of the depth [tile units]", title="how many pairs does it take?")
left.legend()
dots = right.scatter(depth[test], found[16, 0.05][test], c=roughness[test], s=12, cmap="viridis")
right.plot([0, 0.21], [0, 0.21], color="black", linewidth=0.7)
right.set(xlabel="depth [tile units]", ylabel="depth from the reflection", title="16 pairs, noise 5 %", aspect="equal")
figure.colorbar(dots, ax=right, label="roughness")
plt.show()

# %% [markdown]
# The rows that were kept aside are new materials of the same family, lit and seen from known directions. So the figures say that the depth
# is contained in $\bar f$. They do not say how well it can be found from a photograph of another kind of surface.
