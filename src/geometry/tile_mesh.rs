//! The triangle mesh of one period of the small-scale surface.

use std::sync::Arc;

use glam::{UVec2, Vec2, Vec3};

use super::relief::surface_point;
use crate::color_map::layers::LayeredMap;

/// Difference per component up to which normals count as equal. It covers the rounding of coordinates.
pub(crate) const SAME_NORMAL: f32 = 2e-5;

/// One period of an endlessly repeated surface: x in `[0, size.x)`, y in `[0, size.y)`, z up. Triangles may reach over
/// the tile's edge and are never cut; their periodic copies enter on the other side.
#[derive(Debug, Clone, Default)]
pub struct TileMesh {
    /// Size of the period in x and y, in tile units.
    pub size: Vec2,
    pub positions: Vec<Vec3>,
    /// Vertex indices, counter-clockwise seen from the side that reflects.
    pub triangles: Vec<[u32; 3]>,
    /// Corner normals of each triangle if the source has them (`vn`), else `None`, and normals are geometric.
    pub corner_normals: Option<Vec<[Vec3; 3]>>,
    /// Index into `slots` per triangle.
    pub triangle_slot: Vec<u16>,
    /// Names of the material slots.
    pub slots: Vec<String>,
    /// Colour weights that vary over the tile.
    pub color: ColorField,
    /// Slots painted over the triangles' slots.
    pub painted_slots: Option<SlotField>,
    /// Samples of the surface if it is a height field.
    pub height_grid: Option<HeightGrid>,
    /// True if each ray from above ends on a side that reflects. Then `a_v(o) = A cos θ_o` holds with geometric
    /// normals.
    pub closes_plane: bool,
    /// Notes for the user on parameters that the mesh does not meet exactly (snapped rotations, rounded counts).
    pub notes: Vec<String>,
}

/// Material slots over the tile, seen from above.
#[derive(Debug, Clone)]
pub struct SlotField {
    pub size: UVec2,
    /// Texels, row 0 at y = 0, without interpolation. The value 0 leaves the triangle's slot; k is slot `first + k -
    /// 1`.
    pub texels: Arc<Vec<u8>>,
    /// Index of the slot `paint_1` in the mesh.
    pub first: u16,
}

/// Colour weights over the tile, multiplied with a material's own colour.
#[derive(Debug, Clone, Default)]
pub enum ColorField {
    #[default]
    Uniform,
    /// Linear RGB texels, row 0 at y = 0, sampled bilinearly and wrapped; texel centres at `((i+½)/w, (j+½)/h)`.
    Image { size: UVec2, texels: Arc<Vec<Vec3>> },
    /// A colour map of the surface's place, height and slope, times the field below it.
    Mapped { map: Arc<LayeredMap>, below: Box<ColorField> },
}

/// Samples of a height field. Sample (i, j) lies at `((i+½)/w, (j+½)/h)` of the tile, row 0 at y = 0, wrapped.
#[derive(Debug, Clone, PartialEq)]
pub struct HeightGrid {
    pub size: UVec2,
    /// Heights in tile units, row by row.
    pub heights: Vec<f32>,
}

