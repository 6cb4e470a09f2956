"""Threads, processes, signals, memory, and the command line of the package."""

import multiprocessing
import os
import pickle
import resource
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import biscale as bs
from conftest import command, pairs

WI, WO = pairs(300)
#: A computation of some seconds.
LONG = {"quality": "fine", "backend": "cpu", "effects": {"interreflection": "on"}}


def long_scene():
    scene = bs.Scene("fig6a_velvet_spread")
    scene["quality.facets"] = 1 << 17
    return scene


def values_of(scene):
    return scene.effective(quality="draft", backend="cpu").eval(WI, WO)


@pytest.mark.parametrize("method", [name for name in ["fork", "spawn"] if name in multiprocessing.get_all_start_methods()])
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_scene_computes_the_same_in_another_process(method):
    scene = bs.Scene("fig8a_hammered")
    expected = values_of(scene)
    with multiprocessing.get_context(method).Pool(2) as pool:
        results = pool.map_async(values_of, [scene, scene]).get(timeout=100)
    for values in results:
        np.testing.assert_array_equal(values, expected)


def test_threads_share_a_scene():
    scene = bs.Scene("table4_cup")
    expected = values_of(scene)
    with ThreadPoolExecutor(6) as pool:
        for values in pool.map(values_of, [scene] * 12):
            np.testing.assert_array_equal(values, expected)


def test_other_threads_run_during_a_computation():
    ticks, stop = [], threading.Event()

    def tick():
        while not stop.wait(0.005):
            ticks.append(time.perf_counter())

    thread = threading.Thread(target=tick)
    thread.start()
    begin = time.perf_counter()
    with pytest.raises(bs.Cancelled):
        long_scene().effective(**LONG, progress=lambda part: time.perf_counter() - begin < 0.6)
    stop.set()
    thread.join()
    assert len(ticks) > 10


def test_a_progress_function_gets_the_part_and_can_cancel_or_raise():
    parts = []
    with pytest.raises(bs.Cancelled):
        long_scene().effective(**LONG, progress=lambda part: parts.append(part) or len(parts) < 5)
    assert len(parts) == 5 and all(0 <= part <= 1 for part in parts)

    def fail(part):
        raise KeyError("mine")

    with pytest.raises(KeyError):
        long_scene().effective(**LONG, progress=fail)


def test_a_progress_function_that_computes_raises_instead_of_waiting_for_itself():
    with pytest.raises(RuntimeError, match="cannot start a computation"):
        long_scene().effective(**LONG, progress=lambda part: bs.Scene("default").effective(quality="draft"))
    assert bs.Scene("default").effective(quality="draft").form


@pytest.mark.skipif(os.name == "nt", reason="sends SIGINT")
def test_ctrl_c_stops_a_computation():
    program = """
import signal, os
import test_processes as t
# A shell's background jobs ignore the signal.
signal.signal(signal.SIGINT, signal.default_int_handler)
parts = []
def interrupt(part):
    parts.append(part)
    if len(parts) == 2:
        os.kill(os.getpid(), signal.SIGINT)
try:
    t.long_scene().effective(**t.LONG, progress=interrupt)
except KeyboardInterrupt:
    print(len(parts))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=os.path.dirname(__file__), timeout=60)
    assert done.returncode == 0, done.stderr
    # The next look at signals ends it, however far it is.
    assert int(done.stdout) in (2, 3)


def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="needs /proc")
def test_evaluations_and_edits_leak_no_memory():
    scene = bs.Scene("default")
    scene["quality.facets"] = 256

    def work(evaluations, edits):
        for k in range(edits):
            scene["material.default.brdf.roughness"] = 0.2 + 0.0001 * (k % 1000)
            brdf = scene.effective(quality="draft", backend="cpu")
        for _ in range(evaluations):
            brdf.eval(WI[:20], WO[:20])
        with pytest.raises(bs.InputError):
            scene["nothing"] = 1

    work(1000, 100)
    before = resident()
    work(10_000, 1000)
    assert resident() - before < 5 << 20


def test_a_pickle_of_an_error_keeps_its_fields():
    error = bs.InputError("text", file="a.toml", field="b", found="c", expected="d", hint="e")
    again = pickle.loads(pickle.dumps(error))
    assert vars(again) == vars(error)


def test_the_package_carries_the_command(tmp_path):
    module = [sys.executable, "-m", "biscale"]
    run = lambda *arguments: subprocess.run([*module, *arguments], capture_output=True, text=True, timeout=120)  # noqa: E731
    assert "fig4b_bicolor_cup" in run("materials").stdout
    assert run("--version").stdout.strip() == f"biscale {bs.__version__}"
    refused = run("render", "no_such_scene", "-o", str(tmp_path / "a.png"))
    assert refused.returncode == 2 and "no shipped scene" in refused.stderr
    edit = run("edit", "default")
    assert edit.returncode == 1 and "without the editor" in edit.stderr


def test_a_scene_comes_from_standard_input(tmp_path):
    scene = bs.Scene("fig4b_bicolor_cup")
    pairs_file = tmp_path / "pairs.csv"
    pairs_file.write_text("theta_i,phi_i,theta_o,phi_o\n0.1,0.2,0.3,0.4\n")
    arguments = ["--pairs", pairs_file, "-o", "-", "--quality", "draft", "--backend", "cpu"]
    named = command("eval", "fig4b_bicolor_cup", *arguments)
    piped = command("eval", "-", *arguments, text=scene.to_toml())
    assert (piped.returncode, piped.stdout) == (0, named.stdout), piped.stderr
    bad = command("eval", "-", *arguments, text="[tile]\ngeometry = 3\n")
    assert bad.returncode == 2 and "standard input: line 2" in bad.stderr
    both = command("eval", "-", "--pairs", "-", "-o", "-", text=scene.to_toml())
    assert both.returncode == 2 and "--pairs" in both.stderr


def test_the_package_is_imported_quickly():
    code = "import time, numpy; t = time.perf_counter(); import biscale; print(time.perf_counter() - t)"
    times = [float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout) for _ in range(3)]
    # 0.15 s on an idle machine; tests run on busy ones.
    assert min(times) < 0.6


if hasattr(signal, "SIGKILL") and hasattr(os, "fork"):

    @pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
    def test_a_fork_during_a_computation_leaves_a_child_that_computes():
        scene = bs.Scene("default")
        expected = values_of(scene)
        stop = threading.Event()
        other = bs.Scene("table4_cup").effective(quality="draft", backend="cpu")

        def load():
            while not stop.is_set():
                other.eval(WI, WO)

        thread = threading.Thread(target=load)
        thread.start()
        child = os.fork()
        if child == 0:
            same = np.array_equal(values_of(bs.Scene("default")), expected)
            os._exit(0 if same else 3)
        deadline = time.monotonic() + 60
        status = (0, 0)
        while status[0] == 0 and time.monotonic() < deadline:
            status = os.waitpid(child, os.WNOHANG)
            time.sleep(0.02)
        if status[0] == 0:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
        stop.set()
        thread.join()
        assert status == (child, 0)
