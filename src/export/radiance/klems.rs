//! Klems' full basis: nine rings of patches of about equal projected solid angle, 145 patches in all.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::io;

use glam::{DVec3, Vec3};

use super::super::sampler::{in_parallel, reading_error};
use super::super::{ExportTask, Written};
use super::{Content, rgb, xyz};
use crate::effective::Reflectance;

/// Middle and upper bound of each ring in degrees, and its number of patches. The first patch is centred on azimuth 0.
const RINGS: [(u32, u32, usize); 9] = [
    (0, 5, 1),
    (10, 15, 8),
    (20, 25, 16),
    (30, 35, 20),
    (40, 45, 24),
    (50, 55, 24),
    (60, 65, 24),
    (70, 75, 16),
    (80, 90, 12),
];
pub(super) const PATCHES: usize = 145;
/// Directions along each side of a patch of incident light.
const INCIDENT: usize = 3;
/// Directions along each side of a patch of leaving light.
const LEAVING: usize = 5;

/// Bounds of a patch in radians.
#[derive(Debug, Clone, Copy)]
pub(super) struct KlemsPatch {
    theta: [f64; 2],
    phi: [f64; 2],
}

impl KlemsPatch {
    /// Returns all patches in the order of the format.
    pub(super) fn all() -> Vec<Self> {
        let mut lower = 0;
        let mut patches = Vec::with_capacity(PATCHES);
        for (_, upper, count) in RINGS {
            let theta = [lower, upper].map(|degrees: u32| f64::from(degrees).to_radians());
            let edge = |k: f64| (k - 0.5) / count as f64 * TAU;
            patches.extend((0..count).map(|k| Self { theta, phi: [edge(k as f64), edge(k as f64 + 1.0)] }));
            lower = upper;
        }
        patches
    }

    /// Returns `side²` directions that represent equal projected solid angles.
    pub(super) fn directions(&self, side: usize) -> Vec<DVec3> {
        let [low, high] = self.theta.map(|theta| theta.sin().powi(2));
        let along = |range: [f64; 2], k: usize| range[0] + (range[1] - range[0]) * (k as f64 + 0.5) / side as f64;
        let cells = (0..side * side).map(|k| (k / side, k % side));
        cells
            .map(|(ring, step)| {
                let (sine, phi) = (along([low, high], ring).sqrt(), along(self.phi, step));
                DVec3::new(sine * phi.cos(), sine * phi.sin(), (1.0 - sine * sine).sqrt())
            })
            .collect()
    }

    /// Projected solid angle [sr].
    pub(super) fn projected_solid_angle(&self) -> f64 {
        let [low, high] = self.theta.map(|theta| theta.sin().powi(2));
        0.5 * (high - low) * (self.phi[1] - self.phi[0])
    }

    /// Returns the index of the patch that contains a direction.
    pub(super) fn index_of(direction: DVec3) -> usize {
        let theta = direction.x.hypot(direction.y).atan2(direction.z).to_degrees();
        let mut first = 0;
        for (_, upper, count) in RINGS {
            if theta <= f64::from(upper) {
                let patch = direction.y.atan2(direction.x) / TAU * count as f64 + 0.5;
                return first + patch.floor().rem_euclid(count as f64) as usize;
            }
            first += count;
        }
        PATCHES - 1
    }
}

/// Returns the direction towards the light for an incident direction of the format. Radiance numbers incident patches
/// by the direction that the light travels in.
pub(super) fn source_of(direction: DVec3) -> DVec3 {
    DVec3::new(-direction.x, -direction.y, direction.z)
}

