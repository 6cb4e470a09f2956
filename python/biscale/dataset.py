"""Data sets that `biscale.batch` made: as pyarrow tables, as numpy arrays by row, and for torch."""

from __future__ import annotations

import bisect
import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from .batch._status import read_spec


class Dataset:
    """The rows of a folder. ``data[k]`` is the k-th row: its parameters, and its values as an array of their shape."""

    def __init__(self, directory: str | Path) -> None:
        self.directory = Path(directory)
        """The folder."""
        self.spec = read_spec(self.directory)
        """The content of `spec.json`: everything that decides the content of the data set."""
        pairs = np.load(self.directory / "pairs.npz")
        self.wi = pairs["wi"]
        """Directions of the pairs towards the light, `(pairs, 3)`."""
        self.wo = pairs["wo"]
        """Directions of the pairs towards the viewer, `(pairs, 3)`."""
        self._paths = sorted(self.directory.glob("part-*.parquet"))
        counts = [pyarrow.parquet.read_metadata(path).num_rows for path in self._paths]
        self._starts = np.concatenate([[0], np.cumsum(counts)]).tolist()
        self._last: tuple[int, pa.Table] | None = None

    def __len__(self) -> int:
        return int(self._starts[-1])

    def __getitem__(self, row: int) -> dict[str, Any]:
        if row < 0:
            row += len(self)
        if not 0 <= row < len(self):
            raise IndexError(row)
        part = bisect.bisect_right(self._starts, row) - 1
        if self._last is None or self._last[0] != part:
            self._last = (part, pyarrow.parquet.read_table(self._paths[part]))
        table = self._last[1]
        shapes = json.loads(table.schema.metadata[b"biscale.shapes"])
        at = row - self._starts[part]
        found: dict[str, Any] = {}
        for name in table.column_names:
            value = table.column(name)[at]
            if name in shapes and value.is_valid:
                found[name] = value.values.to_numpy(zero_copy_only=False).reshape(shapes[name])
            else:
                found[name] = value.as_py()
        return found

    def table(self, columns: list[str] | None = None) -> pa.Table:
        """All rows as one table; with `columns`, only these."""
        return pa.concat_tables(
            [pyarrow.parquet.read_table(path, columns=columns) for path in self._paths], promote_options="default"
        )

    def torch(self) -> Made:
        """The rows with a result, as `torch.utils.data.DataLoader` reads them."""
        states = self.table(["state"]).column("state").to_pylist()
        return Made(self, [row for row, state in enumerate(states) if state == "made"])


class Made:
    """The rows that were made: a data set in the sense of torch."""

    def __init__(self, data: Dataset, rows: list[int]) -> None:
        self._data, self._rows = data, rows

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, row: int) -> dict[str, Any]:
        return self._data[self._rows[row]]


def open(directory: str | Path) -> Dataset:
    """Opens the data set of a folder."""
    return Dataset(directory)
