//! The endlessly repeated tile as one direction sees it: a small lattice cell to draw a toroidal map over.
//!
//! Along ω every point `p` lands on `q = p.xy - p.z ω.xy/ω.z` of the base plane, and the picture there repeats with the
//! tile (DESIGN.md, Sec. 4). Drawn in `q` itself, a map is badly shaped at grazing angles: a triangle is stretched by
//! tan θ, hundreds of tiles long at 89.9°, while the texels lie cos θ times denser along the azimuth than across it as
//! the viewer sees them. But a lattice has many cells. Seen along ω the tile's lattice has a cell of area `A cos θ`, and
//! Lagrange's reduction in the viewer's metric finds its most compact basis (angles of 60° to 120°). In that
//! basis texels are nearly square to the viewer and no triangle is longer than it is in space, at any angle.

use glam::{DMat2, DVec2, Vec2, Vec3};

use crate::geometry::TileMesh;

/// cos θ of the most grazing direction a map is drawn for, 89.99°; lower ones above the horizon are raised to it.
pub const LOWEST_COSINE: f64 = 1.745e-4;

/// What lies nearer than this many texels does not block. Only facetted neighbourhoods need it, where the triangles are as
/// small as the texels: measured on a 128x128 egg-crate with 256 texels 0.31 % wrong without, 0.03 % with any of 0.03
/// to 0.3, while rods on a floor begin to lose contact shadows at 0.3.
const NEAR_TEXELS: f64 = 0.15;

/// Texels along the longer side of the widest map.
const MAX_SIDE: f64 = 8192.0;
/// Texels along the shorter side of the narrowest map.
const MIN_SIDE: f64 = 8.0;

/// Texels that the triangles of one map may cover together: a surface of hundreds of base areas (heights of 100 tiles) is
/// drawn more coarsely.
const MAX_COVERED: f64 = 4_194_304.0;

/// The resolution at which a mesh's maps are drawn where `resolution` is asked for.
pub fn affordable(mesh: &TileMesh, resolution: u32) -> u32 {
    let surface: f64 = (0..mesh.triangles.len()).map(|k| mesh.triangle_area(k)).sum();
    let most = (MAX_COVERED * f64::from(mesh.base_area()) / surface.max(f64::MIN_POSITIVE)).sqrt();
    resolution.min(most.max(32.0) as u32)
}

/// Affine maps between the tile and one direction's toroidal map, and the tolerances that go with them.
///
/// Texel (i, j) stands for the ray through the texel coordinates (i, j) exactly; coordinates are modulo `size`.
#[derive(Debug, Clone, Copy)]
pub struct ShadowView {
    /// The direction, unit, `z > 0`.
    pub direction: Vec3,
    /// Texels along both basis vectors: the periods of the map.
    pub size: [u32; 2],
    /// Texel coordinates of a point: its dot products with these.
    pub texel_from_tile: [Vec3; 2],
    /// Steps on the base plane from a texel to the next one along each axis.
    pub plane_from_texel: [Vec2; 2],
    /// A hit nearer than this to a facet's plane does not block the facet [tile units].
    pub tolerance: f32,
}

impl ShadowView {
    /// The view of a tile of extent `tile_size` along `direction`, `extent` being the largest coordinate of its vertices
    /// in magnitude; `None` where the direction is not above the horizon or anything is not finite.
    ///
    /// `resolution` is the number of texels along the side of a square tile seen from above. Texels shrink with √cos θ,
    /// so that all maps hold about `resolution²` of them: what is visible shrinks with cos θ.
    pub fn new(tile_size: Vec2, extent: f32, direction: Vec3, resolution: u32) -> Option<Self> {
        let direction = direction.as_dvec3().try_normalize()?;
        let usable = direction.z > 0.0 && tile_size.is_finite() && tile_size.min_element() > 0.0 && extent.is_finite();
        if !usable {
            return None;
        }
        let cos = direction.z.max(LOWEST_COSINE);
        let azimuth = direction.truncate().try_normalize().unwrap_or(DVec2::X);
        let shear = azimuth * ((1.0 - cos * cos).max(0.0).sqrt() / cos);
        let direction = (shear * cos).extend(cos);

        let seen = |v: DVec2| DVec2::new(v.dot(azimuth) * cos, v.perp_dot(azimuth));
        let tile = tile_size.as_dvec2();
        let (v, w) = reduced_basis(DVec2::new(tile.x, 0.0), DVec2::new(0.0, tile.y), seen);

        let spacing = (tile.x * tile.y * cos).sqrt() / f64::from(resolution.max(1));
        let side = |v: DVec2| (seen(v).length() / spacing).round().clamp(MIN_SIDE, MAX_SIDE);
        let (columns, rows) = (side(v), side(w));
        let plane_from_texel = DMat2::from_cols(v / columns, w / rows);
        let texel_from_plane = plane_from_texel.inverse();
        let row = |k: usize| {
            let r = texel_from_plane.row(k);
            r.extend(-r.dot(shear)).as_vec3()
        };
        let texel_from_tile = [row(0), row(1)];
        let steps = [plane_from_texel.x_axis.as_vec2(), plane_from_texel.y_axis.as_vec2()];

        // Besides: rounding of texel coordinates, in texels, times the longest step; and of heights, along the ray.
        let rounding = 4.0 * f32::EPSILON * extent;
        let texels = rounding * texel_from_tile[0].length().max(texel_from_tile[1].length());
        let tolerance =
            texels * steps[0].length().max(steps[1].length()) + rounding / cos as f32 + (NEAR_TEXELS * spacing) as f32;
        let view = Self {
            direction: direction.as_vec3(),
            size: [columns as u32, rows as u32],
            texel_from_tile,
            plane_from_texel: steps,
            tolerance,
        };
        texel_from_tile.iter().all(|row| row.is_finite()).then_some(view)
    }