impl TileMesh {
    /// Corner positions of a triangle.
    #[inline]
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|index| self.positions[index as usize])
    }

    /// The material slot of a triangle at tile coordinates `xy`, wrapped.
    pub fn slot_at(&self, triangle: usize, xy: Vec2) -> u16 {
        self.painted_slot(xy).unwrap_or(self.triangle_slot[triangle])
    }

    /// The slot that is painted at tile coordinates `xy`, wrapped.
    pub(crate) fn painted_slot(&self, xy: Vec2) -> Option<u16> {
        self.painted_slots.as_ref().and_then(|field| field.at(xy, self.size))
    }

    /// The slot at the centre of a triangle.
    pub fn slot_of(&self, triangle: usize) -> u16 {
        let [a, b, c] = self.corners(triangle);
        self.slot_at(triangle, ((a + b + c) / 3.0).truncate())
    }

    /// Unit geometric normal; zero for a triangle without area.
    #[inline]
    pub fn geometric_normal(&self, triangle: usize) -> Vec3 {
        triangle_normal(self.corners(triangle))
    }

    /// Area of a triangle.
    #[inline]
    pub fn triangle_area(&self, triangle: usize) -> f64 {
        let [a, b, c] = self.corners(triangle).map(|p| p.as_dvec3());
        0.5 * (b - a).cross(c - a).length()
    }

    /// Lowest and highest z of all vertices; `(0, 0)` for an empty mesh.
    pub fn z_range(&self) -> (f32, f32) {
        let range =
            self.positions.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), p| (lo.min(p.z), hi.max(p.z)));
        if range.0 <= range.1 { range } else { (0.0, 0.0) }
    }

    /// Number of distinct triangle normals; `None` if there are more than `max` or if normals vary inside triangles.
    pub fn distinct_normals(&self, max: usize) -> Option<usize> {
        let mut found: Vec<Vec3> = Vec::new();
        for triangle in 0..self.triangles.len() {
            let normal = self.geometric_normal(triangle);
            if normal != Vec3::ZERO && !found.iter().any(|known| (*known - normal).abs().max_element() < SAME_NORMAL) {
                found.push(normal);
            }
            if found.len() > max {
                return None;
            }
        }
        self.corner_normals.is_none().then_some(found.len())
    }

    /// Returns whether the surface has one height at each (x, y), apart from vertical walls. Then it has no overhangs.
    pub fn is_height_field(&self) -> bool {
        let mut projected = 0.0;
        for triangle in 0..self.triangles.len() {
            let [a, b, c] = self.corners(triangle).map(|p| p.as_dvec3());
            let area_normal = 0.5 * (b - a).cross(c - a);
            if area_normal.z < -1e-6 * area_normal.length() {
                return false;
            }
            projected += area_normal.z;
        }
        let base = f64::from(self.base_area());
        self.closes_plane && (projected - base).abs() <= 1e-3 * base
    }

    /// Base area `A` of the tile.
    pub fn base_area(&self) -> f32 {
        self.size.x * self.size.y
    }
}

/// Unit normal of a triangle; zero for a triangle without area.
#[inline]
pub(crate) fn triangle_normal(corners: [Vec3; 3]) -> Vec3 {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    (b - a).cross(c - a).try_normalize().unwrap_or_default().as_vec3()
}

impl SlotField {
    /// The slot painted at tile coordinates `xy` of a tile of size `tile_size`, or `None` if there is none.
    fn at(&self, xy: Vec2, tile_size: Vec2) -> Option<u16> {
        let cell = (xy / tile_size * self.size.as_vec2()).floor();
        let wrapped = |at: f32, count: u32| (at as i64).rem_euclid(i64::from(count)) as usize;
        let (x, y) = (wrapped(cell.x, self.size.x), wrapped(cell.y, self.size.y));
        let value = u16::from(self.texels[y * self.size.x as usize + x]);
        (value > 0).then(|| self.first + value - 1)
    }
}

impl ColorField {
    /// The image under a colour map, or the field itself.
    pub fn image(&self) -> &Self {
        match self {
            Self::Mapped { below, .. } => below.image(),
            field => field,
        }
    }

    /// Largest weight of each channel.
    pub fn max(&self) -> Vec3 {
        match self {
            Self::Uniform => Vec3::ONE,
            // Bilinear interpolation stays below the largest texel.
            Self::Image { texels, .. } => texels.iter().copied().fold(Vec3::ZERO, Vec3::max),
            Self::Mapped { map, below } => map.max() * below.max(),
        }
    }

    /// Colour weight of a point with this position and normal, on a tile of size `tile_size`. Only colour maps depend on
    /// the height and the normal.
    pub fn at(&self, position: Vec3, normal: Vec3, tile_size: Vec2) -> Vec3 {
        let xy = position.truncate();
        match self {
            Self::Mapped { map, below } => {
                map.color(&surface_point(tile_size, position, normal)) * below.at(position, normal, tile_size)
            }
            Self::Uniform => Vec3::ONE,
            Self::Image { size, texels } => {
                let at = xy / tile_size * size.as_vec2() - 0.5;
                let (base, f) = (at.floor(), at - at.floor());
                let texel = |dx: i64, dy: i64| {
                    let x = (base.x as i64 + dx).rem_euclid(i64::from(size.x)) as usize;
                    let y = (base.y as i64 + dy).rem_euclid(i64::from(size.y)) as usize;
                    texels[y * size.x as usize + x]
                };
                let row = |dy| texel(0, dy).lerp(texel(1, dy), f.x);
                row(0).lerp(row(1), f.y)
            }
        }
    }
}
