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
# # 4. How good is this number?
#
# An effective BRDF is a sum over samples of the small geometry, the *facets*. A sum over samples has an error. biscale offers three answers
# to the question how large it is:
#
# 1. `brdf.standard_error` estimates it from the facets themselves, without a reference;
# 2. `scene.reference` computes the same number in another way, by casting rays, and states a standard error of its own;
# 3. `brdf.health` examines the input and the result, and says in words what looks wrong.
#
# This notebook uses each of them and checks the first against the second. It needs `biscale` and matplotlib, and takes about half a minute on two
# cores.

# %%
import time

import matplotlib.pyplot as plt
import numpy as np

import biscale as bs

# %% [markdown]
# The scene is leather: a height field with many different normals, which is harder than grooves. The pairs of directions are those over
# which biscale measures its own tables. They lie up to 85° from the normal, and half of them are near the mirror direction, where most
# materials are bright.

# %%
NAME, COUNT = "fig8d_leather", 200
scene = bs.Scene(NAME)
wi, wo = bs.mirror_biased_pairs(COUNT, 1)
brdf = scene.effective(quality="standard", effects={"interreflection": "off"})
f = brdf.eval(wi, wo)
stated = brdf.standard_error(wi, wo)
print(brdf.form)
for k in range(3):
    print(f"f = {f[k].round(4)} ± {stated[k].round(4)}  1/sr")

# %% [markdown]
# ## The reference
#
# `reference` casts rays through the geometry itself. It repeats passes until the standard error is below `target`, relative to the values,
# here 1 %. Interreflection, the light that parts of the tile send to each other, is off in both, so that both compute the same quantity.

# %%
start = time.perf_counter()
reference, reference_error = scene.reference(wi, wo, target=0.01, effects={"interreflection": "off"})
print(f"{COUNT} pairs by ray casting: {time.perf_counter() - start:.1f} s")


def relative_l2(found, expected):
    return np.linalg.norm(found - expected) / np.linalg.norm(expected)


print(f"difference from the reference: {100 * relative_l2(f, reference):.2f} % (relative L2)")
print(f"of which the reference's own:  {100 * np.linalg.norm(reference_error) / np.linalg.norm(reference):.2f} %")

# %% [markdown]
# A fair error bar must contain the difference about as often as it says: the difference over the standard errors of both is a number that
# should be below 1 in about 68 % of the pairs and below 2 in about 95 %, if errors are normally distributed. An estimate from few samples is
# uncertain itself, so the tails are wider than those of a normal distribution. The same facets serve all pairs, so that the differences of
# similar pairs are not independent: whole runs of them lie on one side of zero.

# %%
luminance = np.array([0.2126, 0.7152, 0.0722])
difference = (f - reference) @ luminance
both = np.hypot(stated @ luminance, reference_error @ luminance)
ratio = difference / np.maximum(both, 1e-12)
print(f"|ratio| < 1: {100 * np.mean(abs(ratio) < 1):.0f} % of the pairs, |ratio| < 2: {100 * np.mean(abs(ratio) < 2):.0f} %")

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4))
order = np.argsort(reference @ luminance)
left.errorbar(np.arange(COUNT), difference[order], yerr=both[order], fmt=".", markersize=3, elinewidth=0.7, color="tab:blue")
left.axhline(0, color="black", linewidth=0.7)
left.set(xlabel="pairs, from dark to bright", ylabel=r"$\bar f$ - reference [1/sr]", title="difference and its error bar")
left.set_yscale("symlog", linthresh=1e-3)
right.hist(np.clip(ratio, -5, 5), bins=np.linspace(-5, 5, 31), density=True, color="tab:blue", alpha=0.6)
x = np.linspace(-5, 5, 200)
right.plot(x, np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi), color="black", label="normal distribution")
right.set(xlabel="difference / standard error", title="are the error bars fair?")
right.legend()
figure.tight_layout()
plt.show()

# %% [markdown]
# ## What accuracy costs
#
# A preset is a named set of accuracy settings. `brdf.error` summarises the estimate: `rel_l2` is 1.3 times the expected relative L2 over such pairs.
# It exists for every result, so you need a reference only if you want to check it. The grey line is the error that the reference itself adds
# to every measured difference.

# %%
rows = []
for quality in ["draft", "standard", "fine"]:
    fresh = bs.Scene(NAME)
    start = time.perf_counter()
    result = fresh.effective(quality=quality, effects={"interreflection": "off"})
    seconds = time.perf_counter() - start
    rows.append((quality, seconds, result.error["rel_l2"], relative_l2(result.eval(wi, wo), reference)))
    print(f"{quality:9} {1e3 * seconds:7.0f} ms   stated {100 * rows[-1][2]:.2f} %   measured {100 * rows[-1][3]:.2f} %")

# %%
figure, axis = plt.subplots(figsize=(6, 4))
seconds = [row[1] for row in rows]
axis.loglog(seconds, [100 * row[2] for row in rows], "o--", label="stated by the result itself")
axis.loglog(seconds, [100 * row[3] for row in rows], "s-", label="measured against the reference")
for quality, at, _, measured in rows:
    axis.annotate(quality, (at, 100 * measured), xytext=(6, 6), textcoords="offset points")
axis.axhline(100 * np.linalg.norm(reference_error) / np.linalg.norm(reference), color="gray", label="the reference's own error")
axis.set(xlabel="time of the effective BRDF [s]", ylabel="relative L2 [%]")
axis.set(xlim=(seconds[0] / 2, seconds[-1] * 2), ylim=(0.3, 10))
axis.set_yticks([0.5, 1, 2, 5, 10], ["0.5", "1", "2", "5", "10"])
axis.minorticks_off()
axis.legend()
plt.show()

# %% [markdown]
# ## Health
#
# A number can have a small standard error and still be wrong, because the input is: a material that reflects more light than it receives,
# or a highlight that is narrower than the facets can resolve. `health["warnings"]` names such cases, each with a remedy. The shipped leather
# has none. Here is a material that gives back more light than it gets.

# %%
print("as shipped:", bs.Scene(NAME).effective(quality="draft").health["warnings"])
bright = bs.Scene.parse(
    """
    [tile]
    geometry = { kind = "grooves", profile = "v", count = 4, depth = 0.06, side_angle_deg = 25.6 }
    [[material]]
    name = "default"
    brdf = [{ kind = "lambertian", albedo = 0.9 }, { kind = "ggx", roughness = 0.3, f0 = 0.5 }]
    """
)
health = bright.effective(quality="draft").health
for warning in health["warnings"]:
    print("warning:", warning)

# %% [markdown]
# The numbers behind the words are there, too. They are what to watch if materials are made by the thousand (notebook 3), where nobody looks
# at each of them.

# %%
for part in ("materials", "surface", "result"):
    print(part, health[part])
