"""What the checks against other programs share: the command line of biscale, direction pairs, and a table of results."""

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
    """Ends a check that cannot run here: loudly, but not as a failure."""
    print(f"SKIPPED: {reason}")
    sys.exit(0)


def children_seconds():
    """Processor seconds of the programs that were run so far; where they are not counted, those of the clock."""
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime if resource else time.time()


def biscale(*arguments):
    """Runs the program; returns what it prints and the processor seconds it took, all cores together."""
    start = children_seconds()
    environment = {**os.environ, "BISCALE_CACHE": "off"}
    done = subprocess.run([BISCALE, *map(str, arguments)], check=True, capture_output=True, text=True, env=environment)
    return done.stdout, children_seconds() - start


def export(scene, path, *options):
    """Exports a table; returns the report and the seconds."""
    out, seconds = biscale("export", scene, "-o", path, "--json", "--quiet", *options)
    return json.loads(out), seconds


def direction(theta, phi):
    """Unit vectors, xyz last."""
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def angles(vector):
    return np.arccos(np.clip(vector[..., 2], -1, 1)), np.arctan2(vector[..., 1], vector[..., 0])


def random_pairs(count, seed=1, lowest_deg=85):
    """`theta_i, phi_i, theta_o, phi_o`: up to 85 degrees, uniform in solid angle, half of them near the mirror direction."""
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
    """f_bar of `biscale eval` at the pairs: an array of RGB."""
    asked, told = Path(folder) / "pairs.csv", Path(folder) / "values.csv"
    np.savetxt(asked, pairs, delimiter=",", header="theta_i,phi_i,theta_o,phi_o", comments="", fmt="%.9g")
    biscale("eval", scene, "--pairs", asked, "-o", told, "--quiet", *options)
    return np.loadtxt(told, delimiter=",", skiprows=1)[:, 4:7]


def mean_error(found, expected):
    """Mean of the differences over the mean of what is expected."""
    return np.abs(found - expected).sum() / np.abs(expected).sum()


class Table:
    """Rows of results that are printed as they come, and whether all of them are as they must be."""

    def __init__(self, *columns):
        self.passed = True
        self.widths = [max(len(column), 14) for column in columns]
        self.row(*columns)

    def row(self, *cells):
        print("  ".join(str(cell).ljust(width) for cell, width in zip(cells, self.widths)), flush=True)

    def check(self, condition, *cells):
        self.passed &= bool(condition)
        self.row(*cells, "" if condition else "FAILED")

    def finish(self):
        sys.exit(0 if self.passed else 1)
