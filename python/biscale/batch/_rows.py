"""Evaluation of rows, in the processes that compute."""

from __future__ import annotations

import json
import os
import time
from typing import Any

import numpy as np

from .. import EffectiveBrdf, InputError, Scene
from .._errors import Error
from ._spec import Spec

#: One row in this many states its error, from two seeds on ERROR_PAIRS pairs.
ERROR_STRIDE = 50
ERROR_PAIRS = 64

#: The scenes of this process by the name of the specification and the base. A scene keeps what the next row shares.
_scenes: dict[tuple[str, str], Scene] = {}


def one_thread() -> None:
    """Lets materials be computed whole on one thread each, unless the caller set another number of threads."""
    os.environ.setdefault("RAYON_NUM_THREADS", "1")


def evaluate(spec: Spec, name: str, indices: list[int]) -> list[dict[str, Any]]:
    """The rows at `indices`. `name` identifies the specification. A bad material is a row with its complaint."""
    one_thread()
    return [_row(spec, name, index) for index in indices]


def _row(spec: Spec, name: str, index: int) -> dict[str, Any]:
    start = time.perf_counter()
    base, values = spec.row(index)
    row: dict[str, Any] = {"index": index, "base": base, "values": values, "state": "made", "error": None}
    try:
        scene = _scenes.get((name, base))
        if scene is None or spec.rows is not None:
            # Rows of a table may leave out keys that the row before had.
            scene = spec.scenes[base].copy()
            _scenes[(name, base)] = scene
        scene.set(values)
        row["key"] = scene.key(repr((spec.what, spec.quality, spec.seed, spec.resolution, spec.size)).encode())
        row["outputs"] = _outputs(spec, scene, row)
    except Error as error:
        row.update(state="failed", error=str(error), outputs={})
    row["milliseconds"] = 1e3 * (time.perf_counter() - start)
    return row


def _outputs(spec: Spec, scene: Scene, row: dict[str, Any]) -> dict[str, Any]:
    brdf = scene.effective(quality=spec.quality, backend="cpu", seed=spec.seed)
    row["health"] = json.dumps(brdf.notes)
    outputs: dict[str, Any] = {}
    for what in spec.what:
        if what == "fit":
            outputs[what] = json.dumps(brdf.fit())
            continue
        outputs[what] = _rounded(spec, row["index"], _array(spec, scene, brdf, what))
    if row["index"] % ERROR_STRIDE == 0:
        row["relative_error"] = _error(spec, scene, brdf)
    return outputs


def _array(spec: Spec, scene: Scene, brdf: EffectiveBrdf, what: str) -> np.ndarray[Any, Any]:
    if what == "pairs":
        return np.asarray(brdf.eval(spec.wi, spec.wo))
    if what == "table":
        theta, phi = spec.resolution
        return brdf.table(theta, phi)["brdf"]
    return scene.render(spec.size, quality=spec.quality, backend="cpu", seed=spec.seed)


def _rounded(spec: Spec, index: int, values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    with np.errstate(over="ignore"):
        rounded = values.astype(np.float32, copy=False).astype(spec.dtype, copy=False)
    if not np.isfinite(rounded).all():
        largest = float(np.abs(values).max())
        found = f"{largest:g} in row {index}"
        text = f"output.dtype: found {found}, expected at most 65504 (float32 holds it)"
        raise InputError(text, field="output.dtype", found=found, expected="at most 65504", hint="use float32")
    return rounded


def _error(spec: Spec, scene: Scene, brdf: EffectiveBrdf) -> float:
    """Relative L2 of one result, estimated from the difference between two seeds."""
    wi, wo = spec.wi[:ERROR_PAIRS], spec.wo[:ERROR_PAIRS]
    # A copy, so that the scene keeps what the next row shares.
    other = scene.copy().effective(quality=spec.quality, backend="cpu", seed=spec.seed + 1).eval(wi, wo)
    values = brdf.eval(wi, wo)
    norm = float(np.linalg.norm(values))
    return float(np.linalg.norm(values - other)) / (norm * 2**0.5) if norm > 0 else 0.0
