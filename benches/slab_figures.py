"""Figures of docs/slabs.md that need no truth of their own: errors over angle and roughness, from the table on the page.

    python benches/slab_figures.py

It reads the rows that `cargo bench --bench measure -- slabs` wrote, and writes docs/slabs/error_*.svg.
"""

from color_map_figures import ROOT, plot

OUT = ROOT / "docs/slabs"
ANGLES = [0, 30, 45, 60, 75]
FACES = ["Beckmann 0.1/0.1", "Beckmann 0.2/0.2", "Beckmann 0.4/0.4", "Beckmann 0.1/0.3"]


def rows():
    """Errors by the names of the faces: lists over the angles, by column."""
    page = (ROOT / "docs/slabs.md").read_text().split("<!-- measure: slabs -->")[1].split("<!-- end -->")[0]
    cells = [[cell.strip() for cell in line.strip("|\n ").split("|")] for line in page.splitlines() if line.startswith("| ")]
    table = [row for row in cells if row[0] in FACES]
    return {row[0]: [[float(value) for value in cell.split()] for cell in row[1:6]] for row in table}


def main():
    OUT.mkdir(exist_ok=True)
    table = rows()
    for name, column, title in [("dual", 0, "Eq. 11, light that passes once"), ("faces", 1, "64 facets, light that passes once"),
                                ("all", 4, "64 facets and inner reflections, all light")]:
        lines = [(faces, list(zip(ANGLES, table[faces][column]))) for faces in FACES]
        plot(OUT / f"error_{name}.svg", title, "angle of the light [degrees]", "relative L2 [%]", lines)


if __name__ == "__main__":
    main()
