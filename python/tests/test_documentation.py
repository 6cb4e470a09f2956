"""Every public name has a docstring, so that the API page (docs/guide/python.md) has no gaps."""

import importlib
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pdoc = pytest.importorskip("pdoc", reason="the API page is made by pdoc, which is not installed")
pytest.importorskip("dask", reason="biscale.batch needs dask")
pytest.importorskip("pyarrow", reason="biscale.batch needs pyarrow")

#: The modules of the API page.
MODULES = ["biscale", "biscale.batch", "biscale.dataset", "biscale.mitsuba"]


def undocumented(member):
    """Names of a module or class, and of what is in it, that have no docstring of their own."""
    found = [] if member.docstring.strip() else [member.fullname]
    if isinstance(member, (pdoc.doc.Module, pdoc.doc.Class)):
        for name, one in member.members.items():
            # Python itself documents `args` of exceptions.
            if not name.startswith("_") and name != "args" and not isinstance(one, pdoc.doc.Module):
                found += undocumented(one)
    return found


@pytest.mark.parametrize("name", MODULES)
def test_every_public_name_has_a_docstring(name):
    if name == "biscale.mitsuba":
        pytest.importorskip("mitsuba", reason="the plugin needs Mitsuba")
    gaps = undocumented(pdoc.doc.Module(importlib.import_module(name)))
    assert not gaps, f"without a docstring: {gaps}"


def test_the_page_has_the_types_of_the_stub(tmp_path):
    script = Path(__file__).resolve().parents[1] / "api_page.py"
    text = script.read_text(encoding="utf-8").replace(', "biscale.mitsuba"]', "]")
    copy = tmp_path / "python" / "api_page.py"
    (copy.parent / "biscale").mkdir(parents=True)
    copy.write_text(text, encoding="utf-8")
    shutil.copy(script.parent / "biscale" / "_core.pyi", copy.parent / "biscale")
    subprocess.run([sys.executable, "-W", "error", str(copy), str(tmp_path / "api")], check=True, cwd=tmp_path)
    page = re.sub("<[^>]+>", "", (tmp_path / "api" / "biscale.html").read_text(encoding="utf-8"))
    assert re.search(r"eval\(\s*self,\s*wi: numpy.typing.ArrayLike,\s*wo: numpy.typing.ArrayLike", page)


def test_a_missing_docstring_is_found(tmp_path, monkeypatch):
    text = '"""A module."""\n\n\ndef silent(): pass\n\n\nclass Told:\n    """Told."""\n\n    part = 1\n'
    (tmp_path / "with_gaps.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    module = pdoc.doc.Module(importlib.import_module("with_gaps"))
    assert undocumented(module) == ["with_gaps.silent", "with_gaps.Told.part"]