pub fn tabulate(task: &ExportTask<'_>) -> io::Result<(Content, Written)> {
    let patches = KlemsPatch::all();
    let leaving: Vec<Vec3> =
        patches.iter().flat_map(|patch| patch.directions(LEAVING)).map(|direction| direction.as_vec3()).collect();
    // By reciprocity, one call evaluates all leaving directions for one incident direction.
    let columns: Vec<Vec<Vec3>> = in_parallel(PATCHES, task.progress, |incident| {
        let mut sums = vec![DVec3::ZERO; PATCHES];
        for direction in patches[incident].directions(INCIDENT) {
            let mut values = vec![Vec3::ZERO; leaving.len()];
            task.brdf.eval_lights(&leaving, source_of(direction).as_vec3(), &mut values);
            for (sum, (values, leaving)) in
                sums.iter_mut().zip(values.chunks(LEAVING * LEAVING).zip(leaving.chunks(LEAVING * LEAVING)))
            {
                *sum += values.iter().zip(leaving).map(|(value, o)| value.as_dvec3() / f64::from(o.z)).sum::<DVec3>();
            }
        }
        sums.into_iter().map(|sum| (sum / (INCIDENT * INCIDENT * LEAVING * LEAVING) as f64).as_vec3()).collect()
    })?;
    let mut channels = ["CIE-X", "Visible", "CIE-Z"].map(|name| (name, String::new()));
    for leaving in 0..PATCHES {
        for column in &columns {
            let value = xyz(column[leaving]);
            for ((_, text), value) in channels.iter_mut().zip(value.to_array()) {
                let _ = write!(text, "{:.5e}\t", value.max(0.0));
            }
        }
        channels.iter_mut().for_each(|(_, text)| text.push('\n'));
    }
    let read = |i: Vec3, o: Vec3| {
        let column = &columns[KlemsPatch::index_of(source_of(o.as_dvec3()))];
        rgb(xyz(column[KlemsPatch::index_of(i.as_dvec3())])) * i.z
    };
    let conventions = vec![
        "Klems full basis: 145 incident (columns) by 145 leaving (rows) patches, each the mean over its patch.".to_owned(),
        "Incident patches are numbered by the direction that the light travels in, as WINDOW does: phi turned by 180 degrees.".to_owned(),
        "Patches are 10 degrees wide: highlights narrower than that are spread over them; hemispherical totals stay.".to_owned(),
    ];
    let reading = reading_error(task.brdf, read);
    let written = Written { pairs: PATCHES * PATCHES, reading, conventions, anisotropy_lost: None };
    let zeros = format!("{}\n", "0\t".repeat(PATCHES)).repeat(PATCHES);
    Ok((Content { definition: definition(), basis: BASIS, channels, black: zeros }, written))
}

pub(super) const BASIS: &str =
    "<ColumnAngleBasis>LBNL/Klems Full</ColumnAngleBasis>\n<RowAngleBasis>LBNL/Klems Full</RowAngleBasis>";

pub(super) fn definition() -> String {
    let mut text = "<IncidentDataStructure>Columns</IncidentDataStructure>\n<AngleBasis>\n<AngleBasisName>LBNL/Klems Full</AngleBasisName>\n".to_owned();
    let mut lower = 0;
    for (middle, upper, count) in RINGS {
        let _ = writeln!(
            text,
            "<AngleBasisBlock>\n<Theta>{middle}</Theta>\n<nPhis>{count}</nPhis>\n<ThetaBounds>\n<LowerTheta>{lower}</LowerTheta>\n\
             <UpperTheta>{upper}</UpperTheta>\n</ThetaBounds>\n</AngleBasisBlock>"
        );
        lower = upper;
    }
    text.push_str("</AngleBasis>\n");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_contain_their_directions_and_fill_the_projected_hemisphere() {
        let patches = KlemsPatch::all();
        assert_eq!(patches.len(), PATCHES);
        let mut total = 0.0;
        for (k, patch) in patches.iter().enumerate() {
            assert!(patch.directions(4).into_iter().all(|direction| KlemsPatch::index_of(direction) == k), "{k}");
            total += patch.projected_solid_angle();
        }
        assert!((total - 0.5 * TAU).abs() < 1e-9);
    }
}
