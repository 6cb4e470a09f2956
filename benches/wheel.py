"""Measures the Python package.

    python benches/wheel.py versions WHEEL PYTHON...    installs the wheel for each interpreter, and compares all shipped scenes
    python benches/wheel.py speed                       calls from Python beside the work that they contain
    python benches/wheel.py batch [ROWS]                materials per second of `biscale.batch`, with 1 and more processes
    python benches/wheel.py engine [ROWS]               time that Dask takes, beside a plain loop over threads
    python benches/wheel.py cost [ROWS]                 core-hours and bytes of a million materials, from ROWS materials of each family

`versions` needs BISCALE, the program that it compares with; the others need the package, and `batch` its extras.
"""

import itertools
import os
import queue
import resource
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

#: Evaluates the pairs of a file for every shipped scene and prints seconds, and a hash of the bits.
EVALUATE = """
import hashlib, sys, time
import numpy as np
start = time.perf_counter()
import biscale as bs
imported = time.perf_counter() - start
theta_i, phi_i, theta_o, phi_o = np.loadtxt(sys.argv[1], delimiter=",", skiprows=1).T
wi, wo = bs.from_angles(theta_i, phi_i), bs.from_angles(theta_o, phi_o)
bits, start = hashlib.sha256(), time.perf_counter()
for name in bs.scenes():
    bits.update(bs.Scene(name).effective(quality="draft", backend="cpu").eval(wi, wo).astype("f4").tobytes())
print(sys.version.split()[0], np.__version__, imported, time.perf_counter() - start, bits.hexdigest())
"""


def pairs_file(folder):
    """Writes 500 pairs of directions."""
    import random

    generator = random.Random(1)
    path = Path(folder) / "pairs.csv"
    rows = (",".join(repr(generator.random() * top) for top in (1.5, 6.28, 1.5, 6.28)) for _ in range(500))
    path.write_text("theta_i,phi_i,theta_o,phi_o\n" + "\n".join(rows) + "\n")
    return path


def command_bits(python, pairs):
    """The hash of the values that the program prints for every shipped scene."""
    code = """
import hashlib, os, subprocess, sys
import numpy as np
import biscale as bs
bits = hashlib.sha256()
for name in bs.scenes():
    run = [os.environ["BISCALE"], "eval", name, "--pairs", sys.argv[1], "-o", "-", "--quality", "draft", "--backend", "cpu", "--quiet"]
    text = subprocess.run(run, capture_output=True, text=True, check=True, env={**os.environ, "BISCALE_CACHE": "off"}).stdout
    bits.update(np.array([line.split(",")[4:] for line in text.splitlines()[1:]]).astype("f4").tobytes())
print(bits.hexdigest())
"""
    return subprocess.run([python, "-c", code, pairs], capture_output=True, text=True, check=True).stdout.strip()


def versions(wheel, interpreters):
    print("| Python | NumPy | imported [ms] | all shipped scenes, 500 pairs each [s] | bits of the command |")
    print("|---|---|---|---|---|")
    expected = None
    with tempfile.TemporaryDirectory() as folder:
        pairs = pairs_file(folder)
        for k, interpreter in enumerate(interpreters):
            place = Path(folder) / f"venv{k}"
            subprocess.run([interpreter, "-m", "venv", place], check=True)
            python = place / "bin" / "python"
            subprocess.run([python, "-m", "pip", "install", "-q", "--disable-pip-version-check", wheel], check=True)
            expected = expected or command_bits(python, pairs)
            run = subprocess.run([python, "-c", EVALUATE, pairs], capture_output=True, text=True, check=True)
            version, numpy, imported, seconds, bits = run.stdout.split()
            same = "equal" if bits == expected else "DIFFERENT"
            print(f"| {version} | {numpy} | {1e3 * float(imported):.1f} | {float(seconds):.1f} | {same} |")


