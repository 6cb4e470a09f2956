"""Millions of rays per second of Embree on the rays of `cargo bench --bench measure -- rays FOLDER`, on one thread.

    pip install numpy embreex
    python benches/embree_rays.py FOLDER

Embree has no endless tilings: it gets 5 x 5 copies of each tile, so that long rays leave them early.
"""

import sys
import time
from pathlib import Path

import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh

COPIES = range(-2, 3)
REPEATS = 15


def triangles(path: Path) -> np.ndarray:
    """Corners of all triangles, by triangle, corner and axis."""
    rows = [line.split() for line in path.read_text().splitlines()]
    positions = np.array([row[1:] for row in rows if row[0] == "v"], np.float32)
    return positions[np.array([row[1:] for row in rows if row[0] == "f"], np.int64) - 1]


def speed(scene, rays: np.ndarray, query: str) -> float:
    """Millions of rays per second, from the fastest of several runs."""
    origins, directions = (np.ascontiguousarray(rays[:, part]) for part in (slice(0, 3), slice(3, 6)))
    shortest = np.inf
    for _ in range(REPEATS):
        start = time.perf_counter()
        scene.run(origins, directions, query=query)
        shortest = min(shortest, time.perf_counter() - start)
    return len(rays) / shortest * 1e-6


def main(folder: Path) -> None:
    print("| tile | blocked: one direction | any direction | first hit: one direction | any direction |")
    print("|---|---|---|---|---|")
    for name in ("weave", "velvet", "caps", "perforated_sheet", "scan"):
        tile = triangles(folder / f"{name}.obj")
        copies = np.concatenate([tile + np.array([i, j, 0], np.float32) for i in COPIES for j in COPIES])
        scene = rtcore_scene.EmbreeScene()
        TriangleMesh(scene, copies)
        cells = [name]
        for kind in ("blocked_one", "blocked_any", "hit_one", "hit_any"):
            rays = np.fromfile(folder / f"{name}.{kind}.rays", "<f4").reshape(-1, 6)
            query = "OCCLUDED" if kind.startswith("blocked") else "INTERSECT"
            cells.append(f"{speed(scene, rays, query):.1f}")
        print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
