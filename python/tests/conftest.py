"""What the tests share: the command line, and pairs of directions."""

import os
import subprocess
import sys

import numpy as np
import pytest

import biscale as bs


def command(*arguments, text=None):
    """Runs the command line: the program that BISCALE names, or that of the package."""
    program = [os.environ["BISCALE"]] if "BISCALE" in os.environ else [sys.executable, "-m", "biscale"]
    environment = {**os.environ, "BISCALE_CACHE": "off"}
    return subprocess.run(
        [*program, *map(str, arguments)], input=text, capture_output=True, text=True, env=environment, timeout=300
    )


def random_angles(count, seed=1):
    """`theta_i, phi_i, theta_o, phi_o` [rad] of pairs above the surface."""
    generator = np.random.default_rng(seed)
    angles = generator.random((count, 4)) * [1.5, 2 * np.pi, 1.5, 2 * np.pi]
    # A quarter lies near the mirror direction.
    near = generator.random(count) < 0.25
    angles[near, 2] = angles[near, 0]
    angles[near, 3] = np.pi + angles[near, 1]
    return angles


def pairs(count, seed=1):
    """Directions towards light and viewer."""
    theta_i, phi_i, theta_o, phi_o = random_angles(count, seed).T
    return bs.from_angles(theta_i, phi_i), bs.from_angles(theta_o, phi_o)


@pytest.fixture(scope="session")
def cup():
    return bs.Scene("fig4b_bicolor_cup").effective(quality="draft", backend="cpu")
