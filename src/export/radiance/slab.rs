//! A slab as four Klems matrices: transmission and reflection for light from either side.
//!
//! Radiance's front is our top face, which WINDOW calls the back.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};

use super::klems::{BASIS, KlemsPatch, PATCHES, definition, source_of};
use super::{block, header, xyz};
use crate::base::{Progress, Result, atomic_file, check_output, progress, replace_file, require_finite};
use crate::export::{meta, note_path};
use crate::scene::LoadedScene;
use crate::slab::{DiscGrid, Slab};

/// Directions along each side of a patch of incident light.
const INCIDENT: usize = 2;
/// Points of the disc of leaving light, for each incident direction.
const GRID: DiscGrid = DiscGrid { side: 18, fine: 36, finest: 160 };

/// Means of the BSDF over pairs of patches by incident, then by leaving patch, and the side that the light comes from.
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
pub fn write(slab: &Slab, loaded: &LoadedScene, path: &Path, progress: &Progress<'_>) -> Result<(PathBuf, usize)> {
    let note = note_path(path);
    check_output(path, &[])?;
    check_output(&note, &[])?;
    let mut matrices = Vec::new();
    for (k, kind) in KINDS.iter().enumerate() {
        let part = progress::part(progress, 0.25 * k as f32, 0.25 * (k + 1) as f32);
        matrices.push(Matrix { name: kind.name, columns: matrix(slab, kind, &part)? });
    }
    let tile = &loaded.scene.tile;
    let thickness = slab.optics.thickness as f32;
    atomic_file::write_atomically(path, |out| {
        header(out, &loaded.name, tile.size.to_array(), thickness, &definition())?;
        for matrix in &matrices {
            for (channel, name) in ["CIE-X", "Visible", "CIE-Z"].into_iter().enumerate() {
                block(out, name, matrix.name, BASIS, &values(matrix, channel))?;
            }
        }
        writeln!(out, "</Layer>\n</Optical>\n</WindowElement>")
    })?;
    let patches = KlemsPatch::all();
    let flux = |matrix: &Matrix| {
        let parts = matrix.columns[0].iter().zip(&patches);
        parts.map(|(value, patch)| *value * patch.projected_solid_angle() as f32).sum::<Vec3>()
    };
    let normal_incidence = [flux(&matrices[0]), flux(&matrices[1])];
    replace_file(&note, text(loaded, normal_incidence).as_bytes())?;
    Ok((note, 4 * PATCHES * PATCHES))
}

/// Columns of one kind of scattering. Straight and mirrored light falls into the patch of its direction.
fn matrix(slab: &Slab, kind: &Kind, progress: &Progress<'_>) -> Result<Vec<Vec<Vec3>>> {
    let patches = KlemsPatch::all();
    let side = |is_above: bool| DVec3::new(1.0, 1.0, if is_above { 1.0 } else { -1.0 });
    let is_transmitted = kind.from_above != kind.to_above;
    let face = if kind.from_above { &slab.top } else { &slab.bottom };
    let shape = if is_transmitted { slab.transmitted_shape() } else { (2.0 * face.deviation(), face.resolution()) };
    let columns = progress::in_parallel(PATCHES, progress, |incident| {
        let mut sums = vec![DVec3::ZERO; PATCHES];
        let directions = patches[incident].directions(INCIDENT);
        for direction in &directions {
            // The direction that straight and mirrored light leaves in is that of its patch, on the side of the viewer.
            let i = source_of(*direction) * side(kind.from_above);
            let row = slab.row(i);
            for (p, area) in GRID.points(direction.truncate(), shape) {
                let o = p.extend((1.0 - p.length_squared()).max(0.0).sqrt());
                let value = if is_transmitted {
                    row.btdf(o * side(kind.to_above))
                } else {
                    slab.brdf(i, o * side(kind.to_above))
                };
                sums[KlemsPatch::index_of(o)] += area * value;
            }
            let [transmitted, mirrored] = slab.straight(i);
            sums[incident] += if is_transmitted { transmitted } else { mirrored };
        }
        let mean = |(sum, patch): (DVec3, &KlemsPatch)| {
            (sum / (directions.len() as f64 * patch.projected_solid_angle())).as_vec3()
        };
        sums.into_iter().zip(&patches).map(mean).collect::<Vec<Vec3>>()
    })?;
    require_finite(&columns)?;
    Ok(columns)
}

/// The values of a channel, one row per leaving patch.
fn values(matrix: &Matrix, channel: usize) -> String {
    let mut text = String::new();
    for leaving in 0..PATCHES {
        for column in &matrix.columns {
            let _ = write!(text, "{:.5e}\t", xyz(column[leaving])[channel].max(0.0));
        }
        text.push('\n');
    }
    text
}

fn text(loaded: &LoadedScene, [transmitted, reflected]: [Vec3; 2]) -> String {
    let rgb = |value: Vec3| format!("{:.4} {:.4} {:.4}", value.x, value.y, value.z);
    format!(
        "{}: slab of {}\n\n\
         Radiance: +z of the file is our z. `Transmission Back` and `Reflection Back` are for light from +z (our top face), \
         `Transmission Front` and `Reflection Front` for light from -z.\n\
         Klems full basis: 145 incident (columns) by 145 leaving (rows) patches, each the mean over its patch; straight light \
         is in the patch of its direction.\n\
         `BSDF` or `aBSDF` material: up vector along our y, so that x of the file is tile x.\n\
         Visible (Y) is in 1/sr, no cosine; X and Z are scaled so that white is neutral in Radiance.\n\
         Patches are 10 degrees wide: a lobe narrower than that is spread over them; hemispherical totals stay.\n\n\
         Light along the normal from above (R G B): transmitted {}, reflected {}.\n",
        meta::PROGRAM,
        loaded.name,
        rgb(transmitted),
        rgb(reflected)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::Pipeline;
    use crate::scene;

    #[test]
    fn matrices_hold_the_totals_of_the_slab_and_a_window_is_diagonal() {
        let open = |name: &str| {
            Pipeline::new().slab(&scene::open(name, &["quality.preset=draft".to_owned()]).unwrap()).unwrap()
        };
        let window = open("slab_window");
        let columns = matrix(&window.slab, &KINDS[0], &|_| true).unwrap();
        let patches = KlemsPatch::all();
        for (k, column) in columns.iter().enumerate() {
            for (j, value) in column.iter().enumerate() {
                assert!(j == k || value.max_element() < 1e-3, "{k} {j}: {value}");
            }
        }
        let rough = open("slab_fig3_both");
        for (k, kind) in KINDS.iter().enumerate() {
            let columns = matrix(&rough.slab, kind, &|_| true).unwrap();
            let flux = |column: &[Vec3]| -> f64 {
                column
                    .iter()
                    .zip(&patches)
                    .map(|(value, patch)| f64::from(value.x) * patch.projected_solid_angle())
                    .sum()
            };
            let i = DVec3::new(0.0, 0.0, 1.0);
            let slab = &rough.slab;
            let total = match k {
                0 | 2 => crate::slab::DiscLobe::transmitted(slab, i, 96).total().x,
                _ => crate::slab::DiscLobe::reflected(slab, i, 96).total().x,
            };
            assert!((flux(&columns[0]) / total - 1.0).abs() < 0.02, "{}: {} {total}", kind.name, flux(&columns[0]));
        }
    }
}
