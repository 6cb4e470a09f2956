//! Mirror planes of a tile: then half of the directions tell the other half.

use glam::{Vec2, Vec3};

use super::TileMesh;
use crate::visibility::PeriodicGrid;

/// Places that are compared, and planes that are tried along each axis.
const PLACES: usize = 256;
const MOST_PLANES: usize = 128;
/// Heights, in tile sizes, and normals that differ by less are the same.
const SAME_HEIGHT: f32 = 1e-4;
const SAME_NORMAL: f32 = 1e-3;

/// Is the tile its own mirror image in a plane x = const, and in one y = const? Shape, slots and colours are compared along
/// vertical lines, through all that lies above each other.
pub fn mirror_planes(mesh: &TileMesh) -> [bool; 2] {
    if mesh.triangles.is_empty() {
        return [false; 2];
    }
    let looks = Looks { mesh, grid: PeriodicGrid::new(mesh), bottom: mesh.z_range().0 };
    let places: Vec<(Vec2, Vec<Seen>)> = (0..PLACES).map(|k| at(&looks, k)).collect();
    [0, 1].map(|axis| candidates(mesh, axis).iter().any(|sum| looks.is_mirrored(&places, axis, *sum)))
}

fn at(looks: &Looks, k: usize) -> (Vec2, Vec<Seen>) {
    // The R2 sequence, away from round numbers where edges lie.
    let part = |step: f64| ((k as f64 + 0.317) * step).fract() as f32;
    let place = Vec2::new(part(0.754_877_666_246_692_8), part(0.569_840_290_998_053_3)) * looks.mesh.size;
    (place, looks.down(place))
}

/// Sums `x + x'` that planes could have: a highest vertex mirrors onto one of the same height.
fn candidates(mesh: &TileMesh, axis: usize) -> Vec<f32> {
    let top = mesh.z_range().1;
    let size = mesh.size[axis];
    let near = |z: f32| (z - top).abs() <= SAME_HEIGHT * mesh.size.max_element();
    let mut highest: Vec<f32> = mesh.positions.iter().filter(|p| near(p.z)).map(|p| p[axis].rem_euclid(size)).collect();
    highest.sort_by(f32::total_cmp);
    highest.dedup_by(|a, b| (*a - *b).abs() < 1e-5 * size);
    let Some(&first) = highest.first() else { return Vec::new() };
    highest.iter().take(MOST_PLANES).map(|x| first + x).collect()
}

struct Looks<'a> {
    mesh: &'a TileMesh,
    grid: PeriodicGrid,
    bottom: f32,
}

/// Surfaces above each other that are compared.
const MOST_LAYERS: usize = 16;

/// What a vertical line meets.
#[derive(Debug, Clone, Copy)]
struct Seen {
    height: f32,
    normal: Vec3,
    slot: u16,
    color: Vec3,
}

impl Looks<'_> {
    /// All that the vertical line meets, from the top down.
    fn down(&self, place: Vec2) -> Vec<Seen> {
        let (mut layers, mut start) = (Vec::new(), self.grid.top() + 1.0);
        let step = SAME_HEIGHT * self.mesh.size.max_element();
        while let Some(hit) = self.grid.nearest(place.extend(start), Vec3::NEG_Z, self.bottom - 1.0) {
            let triangle = hit.triangle as usize;
            layers.push(Seen {
                height: hit.position.z,
                normal: self.mesh.geometric_normal(triangle),
                slot: self.mesh.slot_at(triangle, place),
                color: self.mesh.color.at(place, self.mesh.size),
            });
            start = hit.position.z - step;
            if layers.len() == MOST_LAYERS {
                break;
            }
        }
        layers
    }

    fn is_mirrored(&self, places: &[(Vec2, Vec<Seen>)], axis: usize, sum: f32) -> bool {
        let size = self.mesh.size;
        let mut differ = 0;
        for (place, seen) in places {
            let mut mirrored = *place;
            mirrored[axis] = (sum - place[axis]).rem_euclid(size[axis]);
            let same = |a: &Seen, b: &Seen| {
                let mut normal = b.normal;
                normal[axis] = -normal[axis];
                (a.height - b.height).abs() <= SAME_HEIGHT * size.max_element()
                    && (a.normal - normal).abs().max_element() <= SAME_NORMAL
                    && a.slot == b.slot
                    && (a.color - b.color).abs().max_element() <= SAME_NORMAL
            };
            let other = self.down(mirrored);
            let same = seen.len() == other.len() && seen.iter().zip(&other).all(|(a, b)| same(a, b));
            // A ray that falls on an edge may take either side.
            differ += usize::from(!same);
            if differ > PLACES / 100 {
                return false;
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use glam::UVec2;

    use super::*;
    use crate::geometry::{build, heightfield};

    fn of(toml: &str) -> TileMesh {
        let scene = crate::scene::parse(&format!("[tile]\ngeometry = {toml}\n")).unwrap();
        build(&scene.tile, std::path::Path::new("")).unwrap()
    }

    #[test]
    fn grooves_and_waves_have_the_planes_that_they_were_made_with() {
        let v = r#"{ kind = "grooves", profile = "v", count = 3, depth = 0.1, side_angle_deg = 40, rotation_deg = 0 }"#;
        assert_eq!(mirror_planes(&of(v)), [true, true]);
        let size = Vec2::ONE;
        let crooked = |at: Vec2| 0.1 * (TAU * (at.x + at.y)).cos() + 0.03 * (2.0 * TAU * at.x + 0.7).sin();
        let mesh = heightfield::from_function(UVec2::splat(32), size, crooked);
        assert_eq!(mirror_planes(&mesh), [false, false]);
        // A saw along x, straight along y.
        let mesh = heightfield::from_function(UVec2::splat(32), size, |at| 0.1 * at.x);
        assert_eq!(mirror_planes(&mesh), [false, true]);
    }

    #[test]
    fn a_plain_weave_has_both_planes_and_a_twill_has_not() {
        assert_eq!(mirror_planes(&of(r#"{ kind = "weave", pattern = "plain" }"#)), [true, true]);
        assert_ne!(mirror_planes(&of(r#"{ kind = "weave", pattern = "twill" }"#)), [true, true]);
    }

    #[test]
    fn slots_that_differ_break_the_mirror() {
        let mut mesh = of(
            r#"{ kind = "grooves", profile = "trapezoid", count = 2, depth = 0.1, side_angle_deg = 45, rotation_deg = 0 }"#,
        );
        assert_eq!(mirror_planes(&mesh), [true, true]);
        let marked = mesh.slots.len() as u16;
        mesh.slots.push("marked".to_owned());
        // One wall of one groove is made of something else.
        let wall = (0..mesh.triangles.len()).find(|t| mesh.geometric_normal(*t).x.abs() > 0.5).unwrap();
        let normal = mesh.geometric_normal(wall);
        for triangle in 0..mesh.triangles.len() {
            if (mesh.geometric_normal(triangle) - normal).length() < 1e-3 {
                mesh.triangle_slot[triangle] = marked;
            }
        }
        assert!(!mirror_planes(&mesh)[0]);
    }
}
