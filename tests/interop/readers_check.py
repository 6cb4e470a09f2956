"""Exported files in other programs and packages: tables in numpy and OpenEXR, glTF in the Khronos validator, MaterialX in its
library, files of the tile in trimesh, Pillow and pypdf. Layouts without a published package (RGL as in pbrt-v4 and brdf-loader,
UTIA, ASTM) are read by Python code of these checks.

    python tests/interop/readers_check.py [SCENE]

`pip install numpy openexr materialx pygltflib trimesh scipy pypdf pillow`; `npm install gltf-validator` in a folder that
GLTF_VALIDATOR names. A check whose package is missing prints SKIPPED.
"""

import importlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as xml
from pathlib import Path

# `common` is imported first because it skips the check if numpy is missing.
from common import Table, biscale, direction, evaluate, export, mean_error, random_pairs

import numpy as np

from rgl_reader import Rgl

SCENE = sys.argv[1] if len(sys.argv) > 1 else "fig5a_isotropic"
TILE, SCALE = "fig5a_isotropic", 40


def package(name):
    """Returns a package; prints SKIPPED and returns None if it is missing."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        print(f"SKIPPED: {name} ({error})")


def nodes_of(angles, folder):
    """Returns the BRDF at rows of `theta_i, phi_i, theta_o, phi_o`."""
    return evaluate(SCENE, angles, folder) / np.cos(angles[:, :1])


def some(rows, count=1500):
    return np.random.default_rng(3).permutation(len(rows))[:count]


def grid_rows(theta_i, phi_i, theta_o, phi_o):
    return np.stack([axis.ravel() for axis in np.meshgrid(theta_i, phi_i, theta_o, phi_o, indexing="ij")], 1).astype(float)


def timed(read):
    start = time.time()
    value = read()
    return value, f"{time.time() - start:.2f}"


def check_tables(table, folder):
    """Compares the values of each file at some of its nodes, or interpolated as its format says, with `eval`."""
    def row(name, reader, report, seconds, found, expected, limit):
        error = mean_error(found, expected)
        table.check(error < limit, name, reader, seconds, f"{100 * error:.3f} %", f"{100 * limit:g} %", report["bytes"])

    report, _ = export(SCENE, folder / "a.npz", "--resolution", "6x12")
    npz, seconds = timed(lambda: dict(np.load(folder / "a.npz")))
    rows = grid_rows(*(npz[k] for k in ["theta_i", "phi_i", "theta_o", "phi_o"]))
    pick = some(rows)
    expected = nodes_of(rows[pick], folder)
    row(".npz", "numpy.load", report, seconds, npz["brdf"].reshape(-1, 3)[pick], expected, 1e-4)

    report, _ = export(SCENE, folder / "a.csv", "--resolution", "6x12")
    values, seconds = timed(lambda: np.loadtxt(described(folder / "a.csv"), delimiter=",", skiprows=1))
    row(".csv", "numpy.loadtxt", report, seconds, values[pick, 4:7], expected, 1e-4)

    report, _ = export(SCENE, folder / "a.astm", "--resolution", "6x12")
    (names, values), seconds = timed(lambda: read_astm(folder / "a.astm"))
    assert names == ["theta_i", "phi_i", "theta_s", "phi_s", "R", "G", "B"], names
    assert np.allclose(values[:, :4], rows, atol=1e-6)
    row(".astm", "a reader here (E1392)", report, seconds, values[pick, 4:], expected, 1e-4)

    openexr = package("OpenEXR")
    if openexr:
        report, _ = export(SCENE, folder / "a.exr", "--resolution", "6x12")
        file, seconds = timed(lambda: openexr.File(str(folder / "a.exr")))
        said = json.loads(file.parts[0].header["comments"])
        part = file.parts[0].channels
        pixels = part["RGB"].pixels if "RGB" in part else np.stack([part[c].pixels for c in "RGB"], -1)
        pi, po, to = len(said["phi_i"]), len(said["phi_o"]), len(said["theta_o"])
        atlas = pixels.reshape(-1, to, pi, po, 3).transpose(0, 2, 1, 3, 4)
        row(".exr", f"OpenEXR {openexr.__version__}", report, seconds, atlas.reshape(-1, 3)[pick], expected, 1e-4)

    report, _ = export(SCENE, folder / "a.bin")
    utia, seconds = timed(lambda: np.fromfile(folder / "a.bin", "<f8").reshape(3, 6, 48, 6, 48))
    rows = grid_rows(*2 * (np.radians(np.arange(6) * 15.0), np.radians(np.arange(48) * 7.5)))
    pick = some(rows)
    row(".bin", "a reader here (UTIA)", report, seconds, utia.reshape(3, -1).T[pick], nodes_of(rows[pick], folder), 1e-4)

    pairs = random_pairs(1000)
    i, o = direction(pairs[:, 0], pairs[:, 1]), direction(pairs[:, 2], pairs[:, 3])
    report, _ = export(SCENE, folder / "a.bsdf")
    rgl, seconds = timed(lambda: Rgl(folder / "a.bsdf"))
    row(".bsdf", "a reader here (RGL)", report, seconds, rgl(o, i), evaluate(SCENE, pairs, folder), 0.01)


def described(path):
    """Returns the lines of a table without its comments."""
    return [line for line in open(path, encoding="utf-8") if not line.startswith("#")]


def read_astm(path):
    names, rows = None, []
    for line in open(path, encoding="utf-8"):
        if names is not None:
            rows.append([float(word) for word in line.split(",")])
        elif line.startswith("NUM_POINTS"):
            count = int(line.split()[1])
        elif line.startswith("VARS"):
            names = line.split(None, 1)[1].strip().split(",")
    assert len(rows) == count
    return names, np.array(rows)


def check_fits(table, folder):
    """Writes the fits of a metal, a diffuse and a coloured scene."""
    for scene in ["default", "fig1e_lambertian", "fig7a_shot_silk"]:
        gltf, mtlx = folder / f"{scene}.gltf", folder / f"{scene}.mtlx"
        biscale("fit", scene, "-o", gltf, "-o", mtlx, "--quality", "draft", "--quiet")
        check_gltf(table, scene, gltf)
        check_materialx(table, scene, mtlx)


VALIDATE = """const v = require(process.argv[2]), fs = require('fs');
v.validateBytes(new Uint8Array(fs.readFileSync(process.argv[3]))).then(r => console.log(JSON.stringify({...r.issues, version: v.version()})));"""


def check_gltf(table, scene, path):
    pygltflib = package("pygltflib")
    if pygltflib:
        (material,), seconds = timed(lambda: pygltflib.GLTF2().load(str(path)).materials)
        table.check(material.name == scene, f"{scene}.gltf", "pygltflib", seconds, "", "", path.stat().st_size)
    module = Path(os.environ.get("GLTF_VALIDATOR", "/nonexistent")) / "node_modules/gltf-validator"
    if not module.exists() or not shutil.which("node"):
        print("SKIPPED: the Khronos validator (node, and GLTF_VALIDATOR that names where npm put gltf-validator)")
        return
    run, seconds = timed(lambda: subprocess.run(["node", "-e", VALIDATE, "-", module, path], check=True, capture_output=True, text=True))
    said = json.loads(run.stdout)
    clean = said["numErrors"] == said["numWarnings"] == 0
    if not clean:
        print(said["messages"])
    table.check(clean, f"{scene}.gltf", f"Khronos {said['version']}", seconds, f"{said['numErrors']} errors", "0", path.stat().st_size)


def check_materialx(table, scene, path):
    """Checks that a document is valid against the standard libraries and that its material compiles to a shader."""
    mx = package("MaterialX")
    if not mx:
        return
    import MaterialX.PyMaterialXGenGlsl as glsl
    import MaterialX.PyMaterialXGenShader as shader

    def read():
        folders, library, document = mx.getDefaultDataSearchPath(), mx.createDocument(), mx.createDocument()
        mx.loadLibraries(mx.getDefaultDataLibraryFolders(), folders, library)
        mx.readFromXmlFile(document, str(path))
        document.importLibrary(library)
        valid, complaint = document.validate()
        generator = glsl.GlslShaderGenerator.create()
        context = shader.GenContext(generator)
        context.registerSourceCodeSearchPath(folders)
        (material,) = shader.findRenderableElements(document)
        code = generator.generate(material.getName(), material, context).getSourceCode(shader.PIXEL_STAGE)
        return valid, complaint, len(code)

    (valid, complaint, length), seconds = timed(read)
    if complaint:
        print(complaint)
    table.check(valid and length > 1000, f"{scene}.mtlx", f"MaterialX {mx.__version__}", seconds, "valid, a shader", "", path.stat().st_size)


def check_tile(table, folder):
    """Checks that the solid is closed and that mesh, heights and pattern have their stated size."""
    for ending in ["obj", "stl", "png", "svg", "pdf"]:
        scale = [] if ending in ("obj", "png") else ["--scale", SCALE]
        biscale("tile", TILE, "-o", folder / f"tile.{ending}", "--samples", "128x128", "--quiet", *scale)
    size = {ending: (folder / f"tile.{ending}").stat().st_size for ending in ["obj", "stl", "png", "svg", "pdf"]}
    pillow, trimesh, pypdf = package("PIL.Image"), package("trimesh"), package("pypdf")
    heights = None
    if pillow:
        image, seconds = timed(lambda: np.array(pillow.open(folder / "tile.png")))
        heights = image / 65535.0
        table.check(image.dtype == np.uint16 and image.max() == 65535 and image.min() == 0, "tile.png", "Pillow", seconds, "16 bits", "", size["png"])
    if trimesh:
        mesh, seconds = timed(lambda: trimesh.load(folder / "tile.obj", force="mesh", process=False))
        (ax, ay), (bx, by) = ((mesh.triangles[:, k, :2] - mesh.triangles[:, 0, :2]).T for k in (1, 2))
        flat = np.abs(ax * by - ay * bx).sum() / 2
        error = abs(flat - 1)
        table.check(error < 1e-4, "tile.obj", f"trimesh {trimesh.__version__}", seconds, f"{100 * error:.3f} % of the base", "0.01 %", size["obj"])
        solid, seconds = timed(lambda: trimesh.load(folder / "tile.stl"))
        extent = np.ptp(solid.bounds, axis=0)[:2]
        closed = solid.is_watertight and solid.is_winding_consistent and np.allclose(extent, SCALE, atol=1e-3)
        relief = mesh.bounds[1, 2] - mesh.bounds[0, 2]
        # The base is a tenth of the side. The mean height is above it.
        expected = SCALE**3 * (0.1 + (0.5 * relief if heights is None else relief * heights.mean()))
        error = abs(solid.volume / expected - 1)
        table.check(closed and error < 0.02, "tile.stl", "trimesh, watertight", seconds, f"{100 * error:.2f} % of the volume", "2 %", size["stl"])
    svg, seconds = timed(lambda: xml.parse(folder / "tile.svg").getroot())
    box = [float(word) for word in svg.attrib["viewBox"].split()]
    true = svg.attrib["width"] == f"{box[2]:.3f}mm" and svg.attrib["height"] == f"{box[3]:.3f}mm"
    floor = max((float(p.split(",")[0]) for polygon in svg.iter("{http://www.w3.org/2000/svg}polygon") if polygon.attrib["fill"] != "none" for p in polygon.attrib["points"].split()[:4]), default=0)
    table.check(true and floor >= SCALE - 1e-3, "tile.svg", "xml, true scale", seconds, f"{box[2]:.1f} x {box[3]:.1f} mm", "", size["svg"])
    if pypdf:
        page, seconds = timed(lambda: pypdf.PdfReader(folder / "tile.pdf", strict=True).pages[0])
        width = float(page.mediabox.width) * 25.4 / 72
        said = "cut" in page.extract_text()
        table.check(said and abs(width - box[2]) < 0.01, "tile.pdf", f"pypdf {pypdf.__version__}, strict", seconds, f"{abs(width - box[2]):.4f} mm from the SVG", "", size["pdf"])


def main():
    table = Table("file", "reader                ", "loaded [s]", "error                 ", "allowed", "bytes")
    with tempfile.TemporaryDirectory() as folder:
        check_tables(table, Path(folder))
        check_fits(table, Path(folder))
        check_tile(table, Path(folder))
    table.finish()


if __name__ == "__main__":
    main()
