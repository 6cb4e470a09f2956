"""Files of a data set: parts of whole rows, each written beside its place and renamed."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from ._spec import Spec

#: Columns that no parameter may be called.
FIXED = ("index", "key", "base", "milliseconds", "relative_error", "health", "state", "error")


def part_path(directory: Path, part: int) -> Path:
    """The file of a part."""
    return directory / f"part-{part:06d}.parquet"


def replace(path: Path, content: bytes) -> None:
    """Writes a file beside its place and renames it."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write_part(spec: Spec, name: str, directory: Path, part: int, rows: list[dict[str, Any]]) -> None:
    """Writes the rows of a part, in the order of their indices."""
    rows = sorted(rows, key=lambda row: row["index"])
    columns: dict[str, pa.Array] = {
        "index": pa.array([row["index"] for row in rows], pa.int64()),
        "key": pa.array([row.get("key") for row in rows], pa.string()),
        "base": pa.array([row["base"] for row in rows], pa.string()),
    }
    for key in dict.fromkeys(key for row in rows for key in row["values"]):
        columns[key] = pa.array([_plain(row["values"].get(key)) for row in rows])
    for what in spec.what:
        values = [row["outputs"].get(what) for row in rows]
        columns[what if what == "fit" else spec.column(what)] = _column(spec, what, values)
    columns["milliseconds"] = pa.array([row["milliseconds"] for row in rows], pa.float64())
    columns["relative_error"] = pa.array([row.get("relative_error") for row in rows], pa.float64())
    for column in ("health", "state", "error"):
        columns[column] = pa.array([row.get(column) for row in rows], pa.string())
    shapes = {spec.column(what): list(spec.shape(what)) for what in spec.arrays()}
    metadata = {"biscale.spec": name, "biscale.shapes": json.dumps(shapes)}
    sink = pa.BufferOutputStream()
    # Rounded numbers hardly shrink, and looking for repeated ones takes longer than writing them.
    compression = {name: "NONE" if name in shapes else "ZSTD" for name in columns}
    compression.update({f"{name}.list.element": "NONE" for name in shapes})
    table = pa.table(columns, metadata=metadata)
    pyarrow.parquet.write_table(
        table, sink, compression=compression, use_dictionary=["base", "state", "health", "error"], write_statistics=["index"]
    )
    replace(part_path(directory, part), sink.getvalue().to_pybytes())


def _plain(value: Any) -> Any:
    return json.dumps(value) if isinstance(value, (list, dict)) else value


def _column(spec: Spec, what: str, values: list[Any]) -> pa.Array:
    if what == "fit":
        return pa.array(values, pa.string())
    length = int(np.prod(spec.shape(what)))
    flat = np.zeros((len(values), length), spec.dtype)
    for place, value in zip(flat, values, strict=True):
        if value is not None:
            place[:] = value.ravel()
    missing = pa.array([value is None for value in values])
    return pa.FixedSizeListArray.from_arrays(pa.array(flat.ravel()), length, mask=missing)


def is_whole(spec: Spec, name: str, directory: Path, part: int, retry_failed: bool) -> bool:
    """Whether a part was made by the same specification and build, and need not be made again."""
    try:
        file = pyarrow.parquet.ParquetFile(part_path(directory, part))
    except (OSError, pa.ArrowException):
        return False
    with file:
        metadata = file.schema_arrow.metadata or {}
        if metadata.get(b"biscale.spec") != name.encode() or file.metadata.num_rows != len(spec.part_rows(part)):
            return False
        return not retry_failed or "failed" not in file.read(["state"]).column("state").to_pylist()