    /// Number of texels in the map.
    pub fn texels(&self) -> usize {
        self.size[0] as usize * self.size[1] as usize
    }

    /// Texel coordinates of a point, not wrapped.
    pub fn texel(&self, p: Vec3) -> Vec2 {
        Vec2::new(self.texel_from_tile[0].dot(p), self.texel_from_tile[1].dot(p))
    }
}

/// The largest coordinate of the mesh's vertices in magnitude, and of the tile.
pub fn extent(mesh: &TileMesh) -> f32 {
    mesh.positions.iter().fold(mesh.size.abs().max_element(), |most, p| most.max(p.abs().max_element()))
}

/// Lagrange's reduction: the two shortest vectors that span the same lattice, lengths as `seen`.
fn reduced_basis(mut v: DVec2, mut w: DVec2, seen: impl Fn(DVec2) -> DVec2) -> (DVec2, DVec2) {
    // Each round but the last shortens a vector by at least √3; 64 rounds cover any ratio an f64 shear can make.
    for _ in 0..64 {
        if seen(w).length_squared() < seen(v).length_squared() {
            (v, w) = (w, -v);
        }
        let turns = (seen(v).dot(seen(w)) / seen(v).length_squared()).round();
        if turns == 0.0 || !turns.is_finite() {
            break;
        }
        w -= turns * v;
    }
    (v, w)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(theta_deg: f32, phi_deg: f32) -> Vec3 {
        let (theta, phi) = (theta_deg.to_radians(), phi_deg.to_radians());
        Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
    }

    fn views() -> impl Iterator<Item = ShadowView> {
        [0.0, 30.0, 60.0, 85.0, 89.0, 89.9].into_iter().flat_map(|theta| {
            (0..24)
                .filter_map(move |k| ShadowView::new(Vec2::new(1.0, 1.5), 2.0, at(theta, 15.0 * k as f32 + 1.0), 256))
        })
    }

    #[test]
    fn neighbouring_tiles_land_on_whole_periods_of_the_map() {
        for view in views() {
            for step in [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.5, 0.0)] {
                let texel = view.texel(step);
                let periods = texel / Vec2::new(view.size[0] as f32, view.size[1] as f32);
                assert!((periods - periods.round()).length() < 1e-4, "{view:?}: {periods}");
            }
        }
    }

    #[test]
    fn points_on_one_ray_share_a_texel() {
        for view in views() {
            let p = Vec3::new(0.3, 0.9, 0.2);
            let moved = view.texel(p + 0.1 * view.direction) - view.texel(p);
            assert!(moved.length() < 2e-3, "{view:?}: {moved}");
        }
    }

    #[test]
    fn every_map_is_compact_and_holds_about_resolution_squared_texels() {
        for view in views() {
            let texels = view.texels() as f32 / (256.0 * 256.0);
            assert!((0.97..1.2).contains(&texels), "{view:?}");
            // What a unit length across the view covers, in texels: bounded by the shape of the cell, not by tan θ.
            let across = view.texel_from_tile.map(|row| row.length());
            let spacing = (1.5 * view.direction.z).sqrt() / 256.0;
            assert!(across.iter().all(|length| length * spacing < 1.3), "{view:?}");
        }
    }

    #[test]
    fn directions_under_the_horizon_and_broken_ones_have_no_view() {
        let view = |direction| ShadowView::new(Vec2::ONE, 1.0, direction, 64);
        for direction in [Vec3::X, Vec3::NEG_Z, Vec3::ZERO, Vec3::NAN, Vec3::new(f32::INFINITY, 0.0, 1.0)] {
            assert!(view(direction).is_none(), "{direction}");
        }
        assert!(ShadowView::new(Vec2::ZERO, 1.0, Vec3::Z, 64).is_none());
        let lowest = view(Vec3::new(1.0, 0.0, 1e-6)).unwrap();
        assert!((f64::from(lowest.direction.z) - LOWEST_COSINE).abs() < 1e-9);
    }
}
