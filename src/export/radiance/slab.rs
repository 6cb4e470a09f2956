//! A slab as four Klems matrices or tensor trees: transmission and reflection for light from either side.
//!
//! Radiance's front is our top face, which WINDOW calls the back.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};

use super::klems::{BASIS, KlemsPatch, definition, source_of};
use super::{RadianceBasis, block, header, tensor_tree, xyz};
use crate::base::{Progress, Result, atomic_file, check_output, progress, replace_file, require_finite};
use crate::export::{ExportOptions, meta, note_path};
use crate::scene::{LoadedScene, millimetres};
use crate::slab::{DiscGrid, Slab};

/// Directions along each side of a cell of incident light.
const INCIDENT: usize = 2;
/// Points along each side of a square of leaving light: within this many deviations of a lobe from straight light, as many as
/// resolve the lobe, and one elsewhere.
const NEAR: f64 = 4.0;
const NEAR_POINTS: (f64, f64) = (2.0, 8.0);
/// Points of the disc of leaving light, for each incident direction.
const GRID: DiscGrid = DiscGrid { side: 18, fine: 36, finest: 160 };

/// The cells that divide a hemisphere.
enum Cells {
    Klems(Vec<KlemsPatch>),
    /// Squares of equal projected solid angle, so many along a side.
    Squares(usize),
}

impl Cells {
    fn of(options: &ExportOptions) -> Self {
        match options.radiance {
            RadianceBasis::Klems => Self::Klems(KlemsPatch::all()),
            RadianceBasis::TensorTree => Self::Squares(tensor_tree::side_of(options.resolution)),
        }
    }

    fn count(&self) -> usize {
        match self {
            Self::Klems(patches) => patches.len(),
            Self::Squares(side) => side * side,
        }
    }

    /// Directions in which straight light of an incident cell leaves.
    fn incident(&self, cell: usize) -> Vec<DVec3> {
        match self {
            Self::Klems(patches) => patches[cell].directions(INCIDENT),
            Self::Squares(side) => {
                (0..INCIDENT * INCIDENT).map(|part| tensor_tree::part_of_cell(*side, cell, part, INCIDENT)).collect()
            }
        }
    }

    /// Points of leaving light with their cells and projected solid angles, denser where a lobe of the given shape lies around
    /// straight light.
    fn leaving(&self, straight: DVec3, shape: (f64, f64)) -> Vec<(DVec3, usize, f64)> {
        let up = |p: glam::DVec2| p.extend((1.0 - p.length_squared()).max(0.0).sqrt());
        match self {
            Self::Klems(_) => {
                let points = GRID.points(straight.truncate(), shape).into_iter();
                points.map(|(p, area)| (up(p), KlemsPatch::index_of(up(p)), area)).collect()
            }
            Self::Squares(side) => {
                let width = if shape.1 > 0.0 { shape.0.min(shape.1) } else { shape.0 };
                let size = 2.0 / *side as f64;
                let points = (4.0 * size / width.max(1e-9)).ceil().clamp(NEAR_POINTS.0, NEAR_POINTS.1) as usize;
                let of_cell = |cell: usize| {
                    let middle = tensor_tree::part_of_cell(*side, cell, 0, 1);
                    let distance = (middle - straight).truncate().length();
                    let parts = if distance < NEAR * shape.0 + size { points } else { 1 };
                    let area = std::f64::consts::PI / (side * side * parts * parts) as f64;
                    (0..parts * parts).map(move |k| (tensor_tree::part_of_cell(*side, cell, k, parts), cell, area))
                };
                (0..side * side).flat_map(of_cell).collect()
            }
        }
    }

    /// Projected solid angle of a cell [sr].
    fn projected_solid_angle(&self, cell: usize) -> f64 {
        match self {
            Self::Klems(patches) => patches[cell].projected_solid_angle(),
            Self::Squares(side) => std::f64::consts::PI / (side * side) as f64,
        }
    }

    fn definition(&self) -> String {
        match self {
            Self::Klems(_) => definition(),
            Self::Squares(_) => tensor_tree::DEFINITION.to_owned(),
        }
    }

