"""Figures of docs/color_maps.md: comparisons of the naive map, the truth and the filter, plots, and frames of a zoom.

    python benches/color_map_figures.py [NAME ...]

Without names it makes all figures: comparisons, heights, footprints, zoom. It takes minutes, most of them for the truth, and needs
ImageMagick's `montage`. It writes to docs/color_maps/ and docs/color_maps_zoom.png, and the errors of the comparisons to
docs/measurements/color_maps.md.
"""

import csv
import io
import json
import math
import os
import random
import struct
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BISCALE = os.environ.get("BISCALE", ROOT / "target/release/biscale")
OUT = ROOT / "docs/color_maps"
PAGE = ROOT / "docs/measurements/color_maps.md"
COMPARED = ["fig1a_noise", "fig1b_heights", "fig1c_slopes", "fig5_structures", "fig6_non_normal", "fig8a_bear_heights",
            "fig8b_bear_slopes", "fig9_slopes", "fig10_snake", "fig11_scales"]
COLORS = ["#c0392b", "#2471a3", "#1e8449", "#7d3c98"]


def biscale(*arguments):
    subprocess.run([BISCALE, *map(str, arguments), "--no-cache", "--quiet"], check=True)


def query(scene, header, rows, *options):
    """Returns the rows of `biscale filter` as dictionaries of numbers."""
    with tempfile.TemporaryDirectory() as folder:
        queries, output = Path(folder, "q.csv"), Path(folder, "out.csv")
        queries.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")
        biscale("filter", scene, "--queries", queries, "-o", output, *options)
        return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(io.StringIO(output.read_text()))]


def plot(path, title, x_label, y_label, lines, points=(), log=False, legend=(72, 40)):
    """Writes an SVG plot. `lines` and `points` are lists of (label, [(x, y)])."""
    width, height, left, bottom = 560, 340, 60, 46
    every = [p for _, data in [*lines, *points] for p in data]
    scale = math.log10 if log else float
    low, high = min(scale(x) for x, _ in every), max(scale(x) for x, _ in every)
    top = 1.08 * max(y for _, y in every)

    def at(x, y):
        return (left + (scale(x) - low) / (high - low) * (width - left - 16), height - bottom - y / top * (height - bottom - 30))

    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" font-family="sans-serif" font-size="12">',
             f'<rect width="{width}" height="{height}" fill="white"/><text x="{left}" y="18">{title}</text>']
    for k in range(5):
        y = top * k / 4.0
        (x0, py), (x1, _) = at(10**low if log else low, y), at(10**high if log else high, y)
        parts.append(f'<line x1="{x0:.1f}" y1="{py:.1f}" x2="{x1:.1f}" y2="{py:.1f}" stroke="#ddd"/>'
                     f'<text x="{x0 - 6:.1f}" y="{py + 4:.1f}" text-anchor="end">{y:.3g}</text>')
        value = low + (high - low) * k / 4.0
        value = 10**value if log else value
        parts.append(f'<text x="{at(value, 0)[0]:.1f}" y="{height - bottom + 16}" text-anchor="middle">{value:.3g}</text>')
    parts.append(f'<text x="{(left + width) / 2}" y="{height - 8}" text-anchor="middle">{x_label}</text>')
    parts.append(f'<text x="14" y="{height / 2}" text-anchor="middle" transform="rotate(-90 14 {height / 2})">{y_label}</text>')
    for k, (label, data) in enumerate(lines):
        path_data = " ".join(f"{x:.1f},{y:.1f}" for x, y in (at(*p) for p in data))
        parts.append(f'<polyline points="{path_data}" fill="none" stroke="{COLORS[k]}" stroke-width="1.6"/>')
    for k, (label, data) in enumerate(points):
        parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="none" stroke="{COLORS[k + len(lines)]}"/>' for x, y in
                  (at(*p) for p in data)]
    for k, (label, _) in enumerate([*lines, *points]):
        parts.append(f'<text x="{legend[0]}" y="{legend[1] + 15 * k}" fill="{COLORS[k]}">{label}</text>')
    Path(path).write_text("\n".join([*parts, "</svg>\n"]))


