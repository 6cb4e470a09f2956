"""Values of the effective BRDF: the same as the command line's, and consistent with each other."""

import numpy as np
import pytest

import biscale as bs
from conftest import command, pairs, random_angles

HEADER = "theta_i,phi_i,theta_o,phi_o"


@pytest.fixture(scope="module")
def angles_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("pairs") / "pairs.csv"
    rows = [",".join(repr(float(angle)) for angle in row) for row in random_angles(500)]
    path.write_text("\n".join([HEADER, *rows]))
    return path


@pytest.mark.parametrize("name", bs.scenes())
def test_values_are_bit_for_bit_those_of_the_command(name, angles_file):
    done = command("eval", name, "--pairs", angles_file, "-o", "-", "--quality", "draft", "--backend", "cpu", "--quiet")
    assert done.returncode == 0, done.stderr
    rows = [line.split(",")[4:7] for line in done.stdout.splitlines()[1:]]
    expected = np.array(rows).astype(np.float32)
    brdf = bs.Scene(name).effective(quality="draft", backend="cpu")
    wi, wo = pairs(500)
    values = brdf.eval(wi, wo)
    assert values.dtype == np.float64
    np.testing.assert_array_equal(values, expected.astype(np.float64))
    if "slab" not in name:
        single = brdf.eval(wi.astype(np.float32), wo.astype(np.float32))
        assert single.dtype == np.float32
        assert single.tobytes() == expected.tobytes()


def test_arguments_broadcast_and_keep_their_precision(cup):
    wi, wo = pairs(12)
    grid = cup.eval(wi.reshape(3, 4, 1, 3), wo[:5])
    assert grid.shape == (3, 4, 5, 3)
    np.testing.assert_array_equal(grid[1, 2, 3], cup.eval(wi[6], wo[3]))
    assert cup.eval(wi[0], wo[0]).shape == (3,)
    assert cup.eval(np.zeros((0, 3)), wo[0]).shape == (0, 3)
    shifted = np.frombuffer(b"x" + wi.tobytes(), np.float64, offset=1).reshape(wi.shape)
    assert not shifted.flags.aligned
    np.testing.assert_array_equal(cup.eval(shifted, wo), cup.eval(wi, wo))
    assert cup.eval(wi[0].tolist(), tuple(wo[0])).shape == (3,)
    np.testing.assert_array_equal(cup.eval(wi[::2], wo[::-1][::2]), cup.eval(wi[::2].copy(), wo[::-1][::2].copy()))


@pytest.mark.parametrize(
    "wi, wo, field",
    [
        ([0, 0, 2.0], [0, 0, 1], "wi"),
        ([[0, 0, 1], [0, 0, np.nan]], [0, 0, 1], "wi[1]"),
        ([0, 0, 1], np.tile([[[0, 0, 1.0]], [[0, 0.5, 1.0]]], (1, 4, 1)), "wo[1, 0]"),
        (np.tile([0, 0, 1.0], (3, 1)), np.tile([0, 0, 1.0], (2, 1)), "wi, wo"),
        ([0, 1.0], [0, 0, 1], "wi"),
        ("up", [0, 0, 1], "wi"),
    ],
)
def test_bad_directions_are_refused_with_their_index(cup, wi, wo, field):
    with pytest.raises(bs.InputError) as raised:
        cup.eval(wi, wo)
    assert raised.value.field == field


def test_directions_below_the_horizon_reflect_nothing(cup):
    assert not cup.eval([0, 0.6, -0.8], [0, 0, 1]).any()
    assert not cup.eval([0, 0, 1], [1, 0, 0]).any()


