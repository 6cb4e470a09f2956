//! A vertical section through the tile, parallel to its x axis.

use crate::geometry::TileMesh;
use glam::{Vec2, Vec3};

/// Number of sections that are tried.
const TRIED: usize = 48;
/// Place of a section between two of [`TRIED`] steps. Planes through the vertices of regular tiles would be degenerate.
const PLACE: f32 = 0.47;
/// Distance of a section from the highest point, in lengths of the tile.
const BESIDE: f32 = 1e-3;

/// The lines in which a plane of constant y cuts the tile and its neighbours.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Section {
    /// Place of the plane [tile units].
    pub y: f32,
    /// Width of the tile along x [tile units].
    pub width: f32,
    /// Lowest and highest point [tile units].
    pub z: [f32; 2],
    /// Lines over x and z, of the tile alone.
    pub lines: Vec<[Vec2; 2]>,
}

impl Section {
    /// The section with the largest range of heights of a few, of which one is beside the highest point.
    pub fn of(mesh: &TileMesh) -> Self {
        let at = |k: usize| Self::at(mesh, (k as f32 + PLACE) / TRIED as f32 * mesh.size.y);
        let highest = mesh.positions.iter().max_by(|a, b| a.z.total_cmp(&b.z)).map_or(0.0, |point| point.y);
        let beside = Self::at(mesh, (highest + BESIDE * mesh.size.y).rem_euclid(mesh.size.y));
        let mut best = at(TRIED / 2);
        for section in (0..TRIED).map(at).chain([beside]) {
            // Rounding must not decide between equal sections.
            if section.height() > 1.01 * best.height() {
                best = section;
            }
        }
        best
    }

    pub fn height(&self) -> f32 {
        self.z[1] - self.z[0]
    }

    fn at(mesh: &TileMesh, y: f32) -> Self {
        let mut lines = Vec::new();
        for triangle in &mesh.triangles {
            let corners = triangle.map(|corner| mesh.positions[corner as usize]);
            let [low, high] = range(corners.map(|corner| corner.y));
            // Triangles may lie outside of the tile, which repeats.
            let [first, last] = [low, high].map(|end| ((y - end) / mesh.size.y).floor() as i32);
            for period in last..=first {
                lines.extend(cut(corners, y - period as f32 * mesh.size.y));
            }
        }
        let heights = lines.iter().flatten().map(|point| point.y);
        let z = heights.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], z| [low.min(z), high.max(z)]);
        let z = if lines.is_empty() { [0.0; 2] } else { z };
        Self { y, width: mesh.size.x, z, lines }
    }
}

fn range(values: [f32; 3]) -> [f32; 2] {
    let (low, high) = (f32::min, f32::max);
    [values.into_iter().fold(f32::INFINITY, low), values.into_iter().fold(f32::NEG_INFINITY, high)]
}

/// The line over x and z in which the plane cuts a triangle.
fn cut(corners: [Vec3; 3], y: f32) -> Option<[Vec2; 2]> {
    let mut ends = (0..3).filter_map(|k| {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        if (a.y < y) == (b.y < y) {
            return None;
        }
        let at = a.lerp(b, (y - a.y) / (b.y - a.y));
        Some(Vec2::new(at.x, at.z))
    });
    Some([ends.next()?, ends.next()?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::Pipeline;
    use crate::scene::{LoadedScene, Painted};

    fn section(geometry: &str) -> Section {
        let scene = crate::scene::parse(&format!("[tile]\ngeometry = {geometry}\n")).unwrap();
        let loaded = LoadedScene { scene, base_dir: "".into(), name: "test".into(), painted: Painted::default() };
        Section::of(&Pipeline::new().mesh(&loaded).unwrap())
    }

    #[test]
    fn a_section_of_a_relief_covers_the_tile_with_its_depth() {
        for geometry in [
            "{ kind = \"flat\" }",
            "{ kind = \"grooves\", count = 3, depth = 0.25 }",
            "{ kind = \"pyramids\", spacing = 0.25, height = 0.1 }",
        ] {
            let section = section(geometry);
            // The lines lie side by side, so that their widths add up to that of the tile.
            let width: f32 = section.lines.iter().map(|[a, b]| (a.x - b.x).abs()).sum();
            assert!((width - section.width).abs() < 1e-3, "{geometry}: {width}");
        }
        assert_eq!(section("{ kind = \"flat\" }").height(), 0.0);
        assert!((section("{ kind = \"grooves\", count = 3, depth = 0.25 }").height() - 0.25).abs() < 1e-3);
        let height = section("{ kind = \"pyramids\", spacing = 0.25, height = 0.1 }").height();
        assert!(height > 0.098 && height <= 0.1001, "{height}");
    }

    #[test]
    fn a_section_of_a_weave_has_lines_above_each_other() {
        let section = section("{ kind = \"weave\" }");
        let width: f32 = section.lines.iter().map(|[a, b]| (a.x - b.x).abs()).sum();
        assert!(width > 1.5 * section.width, "{width}");
    }
}