def comparisons():
    """Writes the images and the table of their errors."""
    rows = []
    for name in COMPARED:
        command = [BISCALE, "filter", f"{name}_color_map", "--side-by-side", OUT / f"{name}.png", "--json", "--no-cache", "--quiet"]
        printed = subprocess.run([*map(str, command)], check=True, capture_output=True, text=True).stdout
        of = {row["method"]: row for row in json.loads(printed)["side_by_side"]}
        rows.append(f"| `{name}_color_map` | {of['naive']['rms']:.4f} | {of['filtered']['rms']:.4f} |")
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()
    table = "\n".join(["| scene | naive | filtered |", "|---|---|---|", *rows, "", f"commit {commit}"])
    text = PAGE.read_text()
    start = text.index("<!-- comparisons -->\n") + len("<!-- comparisons -->\n")
    PAGE.write_text(text[:start] + table + text[text.index("\n<!-- end -->", start):])


def gaussian_heights(path, side=192, cells=16, waves=240):
    """Writes heights with the autocorrelation exp(-r² cells²) as a 16-bit image. Returns the factor from values 0..1 to a
    slope of deviation 0.35."""
    rng = random.Random(7)
    modes = []
    for _ in range(waves):
        deviation = cells * math.sqrt(2.0)
        kx, ky = (round(rng.gauss(0, deviation) / math.tau) for _ in range(2))
        modes.append((kx, ky, rng.random() * math.tau))
    rows = []
    for y in range(side):
        cosines = [(kx, math.tau * ky * y / side + phase) for kx, ky, phase in modes]
        rows.append([sum(math.cos(math.tau * kx * x / side + phase) for kx, phase in cosines) for x in range(side)])
    low, high = min(map(min, rows)), max(map(max, rows))
    square = sum((row[(x + 1) % side] - row[x]) ** 2 for row in rows for x in range(side)) / side**2
    slope = math.sqrt(square) * side / (high - low)
    raw = b"".join(b"\0" + b"".join(struct.pack(">H", round(65535 * (v - low) / (high - low))) for v in row) for row in rows)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", side, side, 16, 0, 0, 0, 0)
    Path(path).write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b""))
    return 0.35 / slope


def heights():
    """Fig. 7: moments of visible heights by Eq. 16, by the paper's fit, and by rays at a Gaussian surface."""
    with tempfile.TemporaryDirectory() as folder:
        factor = gaussian_heights(Path(folder, "heights.png"))
        head = f"[tile]\ngeometry = {{ kind = \"heightfield\", path = \"heights.png\", height_scale = {factor} }}\n"
        nodes = [-6 + 0.25 * k for k in range(49)]
        scenes = {}
        for name, value in [("mean", lambda h: (h + 6) / 12), ("square", lambda h: h * h / 36)]:
            stops = ", ".join(f"[{h}, {value(h)}]" for h in nodes)
            scenes[name] = Path(folder, f"{name}.toml")
            layer = f"[[color_map.layer]]\ndriver = {{ kind = \"height\" }}\nstops = [{stops}]\n"
            scenes[name].write_text(f"{head}[color_map]\ndistribution = \"measured\"\n{layer}")
        exponents = [10 ** (-1.5 + 0.05 * k) for k in range(64)]
        lines = {}
        for label, option in [("Eq. 16", "smith"), ("the paper's fit", "paper")]:
            lines[label] = query(scenes["mean"], "a", [[a] for a in exponents], "--set", f'color_map.distribution="{option}"')
        angles = [45, 60, 68, 74, 78, 81, 84, 86]
        pairs = [[0.0, 0.0, math.radians(angle), 0.4] for angle in angles]
        mean = query(scenes["mean"], "theta_i,phi_i,theta_o,phi_o", pairs, "--method", "truth")
        square = query(scenes["square"], "theta_i,phi_i,theta_o,phi_o", pairs, "--method", "truth")
        seen = [(m["lambda_o"], 12 * m["r"] - 6, 36 * s["r"]) for m, s in zip(mean, square)]
        for name, of_line, of_ray in [("mean", lambda r: r["mean"], lambda p: p[1]),
                                      ("deviation", lambda r: r["deviation"], lambda p: math.sqrt(max(p[2] - p[1] ** 2, 0)))]:
            plot(OUT / f"fig7_{name}.svg", f"Visible heights: {name} [deviations]", "a", name,
                 [(label, [(r["a"], of_line(r)) for r in rows]) for label, rows in lines.items()],
                 [("rays at a Gaussian surface", [(p[0], of_ray(p)) for p in seen if p[0] > 0.03])],
                 log=True, legend=(72, 40) if name == "mean" else (360, 60))


