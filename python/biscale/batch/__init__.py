"""Thousands of materials: rows of a specification, evaluated by Dask and written as Parquet files.

>>> import biscale.batch
>>> biscale.batch.run("spec.toml", "materials")  # doctest: +SKIP

The same from the shell: ``python -m biscale.batch run spec.toml -o materials``.
"""

from __future__ import annotations

import hashlib
import io
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ._parts import is_whole, replace, write_part
from ._rows import evaluate, one_thread
from ._spec import Spec, canonical, load, refused
from ._status import status, write_index

__all__ = ["Result", "Spec", "evaluate", "load", "run", "status"]

#: Rows of a task: a task takes about a second, so that a lost worker costs no more.
ROWS_PER_TASK = 16


@dataclass
class Result:
    """What a run did."""

    made: int = 0
    """Rows that were made this time."""
    failed: int = 0
    """Rows that failed this time."""
    kept: int = 0
    """Rows that were there already."""
    seconds: float = 0.0
    """The time of the run."""
    complaints: dict[str, int] = field(default_factory=dict)
    """The number of failed rows by their complaint."""


def run(
    spec: str | Path | dict[str, Any],
    directory: str | Path,
    client: Any = None,
    shard: tuple[int, int] | None = None,
    retry_failed: bool = False,
    progress: bool | Callable[[int, int], None] = True,
    *,
    limit: int | None = None,
    into_new_spec: bool = False,
    force: bool = False,
) -> Result:
    """Makes the materials of a specification in `directory`, and keeps those that are there.

    `client` is a Dask client; without one, the processes of a LocalCluster compute. `shard = (k, n)` makes the k-th of n parts of the
    data set (from 1), in this process alone, so that n independent jobs make all of it. `limit` makes the first rows only.
    """
    checked = load(spec, limit)
    if shard is not None and not 1 <= shard[0] <= shard[1]:
        raise refused(None, "shard", f"{shard[0]}/{shard[1]}", "K/N with K from 1 to N")
    folder = Path(directory)
    name = _prepare(checked, folder, into_new_spec)
    parts = [part for part in range(checked.parts()) if shard is None or part % shard[1] == shard[0] - 1]
    missing = [part for part in parts if not is_whole(checked, name, folder, part, retry_failed)]
    _check_space(checked, folder, missing, force, bool(progress))
    report = _printer(progress)
    start = time.perf_counter()
    result = Result(kept=sum(len(checked.part_rows(part)) for part in parts) - _rows_in(checked, missing))
    tasks = _tasks(checked, missing)
    engine = _here(checked, name, tasks) if shard is not None else _on_dask(checked, name, tasks, client)
    _write_parts(checked, name, folder, missing, engine, result, report)
    result.seconds = time.perf_counter() - start
    write_index(folder)
    return result


def _prepare(spec: Spec, folder: Path, into_new_spec: bool) -> str:
    """Writes `spec.json` and `pairs.npz`, and returns the name of the specification."""
    text = canonical(spec.describe())
    name = hashlib.blake2b(text.encode(), digest_size=16).hexdigest()
    folder.mkdir(parents=True, exist_ok=True)
    there = folder / "spec.json"
    if there.exists() and there.read_text(encoding="utf-8") != text:
        if not into_new_spec:
            expected = "a folder of its own, or into_new_spec"
            raise refused(str(there), "spec.json", "another specification or build", expected)
        there.unlink()
    if not there.exists():
        pairs = io.BytesIO()
        np.savez(pairs, wi=spec.wi, wo=spec.wo)
        replace(folder / "pairs.npz", pairs.getvalue())
        replace(there, text.encode())
    return name


