//! A tensor tree of rank 4 (Ward et al. 2012): incident and leaving directions on Shirley and Chiu's square, in cells
//! of equal projected solid angle. A branch with nearly equal values is stored as one value.

use std::f64::consts::{FRAC_PI_4, PI};
use std::fmt::Write as _;
use std::io;

use glam::{DVec3, Vec3};

use super::super::sampler::{in_parallel, reading_error};
use super::super::{ExportResolution, ExportTask, Written};
use super::{Content, rgb, xyz};
use crate::effective::{EffectiveBrdf, Reflectance};

/// Default number of cells along a side, a power of 2.
const SIDE: usize = 32;
/// Bounds of the number of cells along a side, powers of 2.
const SIDES: [usize; 2] = [8, 64];
/// Bounds the deviation of a branch's values from their mean if it is stored as one value, relative to the mean of all
/// values.
const TOLERANCE: f64 = 0.02;
/// u' and v' of black.
const EQUAL_ENERGY: [f32; 2] = [4.0 / 19.0, 9.0 / 19.0];

/// Maps a point of the unit square to the disk (Shirley and Chiu 1997).
fn disk_of_square([x, y]: [f64; 2]) -> [f64; 2] {
    let (a, b) = (2.0 * x - 1.0, 2.0 * y - 1.0);
    let (radius, angle) = if a > -b {
        if a > b { (a, FRAC_PI_4 * (b / a)) } else { (b, FRAC_PI_4 * (2.0 - a / b)) }
    } else if a < b {
        (-a, FRAC_PI_4 * (4.0 + b / a))
    } else if b == 0.0 {
        (0.0, 0.0)
    } else {
        (-b, FRAC_PI_4 * (6.0 - a / b))
    };
    [radius * angle.cos(), radius * angle.sin()]
}

/// Inverts [`disk_of_square`].
fn square_of_disk([x, y]: [f64; 2]) -> [f64; 2] {
    let radius = x.hypot(y);
    let mut angle = y.atan2(x);
    if angle < -FRAC_PI_4 {
        angle += 2.0 * PI;
    }
    let (a, b) = if angle < FRAC_PI_4 {
        (radius, angle * radius / FRAC_PI_4)
    } else if angle < 3.0 * FRAC_PI_4 {
        ((2.0 * FRAC_PI_4 - angle) * radius / FRAC_PI_4, radius)
    } else if angle < 5.0 * FRAC_PI_4 {
        (-radius, (4.0 * FRAC_PI_4 - angle) * radius / FRAC_PI_4)
    } else {
        ((angle - 6.0 * FRAC_PI_4) * radius / FRAC_PI_4, -radius)
    };
    [0.5 * (a + 1.0), 0.5 * (b + 1.0)]
}

fn direction(square: [f64; 2]) -> DVec3 {
    let [x, y] = disk_of_square(square);
    DVec3::new(x, y, (1.0 - x * x - y * y).max(1e-6).sqrt())
}

/// Returns the number of cells along a side for a requested resolution: about the same number of directions.
pub(super) fn side_of(resolution: Option<ExportResolution>) -> usize {
    let Some(resolution) = resolution else { return SIDE };
    let side = ((resolution.theta_i * resolution.phi_i) as f64).sqrt();
    let [min, max] = SIDES;
    (1_usize << side.log2().round().max(0.0) as u32).clamp(min, max)
}

/// Returns the cell of a direction, y fastest.
pub(super) fn cell(side: usize, x: f64, y: f64) -> usize {
    let [x, y] = square_of_disk([x, y]).map(|at| ((at * side as f64) as usize).min(side - 1));
    x * side + y
}

/// Returns the direction at the middle of part `part` (of `parts²`) of a cell.
pub(super) fn part_of_cell(side: usize, cell: usize, part: usize, parts: usize) -> DVec3 {
    let at = |k: usize, part: usize| ((k * parts + part) as f64 + 0.5) / (side * parts) as f64;
    direction([at(cell / side, part / parts), at(cell % side, part % parts)])
}

