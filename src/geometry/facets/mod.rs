//! Facets: planar samples of the small-scale surface (Wu et al. 2011, Sec. 3.2).

pub(crate) mod kd_tree;
pub(crate) mod normal_bins;
pub(crate) mod order;
pub(crate) mod voronoi;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::TileMesh;
use super::families::triangle_points::TrianglePoints;

/// Minimum number of facets or triangles per parallel task.
pub(crate) const MIN_ITEMS_PER_TASK: usize = 2048;

/// Samples of the surface, with one entry per facet in each array. Areas sum to the surface area of the tile.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Facets {
    /// Centres, wrapped into the tile in x and y.
    pub positions: Vec<Vec3>,
    /// Unit normals that reflect: interpolated if the mesh has vertex normals, else geometric.
    pub normals: Vec<Vec3>,
    /// Unit geometric normals.
    pub geometric_normals: Vec<Vec3>,
    /// Areas ΔA in squared tile units.
    pub areas: Vec<f32>,
    /// Material slot of each facet.
    pub slots: Vec<u16>,
    /// Colour weight of the tile's colour field at each centre.
    pub colors: Vec<Vec3>,
    /// Triangle of each facet. A ray from the facet ignores it.
    pub triangles: Vec<u32>,
    /// Number of triangles left out because they have no area.
    pub skipped_triangles: usize,
}

impl Facets {
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Takes `count` systematic samples; `seed` shifts them.
    pub fn sample(mesh: &TileMesh, count: usize, seed: u64) -> Self {
        FacetSampler::new(mesh).sample(mesh, count, SampleShift::from_seed(seed))
    }

    /// The facets with the given indices, in this order.
    pub fn subset(&self, indices: &[usize]) -> Self {
        fn entries<T: Copy>(column: &[T], indices: &[usize]) -> Vec<T> {
            indices.iter().map(|&index| column[index]).collect()
        }
        Self {
            positions: entries(&self.positions, indices),
            normals: entries(&self.normals, indices),
            geometric_normals: entries(&self.geometric_normals, indices),
            areas: entries(&self.areas, indices),
            slots: entries(&self.slots, indices),
            colors: entries(&self.colors, indices),
            triangles: entries(&self.triangles, indices),
            skipped_triangles: self.skipped_triangles,
        }
    }

    /// Adds a facet at a point of a triangle.
    pub(crate) fn push(&mut self, mesh: &TileMesh, triangle: u32, barycentric: Vec3, area: f32) {
        let index = triangle as usize;
        let position = point_in_tile(mesh, index, barycentric);
        let geometric = mesh.geometric_normal(index);
        self.positions.push(position);
        self.normals.push(interpolated_normal(mesh, index, barycentric).unwrap_or(geometric));
        self.geometric_normals.push(geometric);
        self.areas.push(area);
        self.slots.push(mesh.slot_at(index, position.truncate()));
        self.colors.push(mesh.color.at(position.truncate(), mesh.size));
        self.triangles.push(triangle);
    }
}

/// A point of a triangle, wrapped into the tile.
fn point_in_tile(mesh: &TileMesh, triangle: usize, barycentric: Vec3) -> Vec3 {
    let [a, b, c] = mesh.corners(triangle);
    wrap(a * barycentric.x + b * barycentric.y + c * barycentric.z, mesh.size)
}

/// Interpolated normal at a point of a triangle; `None` if the mesh has no vertex normals or they cancel.
fn interpolated_normal(mesh: &TileMesh, triangle: usize, barycentric: Vec3) -> Option<Vec3> {
    let [a, b, c] = mesh.corner_normals.as_ref()?[triangle];
    (a * barycentric.x + b * barycentric.y + c * barycentric.z).try_normalize()
}