def footprints():
    """Error of one texture over the width of the footprint."""
    scene, header = "fig1a_noise_color_map", "u,v,width_u,width_v,angle"
    rng = random.Random(3)
    places = [(rng.random(), rng.random()) for _ in range(60)]
    widths = [2.0 ** (-9 + 0.5 * k) for k in range(19)]
    rows = [[u, v, w, w, 0] for w in widths for u, v in places]
    truth = query(scene, header, rows, "--method", "truth")
    lines = []
    for label, options in [("naive", ["--method", "naive"]), ("1 read", ["--set", "color_map.taps=1"]),
                           ("4 reads", []), ("16 reads", ["--set", "color_map.taps=16"])]:
        found, line = query(scene, header, rows, *options), []
        for k, w in enumerate(widths):
            part = range(k * len(places), (k + 1) * len(places))
            square = sum((found[j][c] - truth[j][c]) ** 2 for j in part for c in "rgb")
            line.append((w, math.sqrt(square / (3 * len(places)))))
        lines.append((label, line))
    plot(OUT / "footprints.svg", "Error of bands on a noise of 16 cells per tile", "width of the footprint [tiles]",
         "RMS, linear RGB", lines, log=True)


def zoom():
    """Nine frames (Fig. 11), and the mean colour over the zoom."""
    with tempfile.TemporaryDirectory() as folder:
        biscale("render", "fig1b_heights_color_map", "--zoom", "0.5:128:9", "-o", folder, "--size", "256x256", "--backend", "cpu")
        frames = [Path(folder, f"{k:04}.png") for k in range(9)]
        subprocess.run(["montage", *frames, "-tile", "9x1", "-geometry", "160x160+2+2", "-strip", ROOT / "docs/color_maps_zoom.png"], check=True)
        biscale("render", "fig11_scales_color_map", "--zoom", "0.5:128:9", "-o", folder, "--size", "256x256", "--backend", "cpu")
        subprocess.run(["montage", *frames, "-tile", "9x1", "-geometry", "160x160+2+2", "-strip", OUT / "fig11_zoom.png"], check=True)
        biscale("render", "fig11_scales_color_map", "--zoom", "0.5:128:65", "-o", folder, "--size", "144x144", "--backend", "cpu")
        rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(io.StringIO(Path(folder, "zoom.csv").read_text()))]
        plot(OUT / "zoom.svg", f"Mean radiance over the zoom; largest change {100 * max(r['change'] for r in rows):.2f} %",
             "pixels per tile", "mean radiance", [(c, [(r["pixels_per_tile"], r[c]) for r in rows]) for c in "rgb"], log=True, legend=(72, 220))


def main():
    OUT.mkdir(exist_ok=True)
    figures = {"comparisons": comparisons, "heights": heights, "footprints": footprints, "zoom": zoom}
    for name in sys.argv[1:] or figures:
        if name not in figures:
            sys.exit(f"found `{name}`, expected {', '.join(figures)}")
        figures[name]()


if __name__ == "__main__":
    main()