    /// The names and the values of the channels of a matrix, and its basis in XML.
    fn channels(&self, matrix: &Matrix) -> ([(&'static str, String); 3], &'static str) {
        match self {
            Self::Klems(_) => {
                let names = ["CIE-X", "Visible", "CIE-Z"];
                (std::array::from_fn(|channel| (names[channel], values(matrix, channel))), BASIS)
            }
            Self::Squares(side) => {
                let row = |column: &Vec<Vec3>| column.iter().map(|value| xyz(*value).max(Vec3::ZERO)).collect();
                let rows: Vec<Vec<Vec3>> = matrix.columns.iter().map(row).collect();
                (tensor_tree::channels(*side, &rows), tensor_tree::BASIS)
            }
        }
    }

    fn describe(&self) -> String {
        match self {
            Self::Klems(_) => "Klems full basis: 145 incident (columns) by 145 leaving (rows) patches, each the mean over its \
                               patch; straight light is in the patch of its direction.\n\
                               Patches are 10 degrees wide: a lobe narrower than that is spread over them; hemispherical totals stay."
                .to_owned(),
            Self::Squares(side) => format!(
                "Tensor trees of rank 4, {side} cells a dimension: incident x and y (those that light travels in), leaving x and y \
                 on Shirley and Chiu's square; each cell is the mean over its directions, and straight light is in the cell of its \
                 direction."
            ),
        }
    }
}

/// Means of the BSDF over pairs of cells by incident, then by leaving cell, and the side that the light comes from.
struct Matrix {
    name: &'static str,
    columns: Vec<Vec<Vec3>>,
}

/// One kind of scattering: the side of the light and the side of the viewer.
struct Kind {
    name: &'static str,
    from_above: bool,
    to_above: bool,
}

const KINDS: [Kind; 4] = [
    Kind { name: "Transmission Back", from_above: true, to_above: false },
    Kind { name: "Reflection Back", from_above: true, to_above: true },
    Kind { name: "Transmission Front", from_above: false, to_above: true },
    Kind { name: "Reflection Front", from_above: false, to_above: false },
];

/// Writes the matrices, and a note beside them. Returns the note and the number of pairs.
///
/// # Errors
/// A path that cannot be written, or [`crate::Error::Cancelled`].
pub fn write(
    slab: &Slab,
    loaded: &LoadedScene,
    options: &ExportOptions,
    path: &Path,
    progress: &Progress<'_>,
) -> Result<(PathBuf, usize)> {
    let cells = Cells::of(options);
    millimetres(&loaded.scene.tile.unit)?;
    let note = note_path(path);
    check_output(path, &[])?;
    check_output(&note, &[])?;
    let mut matrices = Vec::new();
    for (k, kind) in KINDS.iter().enumerate() {
        let part = progress::part(progress, 0.25 * k as f32, 0.25 * (k + 1) as f32);
        matrices.push(Matrix { name: kind.name, columns: matrix(slab, kind, &cells, &part)? });
    }
    let tile = &loaded.scene.tile;
    let (thickness, metres) = (slab.optics.thickness as f32, millimetres(&tile.unit)? / 1000.0);
    atomic_file::write_atomically(path, |out| {
        header(out, &loaded.name, (tile.size.to_array(), thickness, metres), &cells.definition())?;
        for matrix in &matrices {
            let (channels, basis) = cells.channels(matrix);
            for (name, values) in &channels {
                block(out, name, matrix.name, basis, values)?;
            }
        }
        writeln!(out, "</Layer>\n</Optical>\n</WindowElement>")
    })?;
    let along_normal = cell_of_normal(&cells);
    let flux = |matrix: &Matrix| {
        let parts = matrix.columns[along_normal].iter().enumerate();
        parts.map(|(cell, value)| *value * cells.projected_solid_angle(cell) as f32).sum::<Vec3>()
    };
    let normal_incidence = [flux(&matrices[0]), flux(&matrices[1])];
    replace_file(&note, text(loaded, &cells, normal_incidence).as_bytes())?;
    Ok((note, 4 * cells.count().pow(2)))
}

/// The incident cell that holds light along the normal.
fn cell_of_normal(cells: &Cells) -> usize {
    match cells {
        Cells::Klems(_) => 0,
        Cells::Squares(side) => tensor_tree::cell(*side, 0.0, 0.0),
    }
}

/// Columns of one kind of scattering. Straight and mirrored light falls into the cell of its direction.
fn matrix(slab: &Slab, kind: &Kind, cells: &Cells, progress: &Progress<'_>) -> Result<Vec<Vec<Vec3>>> {
    let side = |is_above: bool| DVec3::new(1.0, 1.0, if is_above { 1.0 } else { -1.0 });
    let is_transmitted = kind.from_above != kind.to_above;
    let face = if kind.from_above { &slab.top } else { &slab.bottom };
    let shape = if is_transmitted { slab.transmitted_shape() } else { (2.0 * face.deviation(), face.resolution()) };
    let columns = progress::in_parallel(cells.count(), progress, |incident| {
        let mut sums = vec![DVec3::ZERO; cells.count()];
        let directions = cells.incident(incident);
        for direction in &directions {
            // The direction that straight and mirrored light leaves in is that of its cell, on the side of the viewer.
            let i = source_of(*direction) * side(kind.from_above);
            let row = slab.row(i);
            for (o, cell, area) in cells.leaving(*direction, shape) {
                let value = if is_transmitted {
                    row.btdf(o * side(kind.to_above))
                } else {
                    slab.brdf(i, o * side(kind.to_above))
                };
                sums[cell] += area * value;
            }
            let [transmitted, mirrored] = slab.straight(i);
            sums[incident] += if is_transmitted { transmitted } else { mirrored };
        }
        let mean = |(cell, sum): (usize, DVec3)| {
            (sum / (directions.len() as f64 * cells.projected_solid_angle(cell))).as_vec3()
        };
        sums.into_iter().enumerate().map(mean).collect::<Vec<Vec3>>()
    })?;
    require_finite(&columns)?;
    Ok(columns)
}

/// The values of a channel, one row per leaving patch.
fn values(matrix: &Matrix, channel: usize) -> String {
    let mut text = String::new();
    for leaving in 0..matrix.columns.len() {
        for column in &matrix.columns {
            let _ = write!(text, "{:.5e}\t", xyz(column[leaving])[channel].max(0.0));
        }
        text.push('\n');
    }
    text
}

fn text(loaded: &LoadedScene, cells: &Cells, [transmitted, reflected]: [Vec3; 2]) -> String {
    let rgb = |value: Vec3| format!("{:.4} {:.4} {:.4}", value.x, value.y, value.z);
    format!(
        "{}: slab of {}\n\n\
         Radiance: +z of the file is our z. `Transmission Back` and `Reflection Back` are for light from +z (our top face), \
         `Transmission Front` and `Reflection Front` for light from -z.\n\
         {}\n\
         `BSDF` or `aBSDF` material: up vector along our y, so that x of the file is tile x.\n\
         Visible (Y) is in 1/sr, no cosine; X and Z are scaled so that white is neutral in Radiance.\n\n\
         Light along the normal from above (R G B): transmitted {}, reflected {}.\n",
        meta::PROGRAM,
        loaded.name,
        cells.describe(),
        rgb(transmitted),
        rgb(reflected)
    )
}

#[cfg(test)]
#[path = "slab_tests.rs"]
mod tests;
