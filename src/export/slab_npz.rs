//! A slab as `.npz`: transmission, reflection of both sides, and the parts that keep or mirror their direction.

use std::io::{self, Write};
use std::path::Path;

use glam::{DVec3, Vec3};

use super::grid::{ExportGrid, ExportResolution};
use super::meta::{FRAME, PROGRAM};
use super::npz::{array, axes, text};
use crate::base::progress::in_parallel;
use crate::base::zip::ZipWriter;
use crate::base::{Progress, Result, atomic_file, check_output, require_finite};
use crate::scene::LoadedScene;
use crate::slab::Slab;

/// Tables of a slab over a grid of directions.
struct SlabTables {
    grid: ExportGrid,
    /// BTDF [1/sr] by light above and viewer below.
    btdf: Vec<Vec3>,
    /// BRDF [1/sr] of the top face, then of the bottom face, each by light and viewer on its side.
    brdf: Vec<Vec3>,
    /// Straight and mirrored parts, each for light from above, then for light from below.
    straight: Vec<Vec3>,
    mirrored: Vec<Vec3>,
}

/// Writes the f32 arrays `theta_i`, `phi_i`, `theta_o`, `phi_o`, `btdf[ti,pi,to,po,3]`, `brdf[side,ti,pi,to,po,3]`,
/// `straight[side,ti,pi,3]`, `mirrored[side,ti,pi,3]`, and `meta` (JSON in unicode). Returns the number of pairs.
///
/// # Errors
/// A resolution out of range, a path that cannot be written, or [`crate::Error::Cancelled`].
pub fn write(
    slab: &Slab,
    loaded: &LoadedScene,
    resolution: ExportResolution,
    path: &Path,
    progress: &Progress<'_>,
) -> Result<usize> {
    resolution.check()?;
    check_output(path, &[])?;
    let tables = SlabTables::new(slab, resolution, progress)?;
    atomic_file::write_atomically(path, |out| tables.write(&meta(slab, loaded), out))?;
    Ok(3 * tables.grid.pairs())
}

fn meta(slab: &Slab, loaded: &LoadedScene) -> String {
    serde_json::json!({
        "program": PROGRAM,
        "scene": loaded.name,
        "frame": FRAME,
        "btdf": "rho(i, o) in 1/sr, linear RGB, without straight light and without the light's cosine; i is above (theta_i from +z), \
                 o below (theta_o from -z). rho(i, o) = rho(o, i) gives light from below",
        "brdf": "side 0: both directions above, theta from +z; side 1: both below, theta from -z; without mirrored light",
        "straight": "part of the light that keeps its direction; side 0: light from above, side 1: from below",
        "mirrored": "part of the light that level facets mirror, by the side of the light",
        "nodes": "theta_a = (a+1/2) (pi/2) / N_theta, phi_b = 2 pi b / N_phi",
        "eta": slab.optics.eta.to_array(),
        "thickness": slab.optics.thickness,
        "absorption": slab.optics.absorption.to_array(),
    })
    .to_string()
}

impl SlabTables {
    fn new(slab: &Slab, resolution: ExportResolution, progress: &Progress<'_>) -> Result<Self> {
        let grid = resolution.grid();
        let lights: Vec<DVec3> = grid.light.directions().iter().map(|i| i.as_dvec3()).collect();
        let viewers: Vec<DVec3> = grid.view.directions().iter().map(|o| o.as_dvec3()).collect();
        let over = DVec3::new(1.0, 1.0, -1.0);
        let rows = in_parallel(lights.len(), progress, |k| {
            let i = lights[k];
            let from_above = slab.row(i);
            let row =
                |value: &dyn Fn(DVec3) -> DVec3| viewers.iter().map(|o| value(*o).as_vec3()).collect::<Vec<Vec3>>();
            let values = [
                row(&|o| from_above.btdf(o * over)),
                row(&|o| slab.brdf(i, o)),
                row(&|o| slab.brdf(i * over, o * over)),
            ];
            (values, [slab.straight(i), slab.straight(i * over)].map(|side| side.map(|part| part.as_vec3())))
        })?;
        let rows = &rows;
        let table = |kind: usize| rows.iter().flat_map(move |(values, _)| values[kind].iter().copied());
        let part = |kind: usize| (0..2).flat_map(|side| rows.iter().map(move |(_, parts)| parts[side][kind])).collect();
        let tables = Self {
            btdf: table(0).collect(),
            brdf: table(1).chain(table(2)).collect(),
            straight: part(0),
            mirrored: part(1),
            grid,
        };
        require_finite(&tables.btdf)?;
        require_finite(&tables.brdf)?;
        Ok(tables)
    }

    fn write(&self, meta: &str, out: &mut dyn Write) -> io::Result<()> {
        let mut zip = ZipWriter::new(out);
        let [ti, pi, to, po] = self.grid.shape();
        axes(&mut zip, &self.grid)?;
        array(&mut zip, "btdf", "f4", &[ti, pi, to, po, 3], bytemuck::cast_slice(&self.btdf))?;
        array(&mut zip, "brdf", "f4", &[2, ti, pi, to, po, 3], bytemuck::cast_slice(&self.brdf))?;
        array(&mut zip, "straight", "f4", &[2, ti, pi, 3], bytemuck::cast_slice(&self.straight))?;
        array(&mut zip, "mirrored", "f4", &[2, ti, pi, 3], bytemuck::cast_slice(&self.mirrored))?;
        text(&mut zip, meta)?;
        zip.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::Pipeline;
    use crate::scene;

    #[test]
    fn tables_hold_the_slab_at_their_nodes_and_conserve_light_without_absorption() {
        let loaded = scene::open("slab_fig3_both", &["quality.preset=draft".into(), "slab.bounces=on".into()]).unwrap();
        let slab = Pipeline::new().slab(&loaded).unwrap().slab;
        let resolution = ExportResolution { theta_i: 3, phi_i: 2, theta_o: 32, phi_o: 64 };
        let tables = SlabTables::new(&slab, resolution, &|_| true).unwrap();
        let (lights, viewers) = (tables.grid.light.directions(), tables.grid.view.directions());
        let (i, o) = (lights[1].as_dvec3(), viewers[70].as_dvec3());
        let over = DVec3::new(1.0, 1.0, -1.0);
        assert_eq!(tables.btdf[viewers.len() + 70], slab.btdf(i, o * over).as_vec3());
        assert_eq!(tables.brdf[tables.btdf.len() + viewers.len() + 70], slab.brdf(i * over, o * over).as_vec3());
        let cell = |o: &Vec3| {
            o.z * (1.0 - o.z * o.z).sqrt() * (0.5 * std::f32::consts::PI / 32.0) * (std::f32::consts::TAU / 64.0)
        };
        let sum: f32 = viewers.iter().enumerate().map(|(k, o)| cell(o) * (tables.btdf[k].x + tables.brdf[k].x)).sum();
        let total = sum + tables.straight[0].x + tables.mirrored[0].x;
        assert!((total - 1.0).abs() < 0.03, "{total}");
    }
}
