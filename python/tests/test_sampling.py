"""`sample` draws what `pdf` states, and its weights average to the albedo."""

import math

import numpy as np
import pytest

import biscale as bs

SCENES = ["fig4b_bicolor_cup", "fig5c_uneven", "fig7a_shot_silk", "default"]
VIEWERS = [(0.1, 0.3), (0.6, 2.0), (1.0, 4.5), (1.35, 1.2)]
COUNT = 100_000
#: Cells in the cosine of the polar angle and in azimuth, and steps of the quadrature along each side of a cell.
CELLS, STEPS = (16, 32), 24


@pytest.fixture(scope="module", params=SCENES)
def brdf(request):
    return bs.Scene(request.param).effective(quality="draft", backend="cpu")


def expected_counts(brdf, wi):
    """The integral of the density over each cell, by the middles of STEPS x STEPS parts."""
    z = (np.arange(CELLS[0] * STEPS) + 0.5) / (CELLS[0] * STEPS)
    phi = (np.arange(CELLS[1] * STEPS) + 0.5) / (CELLS[1] * STEPS) * 2 * np.pi
    wo = bs.from_angles(np.arccos(z)[:, None], phi)
    density = brdf.pdf(wi, wo).reshape(CELLS[0], STEPS, CELLS[1], STEPS)
    return density.mean(axis=(1, 3)) * 2 * np.pi / (CELLS[0] * CELLS[1]) * COUNT


def p_value(statistic, degrees):
    """Upper tail of chi-squared (Wilson and Hilferty 1931)."""
    scale = 2 / (9 * degrees)
    z = ((statistic / degrees) ** (1 / 3) - (1 - scale)) / math.sqrt(scale)
    return 0.5 * math.erfc(z / math.sqrt(2))


@pytest.mark.parametrize("viewer", VIEWERS)
def test_directions_are_drawn_with_the_stated_density_and_weights_average_to_the_albedo(brdf, viewer):
    wi = bs.from_angles(*viewer)
    u = np.random.default_rng(7).random((COUNT, 2))
    wo, pdf, weight = brdf.sample(wi, u)
    drawn = pdf > 0
    np.testing.assert_allclose(brdf.pdf(wi, wo[drawn]), pdf[drawn], rtol=1e-6)
    np.testing.assert_allclose(brdf.eval(wo[drawn], wi) / pdf[drawn, None], weight[drawn], rtol=1e-5, atol=1e-9)
    cosine, azimuth = wo[drawn, 2], np.arctan2(wo[drawn, 1], wo[drawn, 0]) % (2 * np.pi)
    counts, _, _ = np.histogram2d(cosine, azimuth, CELLS, [(0, 1), (0, 2 * np.pi)])
    expected = expected_counts(brdf, wi)
    assert expected.sum() <= COUNT * 1.002
    order = np.argsort(expected, axis=None)
    counts, expected = counts.ravel()[order], expected.ravel()[order]
    # Cells with few samples are counted together.
    few = np.searchsorted(np.cumsum(expected), 5) + 1
    few = max(few, np.searchsorted(expected, 5))
    counts = np.append(counts[few:], counts[:few].sum())
    expected = np.append(expected[few:], expected[:few].sum())
    statistic = ((counts - expected) ** 2 / np.maximum(expected, 1e-9)).sum()
    significance = 1 - (1 - 0.01) ** (1 / (len(SCENES) * len(VIEWERS)))
    assert p_value(statistic, len(counts) - 1) > significance
    albedo = brdf.albedo(wi)
    error = weight.std(axis=0) / math.sqrt(COUNT)
    assert (abs(weight.mean(axis=0) - albedo) < 0.005 * albedo + 4 * error).all()


def test_uniform_numbers_outside_the_square_are_refused(cup):
    with pytest.raises(bs.InputError) as raised:
        cup.sample([0, 0, 1], [[0.5, 0.5], [0.5, 1.5]])
    assert raised.value.field == "u[1]"
