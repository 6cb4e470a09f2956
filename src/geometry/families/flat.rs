//! The plane, with one slot or divided between two.

use glam::{DVec2, Vec2};

use super::builder::MeshBuilder;
use crate::geometry::TileMesh;
use crate::scene::{Flat, FlatPattern};

const FIRST: u16 = 0;
const SECOND: u16 = 1;

pub fn build(spec: &Flat, size: Vec2) -> TileMesh {
    let edges = |periods: u32| -> Vec<f64> {
        let ratio = f64::from(spec.ratio);
        let inner = (0..periods).flat_map(|k| [f64::from(k), f64::from(k) + ratio]).map(|at| at / f64::from(periods));
        inner.chain([1.0]).collect()
    };
    let whole = vec![0.0, 1.0];
    let (columns, rows) = match spec.pattern {
        FlatPattern::Plain => (whole.clone(), whole),
        FlatPattern::Stripes => (edges(spec.count), whole),
        FlatPattern::Checks => (edges(spec.count), edges(spec.count)),
    };
    let slots: &[&str] = if spec.pattern == FlatPattern::Plain { &["default"] } else { &["first", "second"] };
    let mut builder = MeshBuilder::new(size, slots);
    let size = size.as_dvec2();
    for (j, y) in rows.windows(2).enumerate() {
        for (i, x) in columns.windows(2).enumerate() {
            if x[0] == x[1] || y[0] == y[1] {
                continue;
            }
            let slot = match spec.pattern {
                FlatPattern::Plain => FIRST,
                FlatPattern::Stripes => i as u16 % 2,
                FlatPattern::Checks if i % 2 == j % 2 => FIRST,
                FlatPattern::Checks => SECOND,
            };
            let corner = |x: f64, y: f64| (DVec2::new(x, y) * size).extend(0.0);
            builder.polygon(&[corner(x[0], y[0]), corner(x[1], y[0]), corner(x[1], y[1]), corner(x[0], y[1])], slot);
        }
    }
    builder.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::closure::assert_closes_plane;

    #[test]
    fn stripes_and_checks_share_the_area_by_the_ratio() {
        for (pattern, expected) in [(FlatPattern::Stripes, 0.3), (FlatPattern::Checks, 0.3 * 0.3 + 0.7 * 0.7)] {
            let mesh = build(&Flat { pattern, ratio: 0.3, ..Flat::default() }, Vec2::new(2.0, 1.0));
            let first: f64 = (0..mesh.triangles.len())
                .filter(|&t| mesh.triangle_slot[t] == FIRST)
                .map(|t| mesh.triangle_area(t))
                .sum();
            assert!((first - 2.0 * expected).abs() < 1e-6);
            assert_closes_plane(&mesh);
            assert!(mesh.is_height_field());
        }
    }

    #[test]
    fn a_plain_plane_has_the_slot_default_and_extreme_ratios_use_one_slot() {
        assert_eq!(build(&Flat::default(), Vec2::ONE).slots, ["default"]);
        for ratio in [0.0, 1.0] {
            let mesh = build(&Flat { pattern: FlatPattern::Stripes, ratio, ..Flat::default() }, Vec2::ONE);
            assert_closes_plane(&mesh);
            assert!(mesh.triangle_slot.iter().all(|slot| *slot == if ratio == 0.0 { SECOND } else { FIRST }));
        }
    }
}
