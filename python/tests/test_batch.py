"""Batches: rows depend on their index alone, whatever is killed, repeated or split."""

import errno
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

import biscale as bs

pa = pytest.importorskip("pyarrow")
pytest.importorskip("distributed")

import pyarrow.parquet  # noqa: E402

from biscale import batch, dataset  # noqa: E402
from biscale.batch import __main__ as program  # noqa: E402

SPEC = {
    "base": ["default", "table3"],
    "count": 40,
    "seed": 7,
    "sample": {
        "tile.geometry.depth": {"log": [0.02, 0.4]},
        "material.default.brdf.roughness": {"uniform": [0.1, 0.6]},
    },
    "output": {"directions": 64, "quality": "draft", "rows_per_file": 6},
}
TOML = """
base = ["default", "table3"]
count = 40
seed = 7
[sample]
"tile.geometry.depth" = { log = [0.02, 0.4] }
"material.default.brdf.roughness" = { uniform = [0.1, 0.6] }
[output]
directions = 64
quality = "draft"
rows_per_file = 6
"""


def rows(directory):
    """Index, key, base, parameters and values of all rows."""
    table = dataset.open(directory).table().drop_columns(["milliseconds"])
    return table.sort_by("index").to_pydict()


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The data set of SPEC, made in one go."""
    folder = tmp_path_factory.mktemp("whole")
    result = batch.run(SPEC, folder, shard=(1, 1), progress=False)
    assert (result.made, result.failed, result.kept) == (40, 0, 0)
    return folder


def test_values_are_those_of_eval_rounded(whole):
    data = dataset.open(whole)
    assert len(data) == 40
    for index in random.Random(3).sample(range(40), 10):
        row = data[index]
        scene = bs.Scene(row["base"])
        for key in SPEC["sample"]:
            scene[key] = row[key]
        expected = scene.effective(quality="draft", backend="cpu", seed=7).eval(data.wi, data.wo)
        assert row["index"] == index and row["values"].shape == (64, 3)
        np.testing.assert_array_equal(row["values"], expected.astype(np.float16))
    errors = [error for error in data.table(["relative_error"]).column(0).to_pylist() if error is not None]
    assert len(errors) == 1 and 0 < errors[0] < 0.2


def test_a_second_run_keeps_everything_and_another_specification_is_refused(whole):
    stamps = {path: path.stat().st_mtime_ns for path in whole.glob("part-*")}
    result = batch.run(SPEC, whole, shard=(1, 1), progress=False)
    assert (result.made, result.kept) == (0, 40)
    assert stamps == {path: path.stat().st_mtime_ns for path in whole.glob("part-*")}
    with pytest.raises(bs.InputError, match="another specification"):
        batch.run({**SPEC, "seed": 8}, whole, shard=(1, 1), progress=False)


#: Makes one of four shards in files of two rows, and ends by SIGKILL some time after the work began.
KILLED = """
import os, signal, sys, threading
from biscale import batch
threading.Timer(float(sys.argv[3]), os.kill, (os.getpid(), signal.SIGKILL)).start()
batch.run(sys.argv[1], sys.argv[2], shard=(2, 4), progress=False)
"""


def test_shards_in_any_order_some_twice_and_one_killed_ten_times_make_the_same_rows(whole, tmp_path):
    spec = tmp_path / "spec.toml"
    spec.write_text(TOML.replace("rows_per_file = 6", "rows_per_file = 2"))
    folder = tmp_path / "made"
    moments = random.Random(5)
    order = [1, 2, 3, 4, *moments.sample([1, 2, 3, 4], 2)]
    moments.shuffle(order)
    for shard in order:
        if shard == 2:
            for _ in range(10):
                moment = str(moments.uniform(0.0, 0.3))
                killed = subprocess.run([sys.executable, "-c", KILLED, spec, folder, moment], capture_output=True)
                assert killed.returncode == -signal.SIGKILL
                for path in folder.glob("part-*.parquet"):
                    assert pyarrow.parquet.read_table(path).num_rows == 2
        batch.run(spec, folder, shard=(shard, 4), progress=False)
    assert rows(folder) == rows(whole)


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs permissions of POSIX")
def test_a_folder_that_cannot_be_written_ends_with_code_1_and_keeps_what_is_there():
    # Root obeys permissions without a capability that `setpriv` removes.
    prefix = []
    if os.getuid() == 0:
        prefix = ["setpriv", "--bounding-set", "-dac_override,-dac_read_search", "--inh-caps", "-all"]
        if shutil.which("setpriv") is None or subprocess.run([*prefix, "true"], capture_output=True).returncode != 0:
            pytest.skip("root ignores permissions, and setpriv cannot remove its capability")
    with tempfile.TemporaryDirectory() as place:
        spec, folder = Path(place) / "spec.toml", Path(place) / "made"
        spec.write_text(TOML)
        batch.run(spec, folder, shard=(1, 1), progress=False, limit=12)
        before = {path: path.read_bytes() for path in folder.iterdir()}
        command = [sys.executable, "-m", "biscale.batch", "run", spec, "--shard", "1/1", "-o"]
        os.chmod(folder, 0o555)
        done = subprocess.run([*prefix, *command, folder], capture_output=True, text=True)
        assert done.returncode == 1, done.stderr
        assert "cannot be written" in done.stderr and str(folder) in done.stderr
        os.chmod(folder, 0o755)
        assert before == {path: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.filterwarnings("ignore")
def test_dask_workers_that_are_killed_lose_no_row(whole, tmp_path):
    from distributed import Client, LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster, Client(cluster) as client:
        killed = []

        def kill(done, total):
            if done >= 8 and not killed:
                process = next(iter(client.run(lambda: __import__("os").getpid()).values()))
                killed.append(process)
                __import__("os").kill(process, signal.SIGKILL)

        result = batch.run(SPEC, tmp_path, client, progress=kill)
    assert killed and (result.made, result.failed) == (40, 0)
    assert rows(tmp_path) == rows(whole)


def test_bad_rows_are_counted_and_the_rest_is_made(tmp_path):
    table = tmp_path / "rows.csv"
    depths = [0.05 * (k + 1) if k % 5 else -1.0 for k in range(20)]
    table.write_text("base,tile.geometry.depth\n" + "".join(f"default,{depth}\n" for depth in depths))
    spec = {"table": str(table), "output": {"directions": 16, "quality": "draft"}}
    result = batch.run(spec, tmp_path / "made", shard=(1, 1), progress=False)
    assert (result.made, result.failed) == (16, 4) and len(result.complaints) == 1
    state = batch.status(tmp_path / "made")
    assert (state["made"], state["failed"], state["remaining"]) == (16, 4, 0)
    failed = [json.loads(line) for line in (tmp_path / "made" / "failed.ndjson").read_text().splitlines()]
    assert [row["index"] for row in failed] == [0, 5, 10, 15] and "tile.geometry.depth" in failed[0]["error"]
    assert "failed" in (tmp_path / "made" / "index.html").read_text()
    assert batch.run(spec, tmp_path / "made", shard=(1, 1), progress=False).kept == 20
    assert batch.run(spec, tmp_path / "made", shard=(1, 1), progress=False, retry_failed=True).failed == 4


def test_a_grid_holds_every_combination_and_several_outputs(tmp_path):
    spec = {
        "base": "default",
        "grid": True,
        "sample": {
            "tile.geometry.depth": {"uniform": [0.1, 0.3], "steps": 3},
            "material.default.brdf.roughness": {"choice": [0.2, 0.4]},
        },
        "output": {"what": ["table", "image", "fit"], "resolution": [2, 4], "size": [8, 6], "quality": "draft", "dtype": "float32"},
    }
    batch.run(spec, tmp_path, shard=(1, 1), progress=False, limit=2)
    row = dataset.open(tmp_path)[1]
    assert row["table"].shape == (2, 4, 2, 4, 3) and row["image"].shape == (6, 8, 3) and json.loads(row["fit"])
    checked = batch.load(spec)
    combinations = {tuple(checked.row(index)[1].values()) for index in range(checked.count)}
    assert {(round(depth, 9), roughness) for depth, roughness in combinations} == {
        (depth, roughness) for depth in (0.1, 0.2, 0.3) for roughness in (0.2, 0.4)
    }


def test_a_row_does_not_depend_on_the_number_of_rows():
    few, many = batch.load(SPEC), batch.load({**SPEC, "count": 100_000})
    assert [few.row(index) for index in range(40)] == [many.row(index) for index in range(40)]
    draws = [many.row(index)[1]["tile.geometry.depth"] for index in range(2000)]
    assert min(draws) >= 0.02 and max(draws) <= 0.4
    assert abs(np.mean(np.log(draws)) - np.log(0.02 * 0.4) / 2) < 0.1


def sampled(value):
    return {**SPEC, "sample": {"tile.geometry.depth": value}}


@pytest.mark.parametrize(
    "spec, field",
    [
        (sampled({"gamma": [1, 2]}), "sample.tile.geometry.depth"),
        (sampled({"uniform": [0.4, 0.2]}), "sample.tile.geometry.depth.uniform"),
        (sampled({"uniform": [-5.0, 0.2]}), "sample.tile.geometry.depth"),
        ({**SPEC, "sample": {"tile.geometry.dept": {"uniform": [0.1, 0.2]}}}, "sample.tile.geometry.dept"),
        ({**SPEC, "count": 0}, "count"),
        ({**SPEC, "count": 10**9 + 1}, "count"),
        ({**SPEC, "cuont": 1}, "cuont"),
        ({**SPEC, "output": {"what": "lobes"}}, "output.what"),
        ({**SPEC, "output": {"dtype": "float8"}}, "output.dtype"),
        ({"base": "default", "grid": True, "sample": {"tile.geometry.depth": {"uniform": [0.1, 0.2], "steps": 10**9}}}, "grid"),
    ],
)
def test_bad_specifications_are_refused_before_anything_runs(spec, field, tmp_path):
    with pytest.raises(bs.InputError) as raised:
        batch.run(spec, tmp_path / "made", shard=(1, 1), progress=False)
    assert raised.value.field == field and raised.value.found and raised.value.expected
    assert not (tmp_path / "made").exists()


def test_the_command_states_its_exit_codes(tmp_path, capsys, monkeypatch):
    spec = tmp_path / "spec.toml"
    spec.write_text(TOML)
    run = ["run", str(spec), "-o", str(tmp_path / "made"), "--limit", "7"]
    assert program.main([*run, "--shard", "3/2"]) == 2
    assert "shard" in capsys.readouterr().err
    assert program.main([*run, "--shard", "1/2", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["made"] == 6
    assert program.main(["status", str(tmp_path / "made")]) == 0
    assert program.main(["status", str(tmp_path)]) == 2
    # A full disk.
    def full(*arguments):
        raise OSError(errno.ENOSPC, "No space left on device", "part")

    monkeypatch.setattr(batch, "write_part", full)
    assert program.main([*run, "--shard", "2/2"]) == 1
    assert "free some space" in capsys.readouterr().err
    monkeypatch.undo()
    assert program.main([*run, "--shard", "2/2"]) == 0
    assert batch.status(tmp_path / "made")["made"] == 7


def test_a_data_set_that_does_not_fit_the_disk_is_refused(tmp_path):
    spec = {**SPEC, "count": 10**9, "output": {"what": "image", "size": [4096, 4096]}}
    with pytest.raises(bs.InputError, match="free"):
        batch._check_space(batch.load(spec), tmp_path, [0, 1, 2] * 10**6, False, False)


def test_values_beyond_float16_ask_for_float32(tmp_path):
    pairs = tmp_path / "pairs.csv"
    pairs.write_text("theta_i,phi_i,theta_o,phi_o\n0.1,0,0.1,3.141592653589793\n")
    spec = {
        "base": "default",
        "count": 1,
        "sample": {
            "tile.geometry": {"choice": [{"kind": "flat"}]},
            "material.default.color": {"choice": [[1e3, 1e3, 1e3]]},
            "material.default.brdf": {"choice": [{"kind": "cook_torrance", "roughness": 0.01, "f0": [1, 1, 1]}]},
        },
        "output": {"pairs": str(pairs), "quality": "draft"},
    }
    result = batch.run(spec, tmp_path / "made", shard=(1, 1), progress=False)
    assert result.failed == 1 and "float32" in next(iter(result.complaints))
    spec["output"]["dtype"] = "float32"
    assert batch.run(spec, tmp_path / "wide", shard=(1, 1), progress=False).made == 1
