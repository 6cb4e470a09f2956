//! Planar samples of the small-scale surface.

use glam::{Vec2, Vec3};

use super::TileMesh;

/// Samples of the surface, one entry a facet in every array. Areas sum to the surface area of the tile.
#[derive(Debug, Clone, Default)]
pub struct Facets {
    /// Centres, wrapped into the tile in x and y.
    pub positions: Vec<Vec3>,
    /// Unit normals that reflect: interpolated where the mesh has normals, else geometric.
    pub normals: Vec<Vec3>,
    /// Unit geometric normals.
    pub geometric_normals: Vec<Vec3>,
    /// Areas ΔA in squared tile units.
    pub areas: Vec<f32>,
    /// Material slot of each.
    pub slots: Vec<u16>,
    /// Colour weight of the tile's colour field at each centre.
    pub colors: Vec<Vec3>,
    /// The triangle each lies on: a ray that leaves a facet ignores it.
    pub triangles: Vec<u32>,
}

impl Facets {
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// `count` facets: triangles picked systematically along the cumulative area (in an order that keeps like normals and near places together) at `(k + shift)/count`, a point of the
    /// R2 sequence, offset by `offset`, inside each. Triangles without area or with corners that are not finite are passed over.
    pub fn sample(mesh: &TileMesh, count: usize, shift: f32, offset: Vec2) -> Self {
        let areas: Vec<f64> = (0..mesh.triangles.len()).map(|t| mesh.triangle_area(t)).map(|a| if a.is_finite() { a } else { 0.0 }).collect();
        let order = stratified_order(mesh);
        let areas: Vec<f64> = order.iter().map(|&t| areas[t as usize]).collect();
        let total: f64 = areas.iter().sum();
        let mut facets = Self::default();
        if total <= 0.0 || count == 0 {
            return facets;
        }
        let area = (total / count as f64) as f32;
        let (mut triangle, mut passed) = (0, areas[0]);
        for k in 0..count {
            let at = (k as f64 + f64::from(shift)) / count as f64 * total;
            while passed < at && triangle + 1 < areas.len() {
                triangle += 1;
                passed += areas[triangle];
            }
            let point = r2_point(k, offset);
            // Fold the square onto the triangle.
            let (u, v) = if point.x + point.y > 1.0 { (1.0 - point.x, 1.0 - point.y) } else { (point.x, point.y) };
            facets.push(mesh, order[triangle] as usize, [1.0 - u - v, u, v], area);
        }
        facets
    }

    /// The facets of one independent pass of the reference.
    pub fn sample_pass(mesh: &TileMesh, count: usize, seed: u64, pass: usize) -> Self {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(pass as u64 + 1);
        let shift = rng.random::<f32>();
        let offset = Vec2::new(rng.random(), rng.random());
        let mut facets = Self::sample(mesh, count, shift, offset);
        facets.sort_for_sums();
        facets
    }

    fn push(&mut self, mesh: &TileMesh, triangle: usize, weights: [f32; 3], area: f32) {
        let blend = |corners: [Vec3; 3]| corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
        let geometric = mesh.geometric_normal(triangle);
        let position = blend(mesh.corners(triangle));
        let wrapped = position.truncate() - (position.truncate() / mesh.size).floor() * mesh.size;
        self.positions.push(wrapped.extend(position.z));
        self.geometric_normals.push(geometric);
        self.normals.push(mesh.corner_normals.as_ref().map_or(geometric, |normals| blend(normals[triangle]).normalize_or(geometric)));
        self.areas.push(area);
        self.slots.push(mesh.triangle_slot[triangle]);
        self.colors.push(mesh.color.at(wrapped, mesh.size));
        self.triangles.push(triangle as u32);
    }
}

/// Point `k` of the R2 sequence (Roberts 2018), offset and wrapped into the unit square.
fn r2_point(k: usize, offset: Vec2) -> Vec2 {
    const G: f64 = 1.324_717_957_244_746;
    let at = |power: f64, offset: f32| ((k as f64 + 1.0) / power + f64::from(offset)).fract() as f32;
    Vec2::new(at(G, offset.x), at(G * G, offset.y))
}

/// Triangles along a Morton curve through normal and place together: a systematic selection along it samples evenly
/// what lobes see (normals) and what shadows see (places).
fn stratified_order(mesh: &TileMesh) -> Vec<u32> {
    const BITS: u32 = 8;
    let key = |t: u32| -> u32 {
        let [a, b, c] = mesh.corners(t as usize);
        let centre = ((a + b + c) / 3.0).truncate() / mesh.size;
        let place = centre - centre.floor();
        let normal = mesh.geometric_normal(t as usize);
        let axes = [0.5 + 0.5 * normal.x, 0.5 + 0.5 * normal.y, place.x, place.y];
        let steps = axes.map(|v| ((v * (1 << BITS) as f32) as u32).min((1 << BITS) - 1));
        (0..BITS).rev().fold(0, |key, bit| steps.iter().fold(key, |key, step| key << 1 | (step >> bit & 1)))
    };
    let mut order: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
    order.sort_by_cached_key(|&t| key(t));
    order
}