def test_brdf_g_and_projected_area_are_those_of_eval(cup):
    wi, wo = pairs(200)
    f = cup.eval(wi, wo)
    np.testing.assert_allclose(cup.brdf(wi, wo) * wi[:, 2:], f, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(cup.projected_area(wo)[:, None] * f, cup.g(wi, wo), rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(cup.projected_area(wo), wo[:, 2], rtol=0.02, atol=0.01)


def test_angles_are_inverse():
    theta, phi = np.array([0.0, 0.4, 1.5]), np.array([0.0, 6.0, 3.0])
    w = bs.from_angles(theta, phi)
    np.testing.assert_allclose(bs.to_angles(w), [theta, phi], atol=1e-15)
    assert bs.from_angles(np.pi / 2, 0.0)[2] == 0.0


def test_the_reference_agrees_within_its_error():
    scene = bs.Scene("fig4b_bicolor_cup")
    wi, wo = pairs(24)
    values, error = scene.reference(wi, wo, target=0.02)
    difference = scene.effective(quality="standard").eval(wi, wo) - values
    assert np.linalg.norm(difference) < 4 * np.linalg.norm(error) + 0.02 * np.linalg.norm(values)
    assert values.shape == error.shape == (24, 3) and np.all(error >= 0)
    photons, error = bs.Scene("slab_fig3_both").reference(wi[:2], -wo[:2], target=0.1)
    assert np.isfinite(photons).all() and np.isfinite(error).all()


def test_the_table_is_that_of_the_command(cup, tmp_path):
    path = tmp_path / "cup.npz"
    report = cup.export(path, resolution=(4, 6))
    table = cup.table(theta=4, phi=6)
    with np.load(path) as written:
        assert set(written.files) == set(table)
        for name in written.files:
            np.testing.assert_array_equal(written[name], table[name])
    assert report["pairs"] == 4 * 6 * 4 * 6 and report["bytes"] == path.stat().st_size
    wi = bs.from_angles(table["theta_i"].astype(float)[1], table["phi_i"].astype(float)[2])
    wo = bs.from_angles(table["theta_o"].astype(float)[3], table["phi_o"].astype(float)[4])
    np.testing.assert_allclose(table["brdf"][1, 2, 3, 4], cup.brdf(wi, wo), rtol=1e-3)
    with pytest.raises(bs.InputError):
        cup.export(tmp_path / "cup.xyz")
    with pytest.raises(bs.InputError):
        cup.table(theta=0)


def test_a_result_describes_itself(cup):
    assert {"warnings", "surface"} <= set(cup.health)
    assert cup.error["rel_l2"] > 0 and 0 <= cup.error["light_left_out"] < 0.35
    assert any(effect["name"] == "anisotropy" and effect["on"] for effect in cup.plan)
    assert all(ms >= 0 for ms in cup.times_ms.values()) and cup.form
    wi, wo = pairs(5)
    assert (cup.standard_error(wi, wo) >= 0).all()
    models = cup.fit()
    assert len(models) == 2 and all(0 < model["rel_l2"] < 1 for model in models)


def test_an_image_is_linear_and_shows_the_object():
    scene = bs.Scene("fig4b_bicolor_cup")
    image = scene.render(size=(48, 32), quality="draft", backend="cpu")
    assert image.shape == (32, 48, 3) and image.dtype == np.float32 and np.isfinite(image).all()
    np.testing.assert_array_equal(image, scene.render(size=(48, 32), quality="draft", backend="cpu"))
    scene["material.*.color"] = 0.0
    black = scene.render(size=(48, 32), quality="draft", backend="cpu")
    # The middle shows the cup, and the corner the environment.
    assert image[16, 24].sum() > 0 and black[16, 24].sum() == 0
    np.testing.assert_array_equal(image[0, 0], black[0, 0])
    slab = bs.Scene("slab_window").render(size=(24, 24), samples=1, quality="draft", backend="cpu")
    assert slab.shape == (24, 24, 3) and slab.max() > 0


def test_a_slab_evaluates_and_says_what_it_cannot_do(tmp_path):
    slab = bs.Scene("slab_fig3_both").effective(quality="draft")
    wi, wo = pairs(20)
    assert slab.eval(wi, -wo).sum() > 0
    assert slab.plan and "alpha" in slab.form and slab.error is None
    for act in [lambda: slab.g(wi, wo), lambda: slab.sample(wi, [0.5, 0.5]), lambda: slab.table()]:
        with pytest.raises(bs.InputError) as raised:
            act()
        assert raised.value.field == "slab"