/// Returns the mean BRDF from one incident cell to each leaving cell, as CIE X, Y and Z. The values are means over
/// parts of the cells, because a cell near the horizon is 10° high and the totals must be accurate.
fn one_incident(brdf: &EffectiveBrdf, side: usize, incident: usize) -> Vec<Vec3> {
    // Each part of the incident cell is paired with one part of each leaving cell: all parts occur, in a quarter of the
    // pairs.
    let parts = if side > SIDE { 1 } else { 2 };
    let mut sums = vec![Vec3::ZERO; side * side];
    let mut values = sums.clone();
    for part in 0..parts * parts {
        // The format's incident directions are those that the light travels in.
        let travel = part_of_cell(side, incident, part, parts).as_vec3();
        let source = Vec3::new(-travel.x, -travel.y, travel.z);
        let paired_part = |cell: usize| (part + 2 * (cell / side) + cell % side + 3 * incident) % (parts * parts);
        let leaving: Vec<Vec3> =
            (0..side * side).map(|cell| part_of_cell(side, cell, paired_part(cell), parts).as_vec3()).collect();
        brdf.eval_lights(&leaving, source, &mut values);
        for ((sum, value), o) in sums.iter_mut().zip(&values).zip(&leaving) {
            *sum += *value / o.z;
        }
    }
    sums.into_iter().map(|sum| xyz(sum / (parts * parts) as f32).max(Vec3::ZERO)).collect()
}

/// The values of a channel, `[incident x][incident y][leaving x][leaving y]`.
struct TensorTree {
    side: usize,
    values: Vec<f32>,
    tolerance: f64,
}

impl TensorTree {
    fn at(&self, index: [usize; 4]) -> f32 {
        self.values[index.iter().fold(0, |at, k| at * self.side + k)]
    }

    /// Writes the branch at `corner` with `side` cells per dimension; its mean alone if its values are nearly equal.
    fn branch(&self, corner: [usize; 4], side: usize, out: &mut String) {
        let (mean, spread) = self.mean_and_spread(corner, side);
        if side == 1 || spread <= self.tolerance {
            let _ = write!(out, "{{{mean:.4e}}}");
            return;
        }
        out.push('{');
        let half = side / 2;
        if half == 1 {
            // The finest level is a list with the first dimension slowest.
            for k in 0..16_usize {
                let step = [k >> 3 & 1, k >> 2 & 1, k >> 1 & 1, k & 1];
                let _ = write!(out, " {:.4e}", self.at(std::array::from_fn(|d| corner[d] + step[d])));
            }
        } else {
            // Branches are in the order with the first dimension fastest.
            for k in 0..16_usize {
                self.branch(std::array::from_fn(|d| corner[d] + half * (k >> d & 1)), half, out);
            }
        }
        out.push('}');
        out.push('\n');
    }

    fn mean_and_spread(&self, corner: [usize; 4], side: usize) -> (f64, f64) {
        let (mut sum, mut low, mut high) = (0.0, f64::INFINITY, f64::NEG_INFINITY);
        for a in 0..side {
            for b in 0..side {
                for c in 0..side {
                    for d in 0..side {
                        let value = f64::from(self.at([corner[0] + a, corner[1] + b, corner[2] + c, corner[3] + d]));
                        sum += value;
                        low = low.min(value);
                        high = high.max(value);
                    }
                }
            }
        }
        let mean = sum / side.pow(4) as f64;
        (mean, (high - mean).max(mean - low))
    }
}

