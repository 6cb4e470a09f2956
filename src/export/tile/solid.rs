//! A closed solid to print, as binary STL in millimetres: the surface as visible from above, four walls and a floor.

use glam::{DVec3, Vec3};

use super::TileOptions;
use super::heights::SampledHeights;
use crate::base::{Progress, Result, progress};
use crate::geometry::TileMesh;

pub fn stl(
    mesh: &TileMesh,
    options: &TileOptions,
    unit_mm: f64,
    progress: &Progress<'_>,
) -> Result<(Vec<u8>, Vec<String>)> {
    let heights = SampledHeights::from_above(mesh, options.samples, 0.0, &progress::part(progress, 0.0, 0.3))?;
    let scale = unit_mm * f64::from(options.scale);
    let triangles = solid(&heights, mesh, options, scale, &progress::part(progress, 0.3, 0.5))?;
    let mut bytes = vec![0; 80];
    let title = b"biscale tile, millimetres";
    bytes[..title.len()].copy_from_slice(title);
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for (k, [a, b, c]) in triangles.iter().enumerate() {
        progress::step(&progress::part(progress, 0.5, 1.0), k, triangles.len())?;
        let normal = (*b - *a).cross(*c - *a).try_normalize().unwrap_or(Vec3::Z);
        bytes.extend([normal, *a, *b, *c].iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes));
        bytes.extend([0, 0]);
    }
    let size = mesh.size.as_dvec2() * options.repeat.as_dvec2() * scale;
    let step = mesh.size.as_dvec2() / options.samples.as_dvec2() * scale;
    let mut notes = vec![
        format!("a closed solid of {:.3} x {:.3} mm, {} triangles", size.x, size.y, triangles.len()),
        format!(
            "heights every {:.4} x {:.4} mm as seen from above: upright walls lean by one step, overhangs are filled",
            step.x, step.y
        ),
    ];
    if heights.holes > 0 {
        notes.push(format!(
            "{} of {} samples are holes and stand at the lowest height",
            heights.holes,
            heights.values.len()
        ));
    }
    Ok((bytes, notes))
}

/// Returns the triangles in millimetres, counter-clockwise as viewed from outside.
pub(super) fn solid(
    heights: &SampledHeights,
    mesh: &TileMesh,
    options: &TileOptions,
    scale: f64,
    progress: &Progress<'_>,
) -> Result<Vec<[Vec3; 3]>> {
    let [columns, rows] = (heights.count * options.repeat).to_array();
    let step = mesh.size.as_dvec2() / heights.count.as_dvec2() * scale;
    let (low, _) = heights.range();
    let longer = (mesh.size * options.repeat.as_vec2()).max_element();
    let base = options.base_mm.map_or(0.1 * f64::from(longer) * scale, f64::from);
    // The floor is at z = 0.
    let lift = base - low * scale;
    let top = |i: u32, j: u32| -> Vec3 {
        DVec3::new(f64::from(i) * step.x, f64::from(j) * step.y, heights.at(i, j) * scale + lift).as_vec3()
    };
    let mut triangles = Vec::new();
    for j in 0..rows {
        progress::report(progress, j as f32 / rows as f32)?;
        for i in 0..columns {
            let (a, b, c, d) = (top(i, j), top(i + 1, j), top(i + 1, j + 1), top(i, j + 1));
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    // The rim runs counter-clockwise as viewed from above.
    let south = (0..columns).map(|i| (i, 0));
    let east = (0..rows).map(|j| (columns, j));
    let north = (0..columns).map(|i| (columns - i, rows));
    let west = (0..rows).map(|j| (0, rows - j));
    let rim: Vec<Vec3> = south.chain(east).chain(north).chain(west).map(|(i, j)| top(i, j)).collect();
    let middle = Vec3::new(0.5 * columns as f32 * step.x as f32, 0.5 * rows as f32 * step.y as f32, 0.0);
    for (k, &from) in rim.iter().enumerate() {
        let to = rim[(k + 1) % rim.len()];
        let (under, next) = (from.with_z(0.0), to.with_z(0.0));
        triangles.extend([[under, next, to], [under, to, from], [next, under, middle]]);
    }
    Ok(triangles)
}
