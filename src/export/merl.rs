//! MERL `.binary` (Matusik et al. 2003): the isotropic mean of the BRDF, and the error of leaving out the anisotropy.

use std::f64::consts::{PI, TAU};
use std::io::{self, Write};

use glam::{DVec3, Vec3};

use super::sampler::{in_parallel, reading_error};
use super::{ExportTask, Written};
use crate::base::finite::Numbers;
use crate::brdf::merl::{BINS_D, BINS_H, BINS_PHI, PLANE, SCALES, table_from_planes};
use crate::brdf::{LobeAngles, Measured};
use crate::effective::EffectiveBrdf;
use crate::math::directions::half_vector;

/// Number of tile azimuths that are averaged.
const AZIMUTHS: usize = 12;
/// Nodes along `θ_d` and `φ_d` that are evaluated. The bins between them are interpolated, because the sharp lobes of
/// facets depend mostly on the half vector, which every bin along `θ_h` evaluates.
const NODES_D: usize = 31;
const NODES_PHI: usize = 31;
/// Stored value if a direction is below the horizon.
const INVALID: f64 = -1.0;
/// Lower bound of the light's cosine in the division that gives the BRDF.
const MIN_COSINE: f64 = 1e-3;

/// Weighted sums that measure the anisotropy: squared deviations from the mean over azimuths, and squared means.
#[derive(Debug, Clone, Copy, Default)]
struct Anisotropy {
    deviation: f64,
    power: f64,
}

impl Numbers for Anisotropy {
    fn are_finite(&self) -> bool {
        (self.deviation, self.power).are_finite()
    }
}

/// Returns the mean BRDF over azimuths at half and difference angles; `None` if a direction is below the horizon.
fn mean(brdf: &EffectiveBrdf, [theta_h, theta_d, phi_d]: [f64; 3], anisotropy: &mut Anisotropy) -> Option<DVec3> {
    let h = DVec3::new(theta_h.sin(), 0.0, theta_h.cos());
    let x = DVec3::new(theta_h.cos(), 0.0, -theta_h.sin());
    let across = theta_d.sin() * (phi_d.cos() * x + phi_d.sin() * DVec3::Y);
    let (i, o) = (theta_d.cos() * h + across, theta_d.cos() * h - across);
    if i.z <= 0.0 || o.z <= 0.0 {
        return None;
    }
    let values: Vec<DVec3> = (0..AZIMUTHS)
        .map(|k| {
            let rotation = glam::DQuat::from_rotation_z(k as f64 / AZIMUTHS as f64 * TAU);
            let value = brdf.eval((rotation * i).as_vec3(), (rotation * o).as_vec3());
            // A vanishing cosine would amplify noise.
            value.as_dvec3() / i.z.max(MIN_COSINE)
        })
        .collect();
    let mean = values.iter().sum::<DVec3>() / AZIMUTHS as f64;
    // The anisotropy compares f, weighted with its solid angle and with that of the half vector on its square-root
    // axis.
    let weight = (i.z * o.z).powi(2) * theta_h.sin() * theta_h.sqrt() * theta_d.sin() * theta_d.cos();
    for value in values {
        anisotropy.deviation += weight * (value - mean).length_squared();
        anisotropy.power += weight * mean.length_squared();
    }
    Some(mean)
}

/// Returns the angles of fractional bin coordinates.
fn angles(h: f64, d: f64, phi: f64) -> [f64; 3] {
    let quarter = 0.5 * PI;
    [
        ((h + 0.5) / BINS_H as f64).powi(2) * quarter,
        (d + 0.5) / BINS_D as f64 * quarter,
        (phi + 0.5) / BINS_PHI as f64 * PI,
    ]
}

