"""The description of a batch: which materials, and what is computed of each."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from .. import InputError, Scene, from_angles, mirror_biased_pairs
from .._errors import Error

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib  # type: ignore[no-redef]

MAX_COUNT = 10**9
MAX_GRID = 10**8
OUTPUTS = ("pairs", "table", "image", "fit")
KEYS = {"base", "count", "grid", "seed", "table", "sample", "output"}
OUTPUT_KEYS = {"what", "pairs", "directions", "resolution", "size", "quality", "dtype", "rows_per_file"}


def refused(file: str | None, key: str, found: object, expected: str, hint: str | None = None) -> InputError:
    """The error of a specification."""
    place = f"{file}: {key}" if file else key
    text = f"{place}: found {found}, expected {expected}" + (f" ({hint})" if hint else "")
    return InputError(text, file=file, field=key, found=str(found), expected=expected, hint=hint)


@dataclass(frozen=True)
class Distribution:
    """How the values of one key are drawn."""

    kind: str
    arguments: list[Any]
    steps: int | None = None

    def value(self, u: float, limits: tuple[float, float] | None) -> Any:
        """The value at the uniform number `u`."""
        if self.kind == "choice":
            return self.arguments[min(int(u * len(self.arguments)), len(self.arguments) - 1)]
        low, high = self.arguments
        if self.kind == "log":
            return math.exp(math.log(low) + u * (math.log(high) - math.log(low)))
        if self.kind == "uniform":
            return low + u * (high - low)
        value = NormalDist(low, high).inv_cdf(min(max(u, 1e-16), 1 - 1e-16))
        return value if limits is None else min(max(value, limits[0]), limits[1])

    def levels(self) -> int:
        """The number of values of a grid."""
        return len(self.arguments) if self.kind == "choice" else self.steps or 1

    def level(self, k: int) -> Any:
        """The k-th value of a grid."""
        if self.kind == "choice":
            return self.arguments[k]
        return self.value(0.5 if self.levels() == 1 else k / (self.levels() - 1), None)

    def extremes(self) -> list[Any]:
        """Values that the key has to accept."""
        return [self.arguments[0]] if self.kind == "normal" else list(self.arguments)


@dataclass(frozen=True)
class Spec:
    """A checked specification."""

    base: list[str]
    """The scenes that rows start from."""
    count: int
    """The number of rows."""
    seed: int
    """The seed of the values of all rows."""
    grid: bool
    """Whether rows are all combinations of the levels of the keys."""
    sample: dict[str, Distribution]
    """How the values of each key are drawn."""
    what: list[str]
    """What is computed: `pairs`, `table`, `image`, `fit`."""
    wi: np.ndarray[Any, Any]
    """Directions of the pairs towards the light."""
    wo: np.ndarray[Any, Any]
    """Directions of the pairs towards the viewer."""
    resolution: tuple[int, int]
    """Steps of theta and phi of a table."""
    size: tuple[int, int]
    """Width and height of an image."""
    quality: str
    """The preset."""
    dtype: str
    """The type of the stored values: `float16` or `float32`."""
    rows_per_file: int
    """Rows of a file."""
    rows: pa.Table | None
    """The rows, if the specification is a table."""
    scenes: dict[str, Scene] = field(repr=False)
    """The scenes by their names in `base`."""
    limits: dict[str, tuple[float, float]]
    """The range of each key that is drawn from a normal distribution."""
    end: int
    """Rows from this one on are not made this time."""

    def parts(self) -> int:
        """The number of files."""
        return -(-self.end // self.rows_per_file)

    def part_rows(self, part: int) -> range:
        """The rows of a file."""
        return range(part * self.rows_per_file, min((part + 1) * self.rows_per_file, self.end))

    def row(self, index: int) -> tuple[str, dict[str, Any]]:
        """The base of a row and the values of its keys. They depend on the seed and the index alone."""
        if self.rows is not None:
            row = self.rows.slice(index, 1).to_pylist()[0]
            base = row.pop("base", None) or self.base[0]
            return base, {key: value for key, value in row.items() if value is not None}
        if self.grid:
            values: dict[str, Any] = {}
            for key, distribution in reversed(self.sample.items()):
                index, level = divmod(index, distribution.levels())
                values[key] = distribution.level(level)
            return self.base[index % len(self.base)], dict(reversed(values.items()))
        # Each row has its own part of the counter, so that rows are independent of each other and of their order.
        generator = np.random.Generator(np.random.Philox(key=self.seed, counter=[0, 0, index, 0]))
        u = generator.random(1 + len(self.sample))
        base = self.base[min(int(u[0] * len(self.base)), len(self.base) - 1)]
        items = zip(self.sample.items(), u[1:], strict=True)
        return base, {key: draw.value(float(at), self.limits.get(key)) for (key, draw), at in items}

    def values_per_row(self) -> int:
        """Numbers of all arrays of a row."""
        theta, phi = self.resolution
        sizes = {"pairs": 3 * len(self.wi), "table": 3 * (theta * phi) ** 2, "image": 3 * self.size[0] * self.size[1]}
        return sum(sizes.get(what, 0) for what in self.what)

    def bytes_per_row(self) -> int:
        """The size of a row in a file, without compression."""
        return self.values_per_row() * np.dtype(self.dtype).itemsize + 200

    def arrays(self) -> list[str]:
        """The outputs that are arrays."""
        return [what for what in self.what if what != "fit"]

    def column(self, what: str) -> str:
        """The column of an output: `values` for the only array, else the name of the output."""
        return "values" if self.arrays() == [what] else what

    def shape(self, what: str) -> tuple[int, ...]:
        """The shape of an output of a row."""
        theta, phi = self.resolution
        shapes = {"pairs": (len(self.wi), 3), "table": (theta, phi, theta, phi, 3)}
        return shapes.get(what) or (self.size[1], self.size[0], 3)

    def describe(self) -> dict[str, Any]:
        """Everything that decides the content of the data set, for `spec.json`."""
        rows = None if self.rows is None else self.rows.to_pydict()
        sample = {key: {draw.kind: draw.arguments, "steps": draw.steps} for key, draw in self.sample.items()}
        directions = np.concatenate([self.wi, self.wo]).astype(np.float64).tobytes()
        return {
            "base": self.base,
            "keys": {name: scene.key(directions) for name, scene in self.scenes.items()},
            "count": self.count,
            "seed": self.seed,
            "grid": self.grid,
            "sample": sample,
            "rows": rows,
            "what": self.what,
            "pairs": len(self.wi),
            "resolution": list(self.resolution),
            "size": list(self.size),
            "quality": self.quality,
            "dtype": self.dtype,
            "rows_per_file": self.rows_per_file,
        }


def load(spec: str | Path | dict[str, Any], limit: int | None = None) -> Spec:
    """Reads and checks a specification: a `.toml`, `.parquet` or `.csv` file, or a dictionary.

    Raises InputError with the file and the key.
    """
    file, folder, content = None, Path(), spec
    if not isinstance(spec, dict):
        path = Path(spec)
        file, folder = str(path), path.parent
        content = {"table": path.name} if path.suffix in (".parquet", ".csv") else _toml(path)
    assert isinstance(content, dict)
    unknown = sorted(set(content) - KEYS)
    if unknown:
        raise refused(file, unknown[0], "an unknown key", f"one of {', '.join(sorted(KEYS))}")
    rows = _rows(file, folder, content["table"]) if "table" in content else None
    output = _output(file, folder, content.get("output", {}))
    base = content.get("base", [] if rows is not None else None)
    base = [base] if isinstance(base, str) else base
    if not isinstance(base, list) or not all(isinstance(name, str) for name in base) or (rows is None and not base):
        raise refused(file, "base", repr(base), "scenes: a name or a list of names")
    sample = {key: _distribution(file, key, value) for key, value in content.get("sample", {}).items()}
    grid = content.get("grid", False)
    if rows is not None and (sample or grid or "count" in content):
        raise refused(file, "table", "a table and `sample`, `grid` or `count`", "one of them")
    scenes, limits = _check_keys(file, folder, base, sample, rows)
    count = _count(file, content, grid, base, sample, rows)
    seed = content.get("seed", 1)
    if not isinstance(seed, int) or not 0 <= seed < 2**64:
        raise refused(file, "seed", repr(seed), "a whole number from 0 to 2^64 - 1")
    return Spec(
        base=base or [next(iter(scenes))],
        count=count,
        end=count if limit is None else min(limit, count),
        seed=seed,
        grid=grid,
        sample=sample,
        rows=rows,
        scenes=scenes,
        limits=limits,
        **output,
    )


def _toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise refused(str(path), "", error, "a specification (TOML, Parquet or CSV)") from error


def _rows(file: str | None, folder: Path, name: object) -> pa.Table:
    if not isinstance(name, str):
        raise refused(file, "table", repr(name), "a .parquet or .csv file")
    path = folder / name
    try:
        table = pyarrow.csv.read_csv(path) if path.suffix == ".csv" else pyarrow.parquet.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise refused(str(path), "table", error, "a readable .parquet or .csv file") from error
    if table.num_rows == 0:
        raise refused(str(path), "table", "no rows", "a row a material")
    return table


def _distribution(file: str | None, key: str, value: object) -> Distribution:
    place = f"sample.{key}"
    kinds = ("uniform", "log", "choice", "normal")
    table = dict(value) if isinstance(value, dict) else {}
    steps = table.pop("steps", None)
    if len(table) != 1 or next(iter(table)) not in kinds:
        raise refused(file, place, repr(value), f"one of {', '.join(kinds)}, such as {{ uniform = [0.1, 0.5] }}")
    ((kind, arguments),) = table.items()
    if not isinstance(arguments, list) or not arguments:
        raise refused(file, f"{place}.{kind}", repr(arguments), "a list")
    if steps is not None and (not isinstance(steps, int) or steps < 1):
        raise refused(file, f"{place}.steps", repr(steps), "a whole number from 1")
    if kind == "choice":
        return Distribution(kind, arguments)
    if len(arguments) != 2 or not all(isinstance(number, (int, float)) for number in arguments):
        raise refused(file, f"{place}.{kind}", repr(arguments), "two numbers")
    low, high = arguments
    if kind == "normal" and high <= 0:
        raise refused(file, f"{place}.{kind}", repr(arguments), "a mean and a deviation above 0")
    if kind != "normal" and low >= high:
        raise refused(file, f"{place}.{kind}", repr(arguments), "a low and a higher number")
    if kind == "log" and low <= 0:
        raise refused(file, f"{place}.{kind}", repr(arguments), "numbers above 0")
    return Distribution(kind, [float(low), float(high)], steps)


def _check_keys(
    file: str | None, folder: Path, base: list[str], sample: dict[str, Distribution], rows: pa.Table | None
) -> tuple[dict[str, Scene], dict[str, tuple[float, float]]]:
    """Opens the scenes, and checks that they have all keys and accept both ends of all ranges."""
    names = list(base)
    if rows is not None and "base" in rows.column_names:
        names += [name for name in rows.column("base").unique().to_pylist() if name is not None]
    scenes = {name: Scene(folder / name if (folder / name).is_file() else name) for name in dict.fromkeys(names)}
    if not scenes:
        raise refused(file, "base", "nothing", "a scene: `base` or a column `base`")
    limits: dict[str, tuple[float, float]] = {}
    for name, scene in scenes.items():
        ranges = {entry["key"]: entry["range"] for entry in scene.fields()}
        for key in [] if rows is None else [key for key in rows.column_names if key != "base"]:
            if key not in ranges and "*" not in key:
                raise refused(file, key, f"a column that is no key of `{name}`", "keys, as scene.fields() lists them")
        for key, distribution in sample.items():
            for value in distribution.extremes():
                edited = scene.copy()
                try:
                    edited.set({key: value})
                except Error as error:
                    raise refused(file, f"sample.{key}", f"{value} for `{name}`", f"a value that it takes: {error}") from error
            if distribution.kind == "normal" and ranges.get(key):
                low, high = ranges[key]
                known = limits.get(key, (low, high))
                limits[key] = (max(low, known[0]), min(high, known[1]))
    return scenes, limits


def _count(
    file: str | None,
    content: dict[str, Any],
    grid: object,
    base: list[str],
    sample: dict[str, Distribution],
    rows: pa.Table | None,
) -> int:
    if rows is not None:
        return int(rows.num_rows)
    if grid:
        if "count" in content:
            raise refused(file, "count", "`count` and `grid`", "one of them")
        for key, distribution in sample.items():
            if distribution.kind != "choice" and distribution.steps is None:
                raise refused(file, f"sample.{key}", "a range without steps", "`steps` in a grid")
        count = len(base) * math.prod(distribution.levels() for distribution in sample.values())
        if count > MAX_GRID:
            raise refused(file, "grid", f"{count} combinations", f"at most {MAX_GRID}")
        return count
    asked = content.get("count")
    if not isinstance(asked, int) or not 1 <= asked <= MAX_COUNT:
        raise refused(file, "count", repr(asked), f"a whole number from 1 to {MAX_COUNT}")
    return asked


def _output(file: str | None, folder: Path, output: dict[str, Any]) -> dict[str, Any]:
    unknown = sorted(set(output) - OUTPUT_KEYS)
    if unknown:
        raise refused(file, f"output.{unknown[0]}", "an unknown key", f"one of {', '.join(sorted(OUTPUT_KEYS))}")
    what = output.get("what", "pairs")
    what = [what] if isinstance(what, str) else what
    if not isinstance(what, list) or not what or not set(what) <= set(OUTPUTS):
        raise refused(file, "output.what", repr(what), f"one or several of {', '.join(OUTPUTS)}")
    dtype = output.get("dtype", "float16")
    if dtype not in ("float16", "float32"):
        raise refused(file, "output.dtype", repr(dtype), "float16 or float32")

    def numbers(key: str, default: list[int], most: int) -> tuple[int, int]:
        value = output.get(key, default)
        if not isinstance(value, list) or len(value) != 2 or not all(isinstance(n, int) and 1 <= n <= most for n in value):
            raise refused(file, f"output.{key}", repr(value), f"two whole numbers from 1 to {most}")
        return (value[0], value[1])

    rows_per_file = output.get("rows_per_file", 500)
    if not isinstance(rows_per_file, int) or not 1 <= rows_per_file <= 10**6:
        raise refused(file, "output.rows_per_file", repr(rows_per_file), "a whole number from 1 to 1000000")
    wi, wo = _pairs(file, folder, output)
    return {
        "what": what,
        "wi": wi,
        "wo": wo,
        "resolution": numbers("resolution", [12, 24], 1024),
        "size": numbers("size", [128, 128], 4096),
        "quality": output.get("quality", "standard"),
        "dtype": dtype,
        "rows_per_file": rows_per_file,
    }


def _pairs(file: str | None, folder: Path, output: dict[str, Any]) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    if "pairs" not in output:
        count = output.get("directions", 4096)
        if not isinstance(count, int) or not 1 <= count <= 10**6:
            raise refused(file, "output.directions", repr(count), "a number of pairs from 1 to 1000000")
        return mirror_biased_pairs(count, 1)
    path = folder / output["pairs"]
    header = ["theta_i", "phi_i", "theta_o", "phi_o"]
    try:
        table = pyarrow.csv.read_csv(path)
        theta_i, phi_i, theta_o, phi_o = (table.column(name).to_numpy().astype(float) for name in header)
    except (OSError, KeyError, ValueError, pa.ArrowException) as error:
        raise refused(str(path), "output.pairs", error, f"a CSV file with the columns {','.join(header)} [rad]") from error
    return from_angles(theta_i, phi_i), from_angles(theta_o, phi_o)


def canonical(description: dict[str, Any]) -> str:
    """The text of `spec.json`."""
    return json.dumps(description, indent=1, sort_keys=True, default=str)
