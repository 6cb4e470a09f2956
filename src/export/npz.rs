//! Tables as `.npz`: a ZIP archive of `.npy` arrays for `numpy.load` (NumPy Enhancement Proposal 1).

use std::io::{self, Write};

use super::meta::Description;
use super::table::ExportTable;
pub(super) use crate::base::npz::array;
use crate::base::zip::ZipWriter;

/// Writes the f32 arrays `theta_i`, `phi_i`, `theta_o`, `phi_o`, `brdf[ti,pi,to,po,3]`, `g[ti,pi,to,po,3]` and
/// `projected_area[to,po]`, and the scalars `base_area`, `resampling_rel_l2` (f64), `seed` (u64) and `meta` (JSON in
/// unicode).
pub fn write(table: &ExportTable, description: &Description<'_>, out: &mut dyn Write) -> io::Result<()> {
    let mut zip = ZipWriter::new(out);
    let grid = &table.grid;
    let [ti, pi, to, po] = grid.shape();
    let axes = [
        ("theta_i", &grid.light.theta),
        ("phi_i", &grid.light.phi),
        ("theta_o", &grid.view.theta),
        ("phi_o", &grid.view.phi),
    ];
    for (name, axis) in axes {
        array(&mut zip, name, "f4", &[axis.len()], bytemuck::cast_slice(axis))?;
    }
    array(&mut zip, "brdf", "f4", &[ti, pi, to, po, 3], bytemuck::cast_slice(&table.brdf))?;
    array(&mut zip, "g", "f4", &[ti, pi, to, po, 3], bytemuck::cast_slice(&table.g))?;
    array(&mut zip, "projected_area", "f4", &[to, po], bytemuck::cast_slice(&table.projected_area))?;
    array(&mut zip, "base_area", "f8", &[], bytemuck::bytes_of(&description.base_area))?;
    array(&mut zip, "resampling_rel_l2", "f8", &[], bytemuck::bytes_of(&description.resampling_rel_l2))?;
    array(&mut zip, "seed", "u8", &[], bytemuck::bytes_of(&description.meta.seed))?;
    let meta: Vec<u32> = description.json()?.chars().map(u32::from).collect();
    array(&mut zip, "meta", &format!("U{}", meta.len()), &[], bytemuck::cast_slice(&meta))?;
    zip.finish()
}