/// Computes the bins of one `θ_h`: bilinearly between the nodes, or evaluated if one of these nodes is below the
/// horizon.
fn row(brdf: &EffectiveBrdf, h: usize) -> (Vec<Option<DVec3>>, Anisotropy) {
    let mut anisotropy = Anisotropy::default();
    let bin_of = |node: usize, nodes: usize, bins: usize| node as f64 * (bins - 1) as f64 / (nodes - 1) as f64;
    let mut nodes = Vec::with_capacity(NODES_D * NODES_PHI);
    for d in 0..NODES_D {
        for phi in 0..NODES_PHI {
            let at = angles(h as f64, bin_of(d, NODES_D, BINS_D), bin_of(phi, NODES_PHI, BINS_PHI));
            nodes.push(mean(brdf, at, &mut anisotropy));
        }
    }
    let mut unused = Anisotropy::default();
    let mut bins = Vec::with_capacity(BINS_D * BINS_PHI);
    for d in 0..BINS_D {
        for phi in 0..BINS_PHI {
            let split = |bin: usize, nodes: usize, bins: usize| {
                let at = bin as f64 * (nodes - 1) as f64 / (bins - 1) as f64;
                let lower = (at as usize).min(nodes - 2);
                (lower, at - lower as f64)
            };
            let ((d0, t), (p0, u)) = (split(d, NODES_D, BINS_D), split(phi, NODES_PHI, BINS_PHI));
            let corner = |dd: usize, dp: usize| nodes[(d0 + dd) * NODES_PHI + p0 + dp];
            bins.push(match (corner(0, 0), corner(0, 1), corner(1, 0), corner(1, 1)) {
                (Some(a), Some(b), Some(c), Some(e)) => Some(a.lerp(b, u).lerp(c.lerp(e, u), t)),
                _ => mean(brdf, angles(h as f64, d as f64, phi as f64), &mut unused),
            });
        }
    }
    (bins, anisotropy)
}

/// Writes the file, measures the anisotropy that it loses, and adds the figure to the conventions.
pub fn write(task: &ExportTask<'_>, out: &mut dyn Write) -> io::Result<Written> {
    let rows = in_parallel(BINS_H, task.progress, |h| row(task.brdf, h))?;
    let mut anisotropy = Anisotropy::default();
    let mut planes = Vec::with_capacity(3 * 8 * PLANE);
    for (channel, scale) in SCALES.iter().enumerate() {
        for (bins, _) in &rows {
            for bin in bins {
                let value = bin.map_or(INVALID, |mean| mean[channel].max(0.0) / scale);
                planes.extend(value.to_le_bytes());
            }
        }
    }
    for (_, sums) in &rows {
        anisotropy.deviation += sums.deviation;
        anisotropy.power += sums.power;
    }
    for count in [BINS_H, BINS_D, BINS_PHI] {
        out.write_all(&(count as i32).to_le_bytes())?;
    }
    out.write_all(&planes)?;
    let table = table_from_planes(task.meta.scene.clone(), &planes);
    let read = |i: Vec3, o: Vec3| table.f_r(&LobeAngles::new(Vec3::Z, i, o, half_vector(i, o))) * i.z;
    let reading = reading_error(task.brdf, read);
    let lost = if anisotropy.power > 0.0 { (anisotropy.deviation / anisotropy.power).sqrt() } else { 0.0 };
    let mut conventions = vec![
        "MERL .binary (Matusik et al. 2003): three int32 (90, 90, 180), then planes of R, G, B in f64, little-endian.".to_owned(),
        "Index phi_d + 180 (theta_d + 90 theta_h), samples at bin centres; phi_d over [0, pi), theta_h index 90 sqrt(theta_h / 90 degrees).".to_owned(),
        "A stored number times 1/1500, 1.15/1500, 1.66/1500 (R, G, B) is the BRDF in 1/sr, no cosine; -1 is under the horizon.".to_owned(),
    ];
    conventions.push(format!(
        "The format is isotropic: this is the mean over {AZIMUTHS} azimuths of the tile. Turning the tile changes the reflected light by \
         {:.1} % (relative L2), which this file has lost{}.",
        100.0 * lost,
        if lost > 0.05 { "; .bsdf keeps it" } else { "" }
    ));
    Ok(Written { pairs: PLANE, reading, conventions, anisotropy_lost: Some(lost) })
}
