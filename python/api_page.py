"""Makes the API page from docstrings and type stubs: python python/api_page.py [FOLDER]."""

import re
import sys
import tempfile
from pathlib import Path

import pdoc
import pdoc.doc_pyi

#: The modules of the page.
MODULES = ["biscale", "biscale.batch", "biscale.dataset", "biscale.mitsuba"]
STUB = Path(__file__).parent / "biscale" / "_core.pyi"


def with_short_types(text):
    """The text of the stub, with arrays that print as such and not as the unions that NumPy spells them out to."""
    text = text.replace("import ArrayLike, NDArray", "import NDArray")
    array_like = "class ArrayLike:\n    __module__ = 'numpy.typing'\n"
    return re.sub(r"^_Floats: TypeAlias = .*$", f"{array_like}\n_Floats: TypeAlias = np.ndarray", text, flags=re.M)


def read_stub(folder):
    """Lets pdoc read the types of `biscale` from the stub of its compiled part, which defines its classes."""
    of_module, stub = pdoc.doc_pyi.find_stub_file, Path(folder) / "biscale.pyi"
    stub.write_text(with_short_types(STUB.read_text(encoding="utf-8")), encoding="utf-8")
    pdoc.doc_pyi.find_stub_file = lambda name: stub if name == "biscale" else of_module(name)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        read_stub(folder)
        pdoc.pdoc(*MODULES, output_directory=Path(sys.argv[1] if len(sys.argv) > 1 else "api"))