/// Moves a position by whole tiles into `[0, size)`.
fn wrap(position: Vec3, size: Vec2) -> Vec3 {
    let wrapped_into = |x: f32, size: f32| {
        if (0.0..size).contains(&x) {
            return x;
        }
        let wrapped = x.rem_euclid(size);
        // A tiny negative x rounds to the size itself.
        if wrapped < size { wrapped } else { 0.0 }
    };
    Vec3::new(wrapped_into(position.x, size.x), wrapped_into(position.y, size.y), position.z)
}

/// Shifts of a systematic sample, each in `[0, 1)`. Each shift gives another sample of the same surface.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SampleShift {
    /// Shift along the cumulative area, in strata.
    pub along: f32,
    /// Shift of the points inside their triangles, on the unit torus.
    pub inside: Vec2,
}

impl SampleShift {
    /// The shift of pass `seed`. Shifts of successive passes fill the unit cube evenly (R3 sequence; Roberts 2018).
    /// Pass 0 is centred.
    pub fn from_seed(seed: u64) -> Self {
        // The steps are 1/g, 1/g² and 1/g³, with the positive root g of x⁴ = x + 1.
        let at = |step: f64| (0.5 + (seed % (1 << 40)) as f64 * step).fract() as f32;
        let below_one = |x: f32| x.min(1f32.next_down());
        Self {
            along: below_one(at(0.819_172_513_396_164_4)),
            inside: Vec2::new(below_one(at(0.671_043_606_703_789_2)), below_one(at(0.549_700_477_901_970_3))),
        }
    }
}

/// The cumulative area of a mesh's triangles along a Morton curve through normals and positions, from which facets are
/// sampled.
#[derive(Debug, Clone)]
pub struct FacetSampler {
    order: Vec<u32>,
    /// Area of all triangles up to and including `order[k]`.
    cumulative: Vec<f64>,
    skipped: usize,
}

impl FacetSampler {
    pub fn new(mesh: &TileMesh) -> Self {
        let triangles = (0..mesh.triangles.len()).into_par_iter().with_min_len(MIN_ITEMS_PER_TASK);
        let strata: Vec<Option<(u32, f64)>> = triangles.map(|triangle| stratum_and_area(mesh, triangle)).collect();
        // Equal strata are in the order of triangles, so the order is deterministic.
        let keyed = |(triangle, stratum): (usize, &Option<(u32, f64)>)| {
            stratum.map(|(stratum, _)| u64::from(stratum) << 32 | triangle as u64)
        };
        let mut keyed: Vec<u64> = strata.iter().enumerate().filter_map(keyed).collect();
        let skipped = mesh.triangles.len() - keyed.len();
        keyed.sort_unstable();
        let order: Vec<u32> = keyed.into_iter().map(|key| key as u32).collect();
        let mut sum = 0.0;
        let accumulate = |triangle: &u32| {
            sum += strata[*triangle as usize].map_or(0.0, |(_, area)| area);
            sum
        };
        let cumulative = order.iter().map(accumulate).collect();
        Self { order, cumulative, skipped }
    }

    /// Surface area of the tile.
    pub fn area(&self) -> f64 {
        self.cumulative.last().copied().unwrap_or(0.0)
    }

    /// The triangle at a fraction `at` in `[0, 1)` of the cumulative area.
    pub(crate) fn triangle_at(&self, at: f64) -> u32 {
        let k = self.cumulative.partition_point(|sum| *sum <= at * self.area());
        self.order[k.min(self.order.len() - 1)]
    }

