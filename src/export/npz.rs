//! Tables as `.npz`: a ZIP archive of `.npy` arrays for `numpy.load` (NumPy Enhancement Proposal 1).

use std::io::{self, Write};

use super::grid::ExportGrid;
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
    axes(&mut zip, grid)?;
    array(&mut zip, "brdf", "f4", &[ti, pi, to, po, 3], bytemuck::cast_slice(&table.brdf))?;
    array(&mut zip, "g", "f4", &[ti, pi, to, po, 3], bytemuck::cast_slice(&table.g))?;
    array(&mut zip, "projected_area", "f4", &[to, po], bytemuck::cast_slice(&table.projected_area))?;
    array(&mut zip, "base_area", "f8", &[], bytemuck::bytes_of(&description.base_area))?;
    array(&mut zip, "resampling_rel_l2", "f8", &[], bytemuck::bytes_of(&description.resampling_rel_l2))?;
    array(&mut zip, "seed", "u8", &[], bytemuck::bytes_of(&description.meta.seed))?;
    text(&mut zip, &description.json()?)?;
    zip.finish()
}

/// Adds the arrays `theta_i`, `phi_i`, `theta_o` and `phi_o`.
pub(super) fn axes(zip: &mut ZipWriter<'_>, grid: &ExportGrid) -> io::Result<()> {
    let axes = [
        ("theta_i", &grid.light.theta),
        ("phi_i", &grid.light.phi),
        ("theta_o", &grid.view.theta),
        ("phi_o", &grid.view.phi),
    ];
    axes.into_iter().try_for_each(|(name, axis)| array(zip, name, "f4", &[axis.len()], bytemuck::cast_slice(axis)))
}

/// Adds the array `meta`, a text in unicode.
pub(super) fn text(zip: &mut ZipWriter<'_>, text: &str) -> io::Result<()> {
    let letters: Vec<u32> = text.chars().map(u32::from).collect();
    array(zip, "meta", &format!("U{}", letters.len()), &[], bytemuck::cast_slice(&letters))
}
