"""The plugin for Mitsuba: its values, its sampling, its parameters and its errors. benches/mitsuba_plugin.py has the larger checks."""

import subprocess
import sys

import numpy as np
import pytest

import biscale as bs

mi = pytest.importorskip("mitsuba", reason="the plugin needs Mitsuba")


def llvm_works():
    """Tried in another process, because an LLVM that does not work ends the process."""
    trial = "import mitsuba as mi; mi.set_variant('llvm_ad_rgb'); import drjit as dr; print(dr.sin(mi.Float([1, 2])))"
    return subprocess.run([sys.executable, "-c", trial], capture_output=True).returncode == 0


@pytest.fixture(scope="module", params=["scalar_rgb", "llvm_ad_rgb"])
def variant(request):
    if request.param == "llvm_ad_rgb" and not llvm_works():
        pytest.skip("Mitsuba finds no LLVM library that works")
    mi.set_variant(request.param)
    import biscale.mitsuba  # noqa: F401  (registers the plugin)

    return request.param


def plugin(**properties):
    return mi.load_dict({"type": "biscale", "quality": "draft", **properties})


def each(variant, wi, function):
    """Calls `function(interaction, k)` for each viewer, or once for all of them."""
    si = mi.SurfaceInteraction3f()
    if variant.startswith("llvm"):
        si.wi = mi.Vector3f(np.ascontiguousarray(wi.T))
        return function(si, slice(None))
    results = []
    for k in range(len(wi)):
        si.wi = mi.Vector3f(*wi[k].tolist())
        results.append(function(si, k))
    return results


def vectors(w, k):
    return mi.Vector3f(*w[k].tolist()) if isinstance(k, int) else mi.Vector3f(np.ascontiguousarray(w.T))


def values(variant, bsdf, wi, wo):
    """f̄ of light and viewer as the plugin reads it."""
    found = each(variant, wo, lambda si, k: np.array(bsdf.eval(mi.BSDFContext(), si, vectors(wi, k))))
    return np.array(found) if isinstance(found, list) else found.T


@pytest.mark.parametrize("scene", ["fig5a_isotropic", "fig7a_shot_silk"])
def test_values_are_those_of_eval_up_to_the_interpolation(variant, scene):
    wi, wo = bs.mirror_biased_pairs(300, 3)
    exact = bs.Scene(scene).effective(quality="draft", backend="cpu").eval(wi, wo)
    found = values(variant, plugin(scene=scene), wi, wo)
    assert abs(found - exact).sum() < 0.03 * exact.sum()


def test_nothing_is_reflected_below_the_horizon(variant):
    above, below = np.array([[0.6, 0.0, 0.8]]), np.array([[0.6, 0.0, -0.8]])
    bsdf = plugin(scene="fig5a_isotropic")
    assert values(variant, bsdf, below, above).max() == 0
    assert values(variant, bsdf, above, below).max() == 0


@pytest.mark.parametrize("scene", ["fig5a_isotropic", "fig7a_shot_silk"])
def test_the_weight_of_a_sample_is_its_value_over_its_density_and_averages_to_the_albedo(variant, scene):
    count = 20_000 if variant.startswith("llvm") else 400
    viewer = bs.from_angles(0.6, 2.0)
    viewers = np.repeat(viewer[None], count, axis=0).astype(np.float32)
    u = np.random.default_rng(1).random((count, 3)).astype(np.float32)
    bsdf = plugin(scene=scene)

    def draw(si, k):
        one = float(u[k, 0]) if isinstance(k, int) else mi.Float(u[:, 0])
        two = mi.Point2f(*u[k, 1:].tolist()) if isinstance(k, int) else mi.Point2f(np.ascontiguousarray(u[:, 1:].T))
        sample, weight = bsdf.sample(mi.BSDFContext(), si, one, two)
        value, pdf = bsdf.eval_pdf(mi.BSDFContext(), si, sample.wo)
        return [np.array(array) for array in (weight, value, pdf, sample.pdf)]

    drawn = each(variant, viewers, draw)
    if isinstance(drawn, list) and len(drawn) == count:
        weight, value, pdf, stated = (np.array([one[k] for one in drawn]) for k in range(4))
    else:
        weight, value, pdf, stated = drawn[0].T, drawn[1].T, drawn[2], drawn[3]
    ok = stated > 0
    np.testing.assert_allclose(pdf[ok], stated[ok], rtol=1e-4)
    np.testing.assert_allclose(weight[ok], value[ok] / stated[ok, None], rtol=1e-4, atol=1e-7)
    albedo = bs.Scene(scene).effective(quality="draft", backend="cpu").albedo(viewer)
    error = weight.std(axis=0) / np.sqrt(count)
    assert (abs(weight.mean(axis=0) - albedo) < 0.02 * albedo + 4 * error).all()


def test_a_change_of_a_parameter_computes_the_table_again(variant):
    bsdf = plugin(scene="default")
    parameters = mi.traverse(bsdf)
    np.testing.assert_allclose(np.ravel(parameters["tile_geometry_side_angle_deg"]), [25.6], rtol=1e-6)
    np.testing.assert_allclose(np.ravel(parameters["material_default_brdf_f0"]), [0.95, 0.5, 0.2], rtol=1e-6)
    parameters["tile_geometry_side_angle_deg"] = 15.0
    parameters["material_default_brdf_f0"] = [0.2, 0.5, 0.95]
    parameters["tile_geometry_count"] = 5
    parameters.update()
    scene = bs.Scene("default")
    scene.set({"tile.geometry.side_angle_deg": 15.0, "material.default.brdf.f0": [0.2, 0.5, 0.95], "tile.geometry.count": 5})
    wi, wo = bs.mirror_biased_pairs(100, 3)
    edited = values(variant, bsdf, wi, wo)
    fresh = {"tile_geometry_side_angle_deg": 15.0, "material_default_brdf_f0": mi.ScalarColor3f(0.2, 0.5, 0.95), "tile_geometry_count": 5}
    np.testing.assert_allclose(edited, values(variant, plugin(scene="default", **fresh), wi, wo), rtol=1e-4, atol=1e-6)
    exact = scene.effective(quality="draft", backend="cpu").eval(wi, wo)
    assert abs(edited - exact).sum() < 0.1 * exact.sum()


def test_wrong_properties_are_refused_with_their_name(variant):
    for properties, field in [
        ({"tile_geometry_dept": 0.1}, "tile_geometry_dept"),
        ({"tile_geometry_side_angle_deg": 100.0}, "tile.geometry.side_angle_deg"),
        ({"quality": "finest"}, "quality.preset"),
        ({"scene": "no_such_scene"}, "no_such_scene"),
    ]:
        with pytest.raises(Exception, match=field):
            plugin(**properties)