pub fn tabulate(task: &ExportTask<'_>) -> io::Result<(Content, Written)> {
    let side = side_of(task.options.resolution);
    let brdf = task.brdf;
    let rows: Vec<Vec<Vec3>> = in_parallel(side * side, task.progress, |incident| one_incident(brdf, side, incident))?;
    let channels = channels(side, &rows);
    let read = |i: Vec3, o: Vec3| {
        let row = &rows[cell(side, f64::from(-o.x), f64::from(-o.y))];
        rgb(row[cell(side, f64::from(i.x), f64::from(i.y))]) * i.z
    };
    let conventions = vec![
        format!(
            "Tensor tree of rank 4, {side} cells a dimension: incident x and y, leaving x and y on Shirley and Chiu's square."
        ),
        "Incident directions are those that the light travels in (its x and y), as Radiance has them.".to_owned(),
        format!("Branches whose values differ from their mean by less than {TOLERANCE} of the mean of all end in one."),
    ];
    let reading = reading_error(task.brdf, read);
    let written = Written { pairs: side.pow(4), reading, conventions, anisotropy_lost: None };
    Ok((Content { definition: DEFINITION.to_owned(), basis: BASIS, channels, black: "{0}\n".to_owned() }, written))
}

/// The trees of the channels of rows of CIE X, Y and Z by incident, then by leaving cell, with the channels' names.
pub(super) fn channels(side: usize, rows: &[Vec<Vec3>]) -> [(&'static str, String); 3] {
    // Radiance reads chromaticity instead of X and Z from tensor trees.
    let chromaticity = |value: &Vec3| {
        let sum = value.x + 15.0 * value.y + 3.0 * value.z;
        if sum > 0.0 { [4.0 * value.x / sum, 9.0 * value.y / sum] } else { EQUAL_ENERGY }
    };
    let tree = |of: &dyn Fn(&Vec3) -> f32| {
        let values: Vec<f32> = rows.iter().flatten().map(of).collect();
        let mean = values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len() as f64;
        let mut text = String::new();
        TensorTree { side, values, tolerance: TOLERANCE * mean }.branch([0; 4], side, &mut text);
        text.push('\n');
        text
    };
    [
        ("CIE-u", tree(&|value| chromaticity(value)[0])),
        ("Visible", tree(&|value| value.y)),
        ("CIE-v", tree(&|value| chromaticity(value)[1])),
    ]
}

pub(super) const BASIS: &str = "<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>";
/// The data definition of the file.
pub(super) const DEFINITION: &str = "<IncidentDataStructure>TensorTree4</IncidentDataStructure>\n";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_map_from_square_to_disk_is_inverted() {
        for k in 0..400 {
            let square = [f64::from(k % 20) / 20.0 + 0.013, f64::from(k / 20) / 20.0 + 0.021];
            let disk = disk_of_square(square);
            assert!(disk[0].hypot(disk[1]) < 1.0);
            let back = square_of_disk(disk);
            assert!((back[0] - square[0]).abs() < 1e-9 && (back[1] - square[1]).abs() < 1e-9, "{square:?} {back:?}");
        }
    }

    #[test]
    fn sides_are_powers_of_two_near_the_requested_ones_and_cells_contain_their_parts() {
        let side = |theta: usize, phi: usize| {
            side_of(Some(ExportResolution { theta_i: theta, phi_i: phi, theta_o: 1, phi_o: 1 }))
        };
        assert_eq!([side_of(None), side(16, 64), side(64, 64), side(1, 1), side(500, 500)], [32, 32, 64, 8, 64]);
        for k in 0..8 * 8 {
            assert!((0..4).all(|part| {
                let d = part_of_cell(8, k, part, 2);
                cell(8, d.x, d.y) == k
            }));
        }
    }

    #[test]
    fn a_constant_tree_is_one_number_and_a_different_cell_splits_only_its_branch() {
        let mut values = vec![1.0; SIDE.pow(4)];
        let text = |values: &Vec<f32>| {
            let mut text = String::new();
            TensorTree { side: SIDE, values: values.clone(), tolerance: 0.01 }.branch([0; 4], SIDE, &mut text);
            text
        };
        assert_eq!(text(&values), "{1.0000e0}");
        values[0] = 2.0;
        let split = text(&values);
        assert_eq!(split.matches('{').count(), split.matches('}').count());
        // Four levels of sixteen branches, one of which is split, and sixteen numbers at the finest level.
        assert_eq!(split.matches("e0").count(), 15 * 4 + 16);
    }
}
