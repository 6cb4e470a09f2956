//! Projection of the endlessly repeated tile along one direction onto a toroidal map.
//!
//! The projection along ω maps a point `p` to `q = p.xy - p.z ω.xy/ω.z` on the base plane, and the projected surface
//! repeats with the tile. A map with axes along the tile's would be badly shaped at grazing angles: triangles are
//! stretched by tan θ, hundreds of tiles at 89.9°, and to the viewer texels are cos θ times denser along the azimuth
//! than across it.
//!
//! The lattice of the tile has other bases. Projected along ω, a cell of the lattice has the area A cos θ. Lagrange's
//! reduction in the viewer's metric finds the most compact basis, with an angle of 60° to 120°. In that basis, texels
//! are nearly square to the viewer, and no triangle is longer than in space, at any angle.

use glam::{DMat2, DVec2, Vec2, Vec3};

use crate::geometry::TileMesh;

/// cos θ of the most grazing direction of a map, 89.99°. Lower directions above the horizon are raised to it.
pub const MIN_COSINE: f64 = 1.745e-4;

/// Distance to a facet's plane, in texels, up to which a hit does not block. It prevents false shadows if triangles are
/// as small as texels. Larger values remove contact shadows.
const MIN_BLOCKER_DISTANCE: f64 = 0.15;

/// Maximum number of texels along a side of a map.
const MAX_SIDE: f64 = 8192.0;
/// Minimum number of texels along a side of a map.
const MIN_SIDE: f64 = 8.0;

/// Maximum number of texels that the triangles of one map cover together. A surface of hundreds of base areas is drawn
/// at a lower resolution.
const MAX_COVERED: f64 = 4_194_304.0;

/// Limits the requested resolution of a mesh's maps so that they cover at most [`MAX_COVERED`] texels.
pub fn affordable_resolution(mesh: &TileMesh, resolution: u32) -> u32 {
    let surface: f64 = (0..mesh.triangles.len()).map(|k| mesh.triangle_area(k)).sum();
    let limit = (MAX_COVERED * f64::from(mesh.base_area()) / surface.max(f64::MIN_POSITIVE)).sqrt();
    resolution.min(limit.max(32.0) as u32)
}

/// Affine maps between the tile and the toroidal map of one direction, with tolerances.
///
/// Texel (i, j) is the ray through the texel coordinates (i, j) exactly. Coordinates are modulo `size`.
#[derive(Debug, Clone, Copy)]
pub struct ShadowView {
    /// Unit direction, `z > 0`.
    pub direction: Vec3,
    /// Numbers of texels along both basis vectors, which are the periods of the map.
    pub size: [u32; 2],
    /// Linear map to texel coordinates: each coordinate is the dot product of a point with one of these vectors.
    pub texel_from_tile: [Vec3; 2],
    /// Steps on the base plane from a texel to the next one along each axis.
    pub plane_from_texel: [Vec2; 2],
    /// Distance of a hit from a facet's plane up to which it does not block the facet [tile units].
    pub tolerance: f32,
}

impl ShadowView {
    /// The projection of a tile of size `tile_size` along `direction`; `max_coordinate` is the largest absolute
    /// coordinate of its vertices. `None` if the direction is not above the horizon or any value is not finite.
    ///
    /// `resolution` is the number of texels along the side of a square tile, seen from above. The size of a texel is
    /// proportional to √(cos θ), so all maps have about `resolution²` texels.
    pub fn new(tile_size: Vec2, max_coordinate: f32, direction: Vec3, resolution: u32) -> Option<Self> {
        let direction = direction.as_dvec3().try_normalize()?;
        let usable =
            direction.z > 0.0 && tile_size.is_finite() && tile_size.min_element() > 0.0 && max_coordinate.is_finite();
        if !usable {
            return None;
        }
        let cos = direction.z.max(MIN_COSINE);
        let azimuth = direction.truncate().try_normalize().unwrap_or(DVec2::X);
        let shear = azimuth * ((1.0 - cos * cos).max(0.0).sqrt() / cos);
        let direction = (shear * cos).extend(cos);

        let in_view = |v: DVec2| DVec2::new(v.dot(azimuth) * cos, v.perp_dot(azimuth));
        let tile = tile_size.as_dvec2();
        let (v, w) = reduced_basis(DVec2::new(tile.x, 0.0), DVec2::new(0.0, tile.y), in_view);

        let spacing = (tile.x * tile.y * cos).sqrt() / f64::from(resolution.max(1));
        let side = |v: DVec2| (in_view(v).length() / spacing).round().clamp(MIN_SIDE, MAX_SIDE);
        let (columns, rows) = (side(v), side(w));
        let plane_from_texel = DMat2::from_cols(v / columns, w / rows);
        let texel_from_plane = plane_from_texel.inverse();
        let row = |k: usize| {
            let r = texel_from_plane.row(k);
            r.extend(-r.dot(shear)).as_vec3()
        };
        let texel_from_tile = [row(0), row(1)];
        let steps = [plane_from_texel.x_axis.as_vec2(), plane_from_texel.y_axis.as_vec2()];

        // The tolerance includes the rounding of texel coordinates, times the longest step, and of heights, along the
        // ray.
        let rounding = 4.0 * f32::EPSILON * max_coordinate;
        let texels = rounding * texel_from_tile[0].length().max(texel_from_tile[1].length());
        let tolerance = texels * steps[0].length().max(steps[1].length())
            + rounding / cos as f32
            + (MIN_BLOCKER_DISTANCE * spacing) as f32;
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

/// The largest absolute coordinate of the mesh's vertices and of the tile's size.
pub fn max_coordinate(mesh: &TileMesh) -> f32 {
    mesh.positions.iter().fold(mesh.size.abs().max_element(), |max, p| max.max(p.abs().max_element()))
}

/// Lagrange's reduction: the two shortest vectors that span the same lattice. `in_view` maps a vector to the metric.
fn reduced_basis(mut v: DVec2, mut w: DVec2, in_view: impl Fn(DVec2) -> DVec2) -> (DVec2, DVec2) {
    // Each round but the last shortens a vector by a factor of at least √3, so 64 rounds suffice for any f64 shear.
    for _ in 0..64 {
        if in_view(w).length_squared() < in_view(v).length_squared() {
            (v, w) = (w, -v);
        }
        let multiples = (in_view(v).dot(in_view(w)) / in_view(v).length_squared()).round();
        if multiples == 0.0 || !multiples.is_finite() {
            break;
        }
        w -= multiples * v;
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
            // Texels per unit length across the view: the shape of the cell bounds it, not tan θ.
            let across = view.texel_from_tile.map(|row| row.length());
            let spacing = (1.5 * view.direction.z).sqrt() / 256.0;
            assert!(across.iter().all(|length| length * spacing < 1.3), "{view:?}");
        }
    }

    #[test]
    fn directions_below_the_horizon_and_invalid_ones_have_no_view() {
        let view = |direction| ShadowView::new(Vec2::ONE, 1.0, direction, 64);
        for direction in [Vec3::X, Vec3::NEG_Z, Vec3::ZERO, Vec3::NAN, Vec3::new(f32::INFINITY, 0.0, 1.0)] {
            assert!(view(direction).is_none(), "{direction}");
        }
        assert!(ShadowView::new(Vec2::ZERO, 1.0, Vec3::Z, 64).is_none());
        let lowest = view(Vec3::new(1.0, 0.0, 1e-6)).unwrap();
        assert!((f64::from(lowest.direction.z) - MIN_COSINE).abs() < 1e-9);
    }
}