    /// Takes systematic samples. Facet k lies on the triangle at `(k + shift)/count` of the cumulative area, at a point
    /// of [`TrianglePoints`], and represents the area `area/count`. The result is empty for a mesh without area.
    pub fn sample(&self, mesh: &TileMesh, count: usize, shift: SampleShift) -> Facets {
        let mut facets = Facets { skipped_triangles: self.skipped, ..Facets::default() };
        if self.order.is_empty() {
            return facets;
        }
        let triangles = self.triangles_of_facets(count, shift.along);
        let points = TrianglePoints::new(mesh, &triangles, shift.inside);
        let each = || triangles.par_iter().with_min_len(MIN_ITEMS_PER_TASK).enumerate();
        let at = |(s, triangle): (usize, &u32)| point_in_tile(mesh, *triangle as usize, fold(points.point(s)));
        facets.positions = each().map(at).collect();
        facets.geometric_normals = each().map(|(s, _)| points.geometric_normal(s)).collect();
        facets.normals = if mesh.corner_normals.is_some() {
            let normal = |(s, triangle): (usize, &u32)| {
                interpolated_normal(mesh, *triangle as usize, fold(points.point(s)))
                    .unwrap_or_else(|| points.geometric_normal(s))
            };
            each().map(normal).collect()
        } else {
            facets.geometric_normals.clone()
        };
        facets.areas = vec![(self.area() / count as f64) as f32; count];
        let points =
            || facets.positions.par_iter().with_min_len(MIN_ITEMS_PER_TASK).map(|position| position.truncate());
        facets.slots = points().zip(&triangles).map(|(point, t)| mesh.slot_at(*t as usize, point)).collect();
        facets.colors = points().map(|point| mesh.color.at(point, mesh.size)).collect();
        facets.triangles = triangles;
        facets
    }

    /// The triangle of each of `count` facets.
    fn triangles_of_facets(&self, count: usize, along: f32) -> Vec<u32> {
        let (mut k, area) = (0, self.area());
        let next = |facet| {
            let target = (facet as f64 + f64::from(along)) / count as f64 * area;
            while k + 1 < self.order.len() && self.cumulative[k] <= target {
                k += 1;
            }
            self.order[k]
        };
        (0..count).map(next).collect()
    }
}

/// A triangle's stratum and area, or `None` if it has no area or is not finite.
fn stratum_and_area(mesh: &TileMesh, triangle: usize) -> Option<(u32, f64)> {
    let corners = mesh.corners(triangle);
    let normal = mesh.geometric_normal(triangle);
    let is_sound = corners.iter().all(|corner| corner.is_finite()) && normal != Vec3::ZERO;
    is_sound.then(|| {
        let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
        let position = wrap(centre, mesh.size).truncate() / mesh.size;
        (stratum(normal, position), mesh.triangle_area(triangle))
    })
}

/// Folds a point of the unit square onto barycentric coordinates.
pub(crate) fn fold(point: Vec2) -> Vec3 {
    let point = if point.x + point.y > 1.0 { Vec2::ONE - point } else { point };
    Vec3::new(1.0 - point.x - point.y, point.x, point.y)
}

/// Index along a Morton curve through normal and position. A systematic selection along this curve samples evenly the
/// normals, which lobes depend on, and the positions, which shadows depend on. A curve through positions alone has a
/// larger error on glossy surfaces. An order by the rows of a height field has a larger error if the stride of the
/// selection divides the row.
fn stratum(normal: Vec3, position: Vec2) -> u32 {
    let axes = [0.5 + 0.5 * normal.x, 0.5 + 0.5 * normal.y, position.x, position.y];
    axes.iter().fold(0, |key, v| key << 1 | spread(((v * 256.0) as u32).min(255)))
}

/// Spreads the bits of a byte to every fourth bit.
fn spread(byte: u32) -> u32 {
    let halves = (byte | byte << 12) & 0x000f_000f;
    let pairs = (halves | halves << 6) & 0x0303_0303;
    (pairs | pairs << 3) & 0x1111_1111
}

/// Estimates `A cos θ_o` of a surface without shadows from facets, for tests of sampling.
#[cfg(test)]
pub(crate) fn unshadowed_projected_area(facets: &Facets, theta: f32, phi: f32) -> f64 {
    let o = crate::math::directions::from_angles(theta, phi).as_dvec3();
    let term = |(normal, area): (&Vec3, &f32)| normal.as_dvec3().dot(o).max(0.0) * f64::from(*area);
    facets.geometric_normals.iter().zip(&facets.areas).map(term).sum()
}
