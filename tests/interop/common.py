"""Code that the checks against other programs share: the command line of biscale, direction pairs, and a table of results."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

try:
    import numpy as np
except ImportError as error:
    print(f"SKIPPED: the checks need numpy ({error})")
    sys.exit(0)

try:
    import resource
except ImportError:
    resource = None

ROOT = Path(__file__).resolve().parents[2]
BISCALE = os.environ.get("BISCALE", str(ROOT / "target/release/biscale"))


def skip(reason):
    """Ends a check that cannot run here. It prints SKIPPED and does not fail."""
    print(f"SKIPPED: {reason}")
    sys.exit(0)


def children_seconds():
    """Returns the CPU seconds of all child processes; wall-clock seconds if the system does not count them."""
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime if resource else time.time()


def biscale(*arguments):
    """Runs the program. Returns its standard output and its CPU seconds over all cores."""
    start = children_seconds()
    environment = {**os.environ, "BISCALE_CACHE": "off"}
    done = subprocess.run([BISCALE, *map(str, arguments)], check=True, capture_output=True, text=True, env=environment)
    return done.stdout, children_seconds() - start


def export(scene, path, *options):
    """Exports a table. Returns the report and the CPU seconds."""
    out, seconds = biscale("export", scene, "-o", path, "--json", "--quiet", *options)
    return json.loads(out), seconds


def direction(theta, phi):
    """Returns unit vectors. The last axis holds x, y and z."""
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def angles(vector):
    return np.arccos(np.clip(vector[..., 2], -1, 1)), np.arctan2(vector[..., 1], vector[..., 0])


def random_pairs(count, seed=1, lowest_deg=85):
    """Returns rows of `theta_i, phi_i, theta_o, phi_o`, uniform in solid angle up to a bound; half of them are near the mirror
    direction."""
    rng = np.random.default_rng(seed)
    least = np.cos(np.radians(lowest_deg))

    def uniform(n):
        return direction(np.arccos(rng.uniform(least, 1, n)), rng.uniform(0, 2 * np.pi, n))

    i, o = uniform(4 * count), uniform(4 * count)
    mirror = i * [-1, -1, 1]
    mirror[:, :2] += rng.uniform(-0.25, 0.25, (len(i), 2))
    mirror /= np.linalg.norm(mirror, axis=1, keepdims=True)
    o[1::2] = mirror[1::2]
    keep = o[:, 2] > least
    i, o = i[keep][:count], o[keep][:count]
    return np.column_stack([*angles(i), *angles(o)])


def evaluate(scene, pairs, folder, *options):
    """Returns f_bar of `biscale eval` at the pairs, as an array of RGB."""
    pairs_path, values_path = Path(folder) / "pairs.csv", Path(folder) / "values.csv"
    np.savetxt(pairs_path, pairs, delimiter=",", header="theta_i,phi_i,theta_o,phi_o", comments="", fmt="%.9g")
    biscale("eval", scene, "--pairs", pairs_path, "-o", values_path, "--quiet", *options)
    return np.loadtxt(values_path, delimiter=",", skiprows=1)[:, 4:7]


def mean_error(found, expected):
    """Returns the mean difference divided by the mean expected value."""
    return np.abs(found - expected).sum() / np.abs(expected).sum()


class Table:
    """Prints rows of results at once, and records whether all checks pass."""

    def __init__(self, *columns):
        self.passed = True
        self.widths = [max(len(column), 14) for column in columns]
        self.row(*columns)

    def row(self, *cells):
        widths = self.widths + [0] * (len(cells) - len(self.widths))
        print("  ".join(str(cell).ljust(width) for cell, width in zip(cells, widths)), flush=True)

    def check(self, condition, *cells):
        self.passed &= bool(condition)
        self.row(*cells, "" if condition else "FAILED")

    def finish(self):
        sys.exit(0 if self.passed else 1)
