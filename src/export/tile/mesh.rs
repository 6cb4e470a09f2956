//! The tile's triangles as OBJ in tile coordinates. The geometry `mesh` reads this file.

use std::fmt::Write as _;

use super::TileOptions;
use crate::base::{Progress, Result, progress};
use crate::geometry::TileMesh;

pub fn obj(mesh: &TileMesh, options: &TileOptions, progress: &Progress<'_>) -> Result<(Vec<u8>, Vec<String>)> {
    let size = mesh.size.as_dvec2();
    let mut text = format!("# tile {} x {}, z up; slots are materials\n", size.x, size.y);
    let periods: Vec<(u32, u32)> =
        (0..options.repeat.y).flat_map(|y| (0..options.repeat.x).map(move |x| (x, y))).collect();
    let vertices = periods.len() * mesh.positions.len();
    for (period, &(x, y)) in periods.iter().enumerate() {
        for (k, p) in mesh.positions.iter().enumerate() {
            progress::step(&progress::part(progress, 0.0, 0.4), period * mesh.positions.len() + k, vertices)?;
            let (px, py) = (f64::from(p.x) + f64::from(x) * size.x, f64::from(p.y) + f64::from(y) * size.y);
            let _ = writeln!(text, "v {} {} {}", px as f32, py as f32, p.z);
        }
    }
    if let Some(normals) = &mesh.corner_normals {
        for normal in normals.iter().flatten() {
            let _ = writeln!(text, "vn {} {} {}", normal.x, normal.y, normal.z);
        }
    }
    let mut written = 0;
    for (slot, name) in mesh.slots.iter().enumerate() {
        let _ = writeln!(text, "usemtl {name}");
        for period in 0..periods.len() {
            let first = period * mesh.positions.len() + 1;
            let of_slot = (0..mesh.triangles.len()).filter(|&t| usize::from(mesh.slot_of(t)) == slot);
            for triangle in of_slot {
                progress::step(&progress::part(progress, 0.4, 1.0), written, periods.len() * mesh.triangles.len())?;
                written += 1;
                text.push('f');
                for (corner, vertex) in mesh.triangles[triangle].iter().enumerate() {
                    let _ = write!(text, " {}", first + *vertex as usize);
                    if mesh.corner_normals.is_some() {
                        let _ = write!(text, "//{}", 3 * triangle + corner + 1);
                    }
                }
                text.push('\n');
            }
        }
    }
    let note =
        "tile coordinates, z up; triangles may reach over the tile's edge, and slots stand as `usemtl`".to_owned();
    Ok((text.into_bytes(), vec![note]))
}