def _check_space(spec: Spec, folder: Path, missing: list[int], force: bool, talks: bool) -> None:
    wanted = _rows_in(spec, missing) * spec.bytes_per_row()
    free = shutil.disk_usage(folder).free
    if talks and wanted > 0:
        print(f"{_rows_in(spec, missing)} materials, at most {wanted / 1e6:.1f} MB", file=sys.stderr)
    if wanted > free and not force:
        expected = f"at most the {free / 1e9:.1f} GB that are free there; fewer rows or values, or force"
        raise refused(str(folder), "output", f"{wanted / 1e9:.1f} GB", expected)


def _rows_in(spec: Spec, parts: list[int]) -> int:
    return sum(len(spec.part_rows(part)) for part in parts)


def _tasks(spec: Spec, parts: list[int]) -> Iterator[tuple[int, list[int]]]:
    """Tasks of consecutive rows, each within one part."""
    for part in parts:
        rows = list(spec.part_rows(part))
        for first in range(0, len(rows), ROWS_PER_TASK):
            yield part, rows[first : first + ROWS_PER_TASK]


Finished = Iterator[tuple[int, list[dict[str, Any]]]]


def _here(spec: Spec, name: str, tasks: Iterator[tuple[int, list[int]]]) -> Finished:
    """Computes in this process."""
    for part, indices in tasks:
        yield part, evaluate(spec, name, indices)


def _on_dask(spec: Spec, name: str, tasks: Iterator[tuple[int, list[int]]], client: Any) -> Finished:
    """Computes on the workers of a client. A worker that is lost loses its tasks to others."""
    first = next(tasks, None)
    if first is None:
        return
    import dask
    from distributed import Client, LocalCluster, as_completed

    # A task that was under way on lost workers is no task that kills workers.
    dask.config.set({"distributed.scheduler.allowed-failures": 1000})
    own = None
    if client is None:
        one_thread()
        own = LocalCluster(threads_per_worker=1, processes=True, dashboard_address=None)
        client = Client(own)
    try:
        shared = client.scatter(spec, broadcast=True)
        part_of: dict[Any, int] = {}

        def submit(task: tuple[int, list[int]]) -> Any:
            future = client.submit(evaluate, shared, name, task[1], pure=False)
            part_of[future.key] = task[0]
            return future

        # Few tasks wait at a time, so that the memory does not grow with the data set.
        window = 4 * max(1, len(client.scheduler_info()["workers"]))
        waiting = as_completed([submit(first)], with_results=True)
        for task in tasks:
            waiting.add(submit(task))
            if len(part_of) >= window:
                break
        for future, rows in waiting:
            yield part_of.pop(future.key), rows
            future.release()
            following = next(tasks, None)
            if following is not None:
                waiting.add(submit(following))
    finally:
        if own is not None:
            client.close()
            own.close()


def _write_parts(
    spec: Spec,
    name: str,
    folder: Path,
    parts: list[int],
    finished: Finished,
    result: Result,
    report: Callable[[int, int], None],
) -> None:
    """Collects rows, and writes each part when it is whole."""
    total = _rows_in(spec, parts)
    collected: dict[int, list[dict[str, Any]]] = {}
    for part, rows in finished:
        collected.setdefault(part, []).extend(rows)
        for row in rows:
            failed = row["state"] == "failed"
            result.failed += failed
            result.made += not failed
            if failed:
                result.complaints[row["error"]] = result.complaints.get(row["error"], 0) + 1
        if len(collected[part]) == len(spec.part_rows(part)):
            write_part(spec, name, folder, part, collected.pop(part))
        report(result.made + result.failed, total)


def _printer(progress: bool | Callable[[int, int], None]) -> Callable[[int, int], None]:
    if callable(progress):
        return progress
    if not progress:
        return lambda done, total: None
    last = [0.0, time.perf_counter()]

    def show(done: int, total: int) -> None:
        now = time.perf_counter()
        if now - last[0] > 2 or done == total:
            last[0] = now
            rate = done / max(now - last[1], 1e-9)
            left = (total - done) / max(rate, 1e-9)
            print(f"{done} of {total}, {rate:.1f} a second, {left:.0f} s left", file=sys.stderr)

    return show