def best(call, repeats):
    """The shortest time of several calls [ms]."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(1e3 * (time.perf_counter() - start))
    return min(times)


def speed():
    import biscale as bs

    brdf = bs.Scene("table4_cup").effective(quality="standard", backend="cpu")
    wi, wo = bs.mirror_biased_pairs(100_000, 1)
    wi, wo = (array.repeat(10, axis=0) for array in (wi, wo))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    million = best(lambda: brdf.eval(wi, wo), 2)
    peak = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024

    def given_up():
        try:
            brdf.eval(wi, wo, progress=lambda part: False)
        except bs.Cancelled:
            pass

    # The call looks at its progress after 20 ms for the first time.
    outside = best(given_up, 5) - 20
    print(f"a million pairs of table4_cup: {million:.0f} ms, of which {outside:.0f} ms outside of the evaluation; {peak:.0f} MB more")
    scene = bs.Scene("default")
    few = (wi[:300], wo[:300])
    state = {"step": 0}

    def edit():
        state["step"] += 1
        scene["material.default.brdf.roughness"] = 0.2 + 0.001 * (state["step"] % 100)
        state["brdf"] = scene.effective(quality="standard", backend="cpu")
        state["brdf"].eval(*few)

    whole = best(edit, 50)
    brdf = state["brdf"]
    inside = sum(brdf.times_ms.values()) + best(lambda: brdf.eval(*few), 50)
    print(f"an edit of a roughness and 300 pairs: {whole:.2f} ms, of which {whole - inside:.2f} ms are neither stages nor evaluation")


def grooves_and_pyramids(quality, rows):
    """A specification of grooves and pyramids at 4096 pairs."""
    return {
        "base": ["default", "table4_teapot"],
        "count": rows,
        "sample": {
            "material.default.brdf.roughness": {"uniform": [0.1, 0.6]},
            "tile.geometry.rotation_deg": {"uniform": [0.0, 30.0]},
        },
        "output": {"directions": 4096, "quality": quality},
    }


def batch(rows):
    from distributed import Client, LocalCluster

    from biscale import batch as batches

    print("| quality | processes | materials per second |")
    print("|---|---|---|")
    os.environ["RAYON_NUM_THREADS"] = "1"
    for quality in ("draft", "standard"):
        spec = grooves_and_pyramids(quality, rows)
        for count in sorted({1, os.cpu_count() or 1}):
            with tempfile.TemporaryDirectory() as folder:
                with LocalCluster(n_workers=count, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
                    with Client(cluster) as client:
                        made = batches.run(spec, folder, client, progress=False)
            print(f"| {quality} | {count} | {made.made / made.seconds:.1f} |")


def plain_loop(spec, name, threads):
    """Evaluates all rows in `threads` threads of this process, and returns the seconds. Nothing is written."""
    from biscale.batch import evaluate

    waiting = queue.SimpleQueue()
    for index in range(spec.count):
        waiting.put(index)

    def work(thread):
        while True:
            try:
                index = waiting.get_nowait()
            except queue.Empty:
                return
            # Rows of one name share a scene, which belongs to one thread.
            evaluate(spec, f"{name}, thread {thread}", [index])

    start = time.perf_counter()
    workers = [threading.Thread(target=work, args=(thread,)) for thread in range(threads)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    return time.perf_counter() - start


def engine(rows):
    from distributed import Client, LocalCluster

    from biscale import batch as batches

    threads = os.cpu_count() or 1
    # The threads of the plain loop share the pool of this process; each process of Dask has a pool of one thread.
    os.environ["RAYON_NUM_THREADS"] = "1"
    print("| quality | turn | plain loop [s] | Dask [s] | Dask / plain loop |")
    print("|---|---|---|---|---|")
    with LocalCluster(n_workers=threads, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        with Client(cluster) as client:
            os.environ["RAYON_NUM_THREADS"] = str(threads)
            for quality, turn in itertools.product(("draft", "standard"), range(3)):
                spec = grooves_and_pyramids(quality, rows) | {"seed": turn}
                loop = plain_loop(batches.load(spec), f"{quality} {turn}", threads)
                with tempfile.TemporaryDirectory() as folder:
                    dask = batches.run(spec, folder, client, progress=False).seconds
                print(f"| {quality} | {turn + 1} | {loop:.2f} | {dask:.2f} | {dask / loop:.3f} |", flush=True)


#: A scene of each family, and the keys that vary.
FAMILIES = {
    "grooves": ("default", {"tile.geometry.depth": [0.02, 0.4], "material.default.brdf.roughness": [0.1, 0.6]}),
    "pyramids": ("table4_teapot", {"tile.geometry.height": [0.02, 0.2], "material.default.brdf.roughness": [0.1, 0.6]}),
    "rods": ("table4_pillow", {"tile.geometry.spread_deg": [5.0, 40.0], "tile.geometry.length": [0.2, 0.4]}),
}


def cost(rows):
    os.environ["RAYON_NUM_THREADS"] = "1"
    from biscale import batch as batches

    print("| quality | interreflection | family | CPU time of a material [ms] | core-hours of a million |")
    print("|---|---|---|---|---|")
    for quality, effect in itertools.product(("draft", "standard"), ("off", "by need")):
        whole = []
        for family, (base, ranges) in FAMILIES.items():
            sample = {key: {"uniform": ends} for key, ends in ranges.items()}
            if effect == "off":
                sample["effects.interreflection"] = {"choice": ["off"]}
            spec = batches.load({"base": [base], "count": rows, "sample": sample, "output": {"directions": 4096, "quality": quality}})
            start = time.process_time()
            # Another name, because rows of one name share a scene and its keys.
            made = batches.evaluate(spec, f"{quality}, interreflection {effect}", list(range(rows)))
            seconds = (time.process_time() - start) / rows
            if any(row["state"] != "made" for row in made):
                sys.exit(next(row["error"] for row in made if row["state"] != "made"))
            whole.append(seconds)
            print(f"| {quality} | {effect} | {family} | {1e3 * seconds:.0f} | {1e6 * seconds / 3600:.0f} |", flush=True)
        print(f"| {quality} | {effect} | a third of each | {1e3 * sum(whole) / 3:.0f} | {1e6 * sum(whole) / 3 / 3600:.0f} |")
    print()
    print("| output | type | bytes of a million [GB] |")
    print("|---|---|---|")
    for name, output in (("4096 pairs", {"directions": 4096}), ("table 12 x 24", {"what": "table", "resolution": [12, 24]})):
        for dtype in ("float16", "float32"):
            spec = batches.load({"base": ["default"], "count": 1, "sample": {}, "output": {**output, "dtype": dtype}})
            print(f"| {name} | {dtype} | {1e-3 * spec.bytes_per_row():.1f} |")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["versions", wheel, *interpreters] if interpreters:
            versions(wheel, interpreters)
        case ["speed"]:
            speed()
        case ["batch", *rows]:
            batch(int(rows[0]) if rows else 400)
        case ["engine", *rows]:
            engine(int(rows[0]) if rows else 400)
        case ["cost", *rows]:
            cost(int(rows[0]) if rows else 50)
        case _:
            sys.exit(__doc__)
