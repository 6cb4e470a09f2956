//! Facets: planar samples of the small-scale surface (Wu et al. 2011, Sec. 3.2).

pub(crate) mod kd_tree;
mod level;
pub(crate) mod normal_bins;
pub(crate) mod openness;
pub(crate) mod order;
pub(crate) mod strata;
pub(crate) mod voronoi;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use self::strata::{Part, Strata, allocate};
use super::TileMesh;
use super::families::triangle_points::TrianglePoints;

/// Minimum number of facets or triangles per parallel task.
pub(crate) const MIN_ITEMS_PER_TASK: usize = 2048;

/// Number of replicates in the facets. Differences between replicates show the error of the facets. Six, three and two
/// steps of the R2 sequence of points lie far apart, so that each replicate, and each sum of replicates, is spread well.
pub const REPLICATES: usize = 6;

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
    /// Replicate of each facet, below [`REPLICATES`]. The facets of one replicate are a sample of the whole surface. Empty
    /// if the facets are not samples, but represent the surface exactly.
    pub replicates: Vec<u8>,
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

    /// Normals by which a colour map colours facets of this mesh: bins change only those that reflect.
    pub fn coloring_normals(&self, mesh: &TileMesh) -> &[Vec3] {
        if mesh.corner_normals.is_some() { &self.normals } else { &self.geometric_normals }
    }

    /// Returns true if a part of the surface has many more facets than its area asks for, because it is small, but may reflect
    /// much.
    pub fn has_rare_part(&self) -> bool {
        /// Smallest ratio of the area of a facet to the mean of all on a surface without rare parts.
        const MIN_RATIO: f32 = 0.25;
        let mean = self.areas.iter().sum::<f32>() / self.len() as f32;
        self.areas.iter().any(|&area| area < MIN_RATIO * mean)
    }

    /// Takes `count` systematic samples; `seed` shifts them.
    pub fn sample(mesh: &TileMesh, count: usize, seed: u64) -> Self {
        FacetSampler::new(mesh).sample(mesh, count, SampleShift::from_seed(seed))
    }

    /// The facets with the given indices, in this order.
    pub fn subset(&self, indices: &[usize]) -> Self {
        fn entries<T: Copy>(column: &[T], indices: &[usize]) -> Vec<T> {
            if column.is_empty() { Vec::new() } else { indices.iter().map(|&index| column[index]).collect() }
        }
        Self {
            positions: entries(&self.positions, indices),
            normals: entries(&self.normals, indices),
            geometric_normals: entries(&self.geometric_normals, indices),
            areas: entries(&self.areas, indices),
            slots: entries(&self.slots, indices),
            colors: entries(&self.colors, indices),
            triangles: entries(&self.triangles, indices),
            replicates: entries(&self.replicates, indices),
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
        self.colors.push(mesh.color.at(position, self.normals[self.normals.len() - 1], mesh.size));
        self.triangles.push(triangle);
        self.replicates.push((self.replicates.len() % REPLICATES) as u8);
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

/// The cumulative area of a mesh's triangles, from which facets are sampled. Triangles are sorted by stratum
/// ([`Strata`]), and within a stratum along a Morton curve through normals and positions.
///
/// A piece is a triangle of the mesh, by its index, or a part of one. Parts are numbered after the triangles.
#[derive(Debug, Clone)]
pub struct FacetSampler {
    order: Vec<u32>,
    /// Area of all pieces up to and including `order[k]`.
    cumulative: Vec<f64>,
    /// End of each stratum in `order`.
    ends: Vec<usize>,
    /// Number of triangles of the mesh.
    triangles: usize,
    parts: Vec<Part>,
    skipped: usize,
}

impl FacetSampler {
    pub fn new(mesh: &TileMesh) -> Self {
        let triangles = (0..mesh.triangles.len()).into_par_iter().with_min_len(MIN_ITEMS_PER_TASK);
        let keys: Vec<Option<(u32, f64)>> = triangles.map(|triangle| morton_and_area(mesh, triangle)).collect();
        let Strata { of_triangle, parts: divided } = Strata::new(mesh);
        let (parts, of_part): (Vec<Part>, Vec<u32>) = divided.into_iter().unzip();
        let count = mesh.triangles.len();
        let skipped = keys.iter().filter(|key| key.is_none()).count();
        let mut area: Vec<f64> = keys.iter().map(|key| key.map_or(0.0, |(_, area)| area)).collect();
        // Equal keys are in the order of pieces, so the order is deterministic.
        let packed = |morton: u32, piece: usize| u64::from(morton) << 32 | piece as u64;
        let whole =
            |(piece, stratum): (usize, &Option<u32>)| stratum.and(keys[piece]).map(|(morton, _)| packed(morton, piece));
        let mut keyed: Vec<u64> = of_triangle.iter().enumerate().filter_map(whole).collect();
        for (k, part) in parts.iter().enumerate() {
            let corners = corners_of_part(mesh, part);
            let [a, b, c] = corners.map(|p| p.as_dvec3());
            area.push(0.5 * (b - a).cross(c - a).length());
            if keys[part.triangle as usize].is_some() {
                let normal = mesh.geometric_normal(part.triangle as usize);
                keyed.push(packed(morton_of(mesh, normal, corners), count + k));
            }
        }
        keyed.sort_unstable();
        let stratum = |piece: u32| match (piece as usize).checked_sub(count) {
            None => of_triangle[piece as usize].unwrap_or_default(),
            Some(part) => of_part[part],
        };
        let mut order: Vec<u32> = keyed.into_iter().map(|key| key as u32).collect();
        let mut ends = vec![order.len()];
        if order.windows(2).any(|pieces| stratum(pieces[0]) != stratum(pieces[1])) {
            order.sort_by_key(|piece| stratum(*piece));
            ends = order.chunk_by(|a, b| stratum(*a) == stratum(*b)).map(<[u32]>::len).collect();
            let mut end = 0;
            ends.iter_mut().for_each(|length| {
                end += *length;
                *length = end;
            });
        }
        let mut sum = 0.0;
        let accumulate = |piece: &u32| {
            sum += area[*piece as usize];
            sum
        };
        let cumulative = order.iter().map(accumulate).collect();
        Self { order, cumulative, ends, triangles: count, parts, skipped }
    }

    /// Surface area of the tile.
    pub fn area(&self) -> f64 {
        self.cumulative.last().copied().unwrap_or(0.0)
    }

    /// The point with barycentric coordinates `at` on the piece at a fraction `along` in `[0, 1)` of the cumulative
    /// area: a triangle, and barycentric coordinates on it.
    pub(crate) fn point_at(&self, along: f64, at: Vec3) -> (u32, Vec3) {
        let k = self.cumulative.partition_point(|sum| *sum <= along * self.area());
        self.on_triangle(self.order[k.min(self.order.len() - 1)], at)
    }

    /// Takes systematic samples from each stratum. Facet k of n in a stratum lies on the piece at `(k + shift)/n` of the
    /// stratum's cumulative area, at a point of [`TrianglePoints`], and represents `1/n` of the stratum's area. The
    /// result is empty for a mesh without area.
    pub fn sample(&self, mesh: &TileMesh, count: usize, shift: SampleShift) -> Facets {
        let mut facets = Facets { skipped_triangles: self.skipped, ..Facets::default() };
        if self.order.is_empty() {
            return facets;
        }
        let pieces = self.pieces_of_facets(count, shift.along, &mut facets);
        let points = TrianglePoints::new(mesh.size, |piece| self.corners(mesh, piece), &pieces, shift.inside);
        facets.triangles = pieces.iter().map(|piece| self.on_triangle(*piece, Vec3::X).0).collect();
        let each = || pieces.par_iter().with_min_len(MIN_ITEMS_PER_TASK).enumerate();
        let point = |(s, piece): (usize, &u32)| self.on_triangle(*piece, fold(points.point(s)));
        let at = |facet: (usize, &u32)| {
            let (triangle, barycentric) = point(facet);
            point_in_tile(mesh, triangle as usize, barycentric)
        };
        facets.positions = each().map(at).collect();
        facets.geometric_normals = each().map(|(s, _)| points.geometric_normal(s)).collect();
        facets.normals = if mesh.corner_normals.is_some() {
            let normal = |facet: (usize, &u32)| {
                let (triangle, barycentric) = point(facet);
                interpolated_normal(mesh, triangle as usize, barycentric)
                    .unwrap_or_else(|| points.geometric_normal(facet.0))
            };
            each().map(normal).collect()
        } else {
            facets.geometric_normals.clone()
        };
        let points =
            || facets.positions.par_iter().with_min_len(MIN_ITEMS_PER_TASK).map(|position| position.truncate());
        facets.slots = points().zip(&facets.triangles).map(|(point, t)| mesh.slot_at(*t as usize, point)).collect();
        let oriented = facets.positions.par_iter().with_min_len(MIN_ITEMS_PER_TASK).zip(&facets.normals);
        facets.colors = oriented.map(|(position, normal)| mesh.color.at(*position, *normal, mesh.size)).collect();
        facets
    }

    /// The piece of each of `count` facets. Writes the areas and the replicates of the facets.
    fn pieces_of_facets(&self, count: usize, along: f32, facets: &mut Facets) -> Vec<u32> {
        // Too few facets for all strata are shared by the whole surface.
        let whole = [self.order.len()];
        let ends = if self.ends.len() <= count { &self.ends[..] } else { &whole };
        let sum_before = |k: usize| if k == 0 { 0.0 } else { self.cumulative[k - 1] };
        let starts = || std::iter::once(0).chain(ends.iter().copied());
        let areas: Vec<f64> = starts().zip(ends).map(|(start, end)| sum_before(*end) - sum_before(start)).collect();
        let mut pieces = Vec::with_capacity(count);
        for (((start, end), area), count) in starts().zip(ends).zip(&areas).zip(allocate(&areas, count)) {
            let (mut k, before) = (start, sum_before(start));
            for facet in 0..count {
                let target = before + (facet as f64 + f64::from(along)) / count as f64 * area;
                while k + 1 < *end && self.cumulative[k] <= target {
                    k += 1;
                }
                pieces.push(self.order[k]);
                facets.areas.push((area / count as f64) as f32);
                facets.replicates.push((facet % REPLICATES) as u8);
            }
        }
        pieces
    }

    /// The triangle of a piece, and a point of the piece in barycentric coordinates of the triangle.
    fn on_triangle(&self, piece: u32, at: Vec3) -> (u32, Vec3) {
        match (piece as usize).checked_sub(self.triangles).map(|part| &self.parts[part]) {
            None => (piece, at),
            Some(Part { triangle, corners: [a, b, c] }) => (*triangle, *a * at.x + *b * at.y + *c * at.z),
        }
    }

    fn corners(&self, mesh: &TileMesh, piece: u32) -> [Vec3; 3] {
        match (piece as usize).checked_sub(self.triangles) {
            None => mesh.corners(piece as usize),
            Some(part) => corners_of_part(mesh, &self.parts[part]),
        }
    }
}

fn corners_of_part(mesh: &TileMesh, part: &Part) -> [Vec3; 3] {
    let [a, b, c] = mesh.corners(part.triangle as usize);
    part.corners.map(|at| a * at.x + b * at.y + c * at.z)
}

/// Key along the Morton curve and area of a triangle, or `None` if it has no area or is not finite.
fn morton_and_area(mesh: &TileMesh, triangle: usize) -> Option<(u32, f64)> {
    let corners = mesh.corners(triangle);
    let normal = mesh.geometric_normal(triangle);
    let is_sound = corners.iter().all(|corner| corner.is_finite()) && normal != Vec3::ZERO;
    is_sound.then(|| (morton_of(mesh, normal, corners), mesh.triangle_area(triangle)))
}

fn morton_of(mesh: &TileMesh, normal: Vec3, corners: [Vec3; 3]) -> u32 {
    let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
    morton(normal, wrap(centre, mesh.size).truncate() / mesh.size)
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
fn morton(normal: Vec3, position: Vec2) -> u32 {
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
