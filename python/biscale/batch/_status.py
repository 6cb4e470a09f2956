"""What a data set holds: made, failed, rate, and the page that says so."""

from __future__ import annotations

import html
import json
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet

from .. import InputError
from ._parts import replace

COLUMNS = ["index", "key", "base", "milliseconds", "relative_error", "state", "error"]


def read_spec(directory: Path) -> dict[str, Any]:
    """The content of `spec.json`."""
    try:
        return dict(json.loads((directory / "spec.json").read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        text = f"{directory}: found {error}, expected the folder of a batch"
        raise InputError(text, file=str(directory), found=str(error), expected="the folder of a batch") from error


def rows_of(directory: Path) -> list[dict[str, Any]]:
    """The rows of all whole parts, without their values."""
    rows: list[dict[str, Any]] = []
    for path in sorted(directory.glob("part-*.parquet")):
        try:
            rows += pyarrow.parquet.read_table(path, columns=COLUMNS).to_pylist()
        except (OSError, pa.ArrowException):
            continue
    return rows


def status(directory: str | Path) -> dict[str, Any]:
    """Counts rows that are made and failed (grouped by complaint), and states rate, remaining time, bytes and errors."""
    folder = Path(directory)
    spec = read_spec(folder)
    rows = rows_of(folder)
    complaints: dict[str, int] = {}
    for row in rows:
        if row["state"] == "failed":
            complaints[row["error"]] = complaints.get(row["error"], 0) + 1
    errors = sorted(row["relative_error"] for row in rows if row["relative_error"] is not None)
    failed = sum(complaints.values())
    milliseconds = sum(row["milliseconds"] for row in rows) / max(len(rows), 1)
    remaining = spec["count"] - len(rows)
    return {
        "count": spec["count"],
        "made": len(rows) - failed,
        "failed": failed,
        "complaints": complaints,
        "remaining": remaining,
        "milliseconds_per_row": milliseconds,
        "core_seconds_left": 1e-3 * milliseconds * remaining,
        "bytes": sum(path.stat().st_size for path in folder.glob("part-*.parquet")),
        "median_relative_error": errors[len(errors) // 2] if errors else None,
        "largest_relative_error": errors[-1] if errors else None,
    }


def write_index(directory: Path) -> None:
    """Writes `failed.ndjson` and `index.html`."""
    failed = [
        json.dumps({name: row[name] for name in ("index", "key", "base", "error")})
        for row in rows_of(directory)
        if row["state"] == "failed"
    ]
    replace(directory / "failed.ndjson", "".join(line + "\n" for line in failed).encode())
    state = status(directory)
    complaints = state.pop("complaints")
    rows = [*state.items(), *((f"failed: {complaint}", count) for complaint, count in complaints.items())]
    cells = "".join(f"<tr><th>{html.escape(str(name))}</th><td>{html.escape(str(value))}</td></tr>" for name, value in rows)
    page = (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>biscale batch</title>'
        "<style>body{font-family:sans-serif}th{text-align:left;padding-right:2em;font-weight:normal}</style>"
        f"<h1>{html.escape(directory.name)}</h1><table>{cells}</table></html>\n"
    )
    replace(directory / "index.html", page.encode())
