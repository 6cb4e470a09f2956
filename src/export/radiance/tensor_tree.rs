//! A tensor tree of rank 4 (Ward et al. 2012): incident and leaving directions on Shirley and Chiu's square, each cell of
//! equal projected solid angle; branches whose values hardly differ end in one.

use std::f64::consts::{FRAC_PI_4, PI};
use std::fmt::Write as _;
use std::io;

use glam::{DVec3, Vec3};

use super::super::sampler::{in_parallel, reading_error};
use super::super::{Job, Written};
use super::{Content, rgb, xyz};
use crate::filtering::Reflectance;

/// Cells along a side: 2 to the power of this.
const LEVELS: u32 = 5;
const SIDE: usize = 1 << LEVELS;
/// Directions along a side of a leaving cell.
const LEAVING: usize = 2;
/// A branch ends where its values differ from their mean by less than this part of the mean of all.
const TOLERANCE: f64 = 0.02;
/// u' and v' of what has no colour.
const EQUAL_ENERGY: [f32; 2] = [4.0 / 19.0, 9.0 / 19.0];

/// The disk's point of a point of the unit square (Shirley and Chiu 1997).
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

/// The inverse of [`disk_of_square`].
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

/// Cells of a direction along x and y.
fn cell(x: f64, y: f64) -> [usize; 2] {
    square_of_disk([x, y]).map(|at| ((at * SIDE as f64) as usize).min(SIDE - 1))
}

/// Values of a channel, `[incident x][incident y][leaving x][leaving y]`.
struct Grid {
    values: Vec<f32>,
    tolerance: f64,
}

impl Grid {
    fn at(&self, index: [usize; 4]) -> f32 {
        self.values[index.iter().fold(0, |at, k| at * SIDE + k)]
    }

    /// Writes the branch at `corner` of `side` cells a dimension, and returns its mean where it is flat.
    fn branch(&self, corner: [usize; 4], side: usize, out: &mut String) {
        let (mean, spread) = self.mean_and_spread(corner, side);
        if side == 1 || spread <= self.tolerance {
            let _ = write!(out, "{{{mean:.4e}}}");
            return;
        }
        out.push('{');
        let half = side / 2;
        if half == 1 {
            // The finest level stands as a list, first dimension slowest.
            for k in 0..16_usize {
                let step = [k >> 3 & 1, k >> 2 & 1, k >> 1 & 1, k & 1];
                let _ = write!(out, " {:.4e}", self.at(std::array::from_fn(|d| corner[d] + step[d])));
            }
        } else {
            // Branches run with the first dimension fastest.
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

pub fn tabulate(job: &Job<'_>) -> io::Result<(Content, Written)> {
    let centre = |k: usize, n: usize| (k as f64 + 0.5) / n as f64;
    let fine = SIDE * LEAVING;
    let leaving: Vec<Vec3> = (0..SIDE * SIDE)
        .flat_map(|cell| (0..LEAVING * LEAVING).map(move |part| (cell, part)))
        .map(|(cell, part)| {
            let x = centre(cell / SIDE * LEAVING + part / LEAVING, fine);
            direction([x, centre(cell % SIDE * LEAVING + part % LEAVING, fine)]).as_vec3()
        })
        .collect();
    let rows: Vec<Vec<Vec3>> = in_parallel(SIDE * SIDE, job.progress, |incident| {
        // Incident directions are those that the light travels in.
        let travels = direction([centre(incident / SIDE, SIDE), centre(incident % SIDE, SIDE)]);
        let source = Vec3::new(-travels.x as f32, -travels.y as f32, travels.z as f32);
        let mut values = vec![Vec3::ZERO; leaving.len()];
        job.brdf.eval_lights(&leaving, source, &mut values);
        let parts = values.chunks(LEAVING * LEAVING).zip(leaving.chunks(LEAVING * LEAVING));
        parts
            .map(|(values, o)| values.iter().zip(o).map(|(v, o)| *v / o.z).sum::<Vec3>() / (LEAVING * LEAVING) as f32)
            .map(|value| xyz(value).max(Vec3::ZERO))
            .collect()
    })?;
    // Chromaticity in place of X and Z: that is what Radiance reads from trees.
    let chromaticity = |value: &Vec3| {
        let sum = value.x + 15.0 * value.y + 3.0 * value.z;
        if sum > 0.0 { [4.0 * value.x / sum, 9.0 * value.y / sum] } else { EQUAL_ENERGY }
    };
    let tree = |of: &dyn Fn(&Vec3) -> f32| {
        let values: Vec<f32> = rows.iter().flatten().map(of).collect();
        let mean = values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len() as f64;
        let mut text = String::new();
        Grid { values, tolerance: TOLERANCE * mean }.branch([0; 4], SIDE, &mut text);
        text.push('\n');
        text
    };
    let channels = [
        ("CIE-u", tree(&|value| chromaticity(value)[0])),
        ("Visible", tree(&|value| value.y)),
        ("CIE-v", tree(&|value| chromaticity(value)[1])),
    ];
    let read = |i: Vec3, o: Vec3| {
        let [x, y] = cell(f64::from(-o.x), f64::from(-o.y));
        let [a, b] = cell(f64::from(i.x), f64::from(i.y));
        rgb(rows[x * SIDE + y][a * SIDE + b]) * i.z
    };
    let conventions = vec![
        format!(
            "Tensor tree of rank 4, {SIDE} cells a dimension: incident x and y, leaving x and y on Shirley and Chiu's square."
        ),
        "Incident directions are those that the light travels in (its x and y), as Radiance has them.".to_owned(),
        format!("Branches whose values differ from their mean by less than {TOLERANCE} of the mean of all end in one."),
    ];
    let reading = reading_error(job.brdf, read);
    let written = Written { pairs: SIDE.pow(4), reading, conventions, anisotropy_lost: None };
    let definition = "<IncidentDataStructure>TensorTree4</IncidentDataStructure>\n".to_owned();
    Ok((Content { definition, basis: BASIS, channels, black: "{0}\n".to_owned() }, written))
}

const BASIS: &str = "<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_square_becomes_the_disk_and_comes_back() {
        for k in 0..400 {
            let square = [f64::from(k % 20) / 20.0 + 0.013, f64::from(k / 20) / 20.0 + 0.021];
            let disk = disk_of_square(square);
            assert!(disk[0].hypot(disk[1]) < 1.0);
            let back = square_of_disk(disk);
            assert!((back[0] - square[0]).abs() < 1e-9 && (back[1] - square[1]).abs() < 1e-9, "{square:?} {back:?}");
        }
    }

    #[test]
    fn a_flat_tree_is_one_number_and_one_odd_cell_opens_its_branch_alone() {
        let mut values = vec![1.0; SIDE.pow(4)];
        let text = |values: &Vec<f32>| {
            let mut text = String::new();
            Grid { values: values.clone(), tolerance: 0.01 }.branch([0; 4], SIDE, &mut text);
            text
        };
        assert_eq!(text(&values), "{1.0000e0}");
        values[0] = 2.0;
        let opened = text(&values);
        assert_eq!(opened.matches('{').count(), opened.matches('}').count());
        // Four levels of sixteen, of which one opens, and sixteen numbers at the end.
        assert_eq!(opened.matches("e0").count(), 15 * 4 + 16);
    }
}
