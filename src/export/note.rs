//! The text note beside a table, and directional-hemispherical reflectances.

use std::f32::consts::{FRAC_PI_2, TAU};
use std::fmt::Write as _;
use std::path::Path;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::meta::{FRAME, PROGRAM};
use super::{ExportTask, Written};
use crate::base::{Cancel, Result};
use crate::effective::{EffectiveBrdf, Reflectance};
use crate::math::directions::from_angles;

/// Directional-hemispherical reflectances per channel: the fraction of the light from one direction that is reflected.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Reflectances {
    /// `(theta_i, phi_i)` in degrees, and the reflectance.
    pub of_direction: Vec<([f32; 2], Vec3)>,
    /// Bi-hemispherical reflectance under uniform light, integrated over the directions above.
    pub diffuse: Vec3,
}

/// Directions of the listed reflectances, degrees.
const THETAS: [f32; 6] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0];
const PHIS: [f32; 2] = [0.0, 90.0];
/// Cells of the integral over the hemisphere: steps of 1° in polar angle and 3° in azimuth.
const RINGS: usize = 90;
const AZIMUTHS: usize = 120;

impl Reflectances {
    /// Computes the reflectances.
    pub fn of(brdf: &EffectiveBrdf) -> Self {
        let hemisphere = Hemisphere::new();
        let directions: Vec<[f32; 2]> = THETAS
            .iter()
            .flat_map(|&theta| PHIS.iter().map(move |&phi| [theta, phi]))
            .filter(|[theta, phi]| *theta > 0.0 || *phi == 0.0)
            .collect();
        let of_direction: Vec<_> = directions
            .into_par_iter()
            .map(|[theta, phi]| {
                ([theta, phi], hemisphere.reflectance(brdf, from_angles(theta.to_radians(), phi.to_radians())))
            })
            .collect();
        // Weights are proportional to the projected solid angle of a ring.
        let weight = |theta: f32| (2.0 * theta.to_radians()).sin() / if theta == 0.0 { 1.0 } else { 2.0 };
        let total: f32 = of_direction.iter().map(|([theta, _], _)| weight(*theta)).sum();
        let diffuse = of_direction.iter().map(|([theta, _], value)| *value * weight(*theta)).sum::<Vec3>() / total;
        Self { of_direction, diffuse }
    }

    /// Returns `theta_i`, `phi_i` in degrees and R, G, B of each direction.
    pub fn rows(&self) -> Vec<[f32; 5]> {
        self.of_direction.iter().map(|([theta, phi], value)| [*theta, *phi, value.x, value.y, value.z]).collect()
    }

    /// Returns one line of text per direction.
    pub fn lines(&self) -> Vec<String> {
        let line = |([theta, phi], value): &([f32; 2], Vec3)| {
            format!("theta {theta:>2}°, phi {phi:>2}°: {:.4} {:.4} {:.4}", value.x, value.y, value.z)
        };
        self.of_direction.iter().map(line).collect()
    }
}

/// Directional-hemispherical reflectances of light from directions.
///
/// # Errors
/// [`crate::base::Error::Cancelled`].
pub fn reflectances(brdf: &EffectiveBrdf, directions: &[Vec3], cancel: &Cancel) -> Result<Vec<Vec3>> {
    let hemisphere = Hemisphere::new();
    cancel.map("reflectances", directions.len(), |k| hemisphere.reflectance(brdf, directions[k]))
}

/// The directions at the middles of cells, and the solid angle of each cell.
struct Hemisphere {
    directions: Vec<Vec3>,
    solid_angles: Vec<f64>,
}

impl Hemisphere {
    fn new() -> Self {
        let cells = (0..RINGS).flat_map(|ring| (0..AZIMUTHS).map(move |step| (ring, step)));
        let (directions, solid_angles) = cells
            .map(|(ring, step)| {
                let edge = |k: usize| k as f32 / RINGS as f32 * FRAC_PI_2;
                let theta = 0.5 * (edge(ring) + edge(ring + 1));
                let phi = (step as f32 + 0.5) / AZIMUTHS as f32 * TAU;
                let band = f64::from(edge(ring)).cos() - f64::from(edge(ring + 1)).cos();
                (from_angles(theta, phi), band * f64::from(TAU) / AZIMUTHS as f64)
            })
            .unzip();
        Self { directions, solid_angles }
    }

    /// The integral of `f̄(i, o)` over all `i`, which by reciprocity is the reflectance for light from `o`.
    fn reflectance(&self, brdf: &EffectiveBrdf, o: Vec3) -> Vec3 {
        let mut values = vec![Vec3::ZERO; self.directions.len()];
        brdf.eval_lights(&self.directions, o, &mut values);
        let sum: DVec3 = values.iter().zip(&self.solid_angles).map(|(value, w)| value.as_dvec3() * *w).sum();
        sum.as_vec3()
    }
}

/// Returns the text of the note on a file.
pub(super) fn text(task: &ExportTask<'_>, path: &Path, written: &Written, reflectances: &Reflectances) -> String {
    let meta = task.meta;
    let mut text = String::new();
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut put = |line: &str| {
        let _ = writeln!(text, "{}", line.replace(['\n', '\r'], " "));
    };
    put(&format!("{name}: the effective BRDF of the scene {}, written by {PROGRAM}", meta.scene));
    put("");
    put("How to read it");
    written.conventions.iter().for_each(|line| put(&format!("- {line}")));
    put(&format!("- Frame: {FRAME}."));
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("bsdf")) {
        let file = name.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;");
        put(&format!("- Mitsuba 3: <bsdf type=\"measured\"><string name=\"filename\" value=\"{file}\"/></bsdf>"));
    }
    put(
        "- x is the tangent (tile x, along u of a surface), y the bitangent (tile y, along v); put the same frame on the object.",
    );
    put("- Colours are linear RGB with Rec. 709 primaries. The BRDF is f_bar(i,o) / cos(theta_i) in 1/sr.");
    put("");
    put("Where it comes from");
    put(&format!("- Scene: {}; quality: {}; seed {}.", meta.scene, meta.quality, meta.seed));
    let [x, y] = meta.tile_size;
    put(&format!("- Tile: {x} x {y} {}; {}.", meta.tile_unit, meta.plane()));
    meta.notes.iter().for_each(|note| put(&format!("- {note}")));
    put("");
    put("How good it is");
    let reading = &written.reading;
    put(&format!(
        "- Read back at directions up to 85 degrees, half of them near the mirror direction: mean error {:.2} %, relative L2 \
         {:.2} %, {:.1} dB.",
        100.0 * reading.mean,
        100.0 * reading.errors.rel_l2,
        reading.errors.psnr_db
    ));
    put(
        "- That is against the program's own value at this quality; `biscale eval --quality reference` tells the rest.",
    );
    put("");
    put("Directional-hemispherical reflectance (R G B): light from one direction, all that leaves again");
    reflectances.lines().iter().for_each(|line| put(&format!("- {line}")));
    let diffuse = reflectances.diffuse;
    put(&format!("- even light from everywhere: about {:.3} {:.3} {:.3}", diffuse.x, diffuse.y, diffuse.z));
    text
}
