"""Each notebook runs whole, as a script and as a notebook."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "notebooks"
#: What a notebook imports beside biscale and NumPy.
NEEDS = {
    "1_lobe_and_sliders": ["matplotlib"],
    "2_sphere_in_mitsuba": ["matplotlib", "mitsuba"],
    "3_thousand_materials": ["matplotlib", "dask", "pyarrow"],
    "4_how_good_is_this_number": ["matplotlib"],
}


def skip_without(*packages):
    missing = [package for package in packages if find_spec(package) is None]
    if missing:
        pytest.skip("not installed: " + ", ".join(missing))


def run(*command, folder):
    # Few rows and small pictures: the test is about whether the notebooks run.
    environment = {**os.environ, "MPLBACKEND": "Agg", "BISCALE_NOTEBOOK_ROWS": "60"}
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600, env=environment)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]


def test_the_list_of_notebooks_is_complete():
    assert sorted(NEEDS) == sorted(path.stem for path in FOLDER.glob("*.py"))


@pytest.mark.parametrize("name", NEEDS)
def test_a_notebook_runs_as_a_script(name, tmp_path):
    skip_without(*NEEDS[name])
    run(sys.executable, "-W", "error::DeprecationWarning:__main__", str(FOLDER / f"{name}.py"), folder=tmp_path)


@pytest.mark.parametrize("name", NEEDS)
def test_a_notebook_runs_in_jupyter_and_makes_pictures(name, tmp_path, monkeypatch):
    skip_without("jupytext", "nbconvert", "ipykernel", *NEEDS[name])
    import jupytext
    import nbformat
    from nbconvert.preprocessors import ExecutePreprocessor

    notebook = jupytext.read(FOLDER / f"{name}.py")
    monkeypatch.setenv("BISCALE_NOTEBOOK_ROWS", "60")
    monkeypatch.delenv("MPLBACKEND", raising=False)
    ExecutePreprocessor(timeout=600, kernel_name="python3").preprocess(notebook, {"metadata": {"path": str(tmp_path)}})
    pictures = [output for cell in notebook.cells for output in cell.get("outputs", []) if "image/png" in output.get("data", {})]
    assert pictures
    nbformat.validate(notebook)
