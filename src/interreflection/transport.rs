//! Rays between points of the surface.

use std::f32::consts::FRAC_1_PI;
use std::fmt;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::sampler::{from_cosine, from_solid_angle};
use crate::base::{Cancel, Result};
use crate::geometry::facets::kd_tree::KdTree;
use crate::geometry::{Facets, Hit, PeriodicGrid, TileMesh, lifted_origins};

/// Distance by which the origin of a ray is lifted off the surface, in units of the tile's diagonal.
const LIFT: f32 = 2e-6;

/// Elements whose rays are counted to find the part that is useful.
const COUNTED: usize = 512;
/// Most rays that are cast for a useful one.
pub const MOST_RAYS_PER_USEFUL: f64 = 16.0;

/// Spacings by which an element counts as farther away if its normal is perpendicular to that of a point. They keep the
/// two walls of a crease, and the two sides of a thin sheet, apart.
const TURN_SPACINGS: f32 = 3.0;

/// A point of the surface at which light is reflected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vertex {
    /// The origin of rays from this point, lifted off the reflecting side.
    pub origin: Vec3,
    pub normal: Vec3,
    pub geometric_normal: Vec3,
    pub triangle: u32,
    /// The nearest element. Its facet has the visibility, the slot and the colour of the vertex.
    pub element: u32,
}

/// Finds the points at which rays through the endless tiling meet its reflecting side.
pub struct Tracer {
    grid: Arc<PeriodicGrid>,
    tree: KdTree,
    /// Geometric normals of the triangles, and normals of their corners if they are smooth.
    normals: Vec<Vec3>,
    corner_normals: Option<Vec<[Vec3; 3]>>,
    size: Vec2,
    bottom: f32,
    element_normals: Vec<Vec3>,
    /// Amount that a perpendicular normal adds to a squared distance.
    turn_penalty: f32,
}

/// Elements, which are a subset of the facets, and the first rays of the walks from them.
#[derive(Debug)]
pub struct Transport {
    pub tracer: Tracer,
    /// The facet of each element.
    pub facets: Vec<u32>,
    /// The rays, ordered by their elements. Each element has at least one. [`first_density`] is their density.
    pub rays: Vec<Ray>,
}

/// A ray away from an element.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    pub element: u32,
    /// Surface area that the ray represents: that of its element over the number of its rays.
    pub area: f32,
    pub direction: Vec3,
    /// The point that it hits; `None` if it leaves the tile or hits a back side, which does not reflect.
    pub hit: Option<Vertex>,
}

impl Transport {
    /// Casts rays from about `elements` facets: as many as are needed for `useful` of them to meet another facet from a
    /// facet that sees the sky, but at least one from each.
    ///
    /// # Errors
    /// Returns [`crate::base::Error::Cancelled`] if `cancel` is set.
    pub fn new(
        (mesh, grid): (&TileMesh, Arc<PeriodicGrid>),
        facets: &Facets,
        elements: usize,
        useful: usize,
        cancel: &Cancel,
    ) -> Result<Self> {
        let stride = facets.len().div_ceil(elements.max(1)).max(1);
        // Facets are sorted by normal, so every n-th facet is an even sample of them.
        let chosen: Vec<u32> = (stride / 2..facets.len()).step_by(stride).map(|s| s as u32).collect();
        let total: f64 = facets.areas.iter().map(|area| f64::from(*area)).sum();
        // Each element represents the facets around it, whose areas are nearly equal to its own.
        let chosen_area: f64 = chosen.iter().map(|facet| f64::from(facets.areas[*facet as usize])).sum();
        let scale = (total / chosen_area.max(f64::MIN_POSITIVE)) as f32;
        grid.prepare_rays();
        let tracer = Tracer::new((mesh, grid), facets, &chosen);
        let origins = lifted_origins(facets, mesh.size);
        let cast = |element: usize, number: usize| {
            let s = chosen[element] as usize;
            let direction = first_direction(facets.normals[s], number as u64);
            let leaves = direction.dot(facets.geometric_normals[s]) > 0.0;
            (direction, leaves.then(|| tracer.trace(origins[s], direction, facets.triangles[s])).flatten())
        };
        let elements = chosen.len();
        // A second ray shows whether the facet sees the sky.
        let is_useful = |k: usize| {
            let meets = |number: usize| cast((2 * k + 1) * elements / (2 * COUNTED), number).1.is_some();
            elements > 0 && meets(k) && !meets(COUNTED + k)
        };
        let counted = (0..COUNTED).into_par_iter().filter(|k| is_useful(*k)).count();
        let part = (counted as f64 / COUNTED as f64).max(1.0 / MOST_RAYS_PER_USEFUL);
        // The same number for all elements: if it varied with them, directions would be correlated with points.
        let per_element = ((useful as f64 / part / elements.max(1) as f64).round() as usize).max(1);
        let ray = |number: usize| {
            let element = number / per_element;
            let (direction, hit) = if cancel.is_set() { (Vec3::Z, None) } else { cast(element, number) };
            let area = facets.areas[chosen[element] as usize] * scale / per_element as f32;
            Ray { element: element as u32, area, direction, hit }
        };
        let rays = (0..elements * per_element).into_par_iter().map(ray).collect();
        cancel.check()?;
        Ok(Self { tracer, facets: chosen, rays })
    }
}

impl Tracer {
    /// Prepares rays. A vertex is assigned the nearest of `elements`, which are indices of facets.
    pub(super) fn new((mesh, grid): (&TileMesh, Arc<PeriodicGrid>), facets: &Facets, elements: &[u32]) -> Self {
        let area: f64 = facets.areas.iter().map(|area| f64::from(*area)).sum();
        let spacing = (area / elements.len().max(1) as f64).sqrt() as f32;
        let positions: Vec<Vec3> = elements.iter().map(|s| wrap(facets.positions[*s as usize], mesh.size)).collect();
        Self {
            grid,
            tree: KdTree::new(&positions, mesh.size),
            element_normals: elements.iter().map(|s| facets.geometric_normals[*s as usize]).collect(),
            turn_penalty: (TURN_SPACINGS * spacing).powi(2),
            normals: (0..mesh.triangles.len()).map(|triangle| mesh.geometric_normal(triangle)).collect(),
            corner_normals: mesh.corner_normals.clone(),
            size: mesh.size,
            bottom: mesh.z_range().0,
        }
    }

    /// The point that a ray meets first, or `None` if it leaves the tile or meets a back side. The triangle `own` is
    /// ignored if `origin` lies on it.
    pub fn trace(&self, origin: Vec3, direction: Vec3, own: u32) -> Option<Vertex> {
        let hit = self.grid.first_hit(origin, direction, own, self.bottom)?;
        let geometric_normal = self.normals[hit.triangle as usize];
        if geometric_normal.dot(direction) >= 0.0 {
            return None;
        }
        let position = wrap(hit.position, self.size);
        let turn = |element: u32| 1.0 - geometric_normal.dot(self.element_normals[element as usize]);
        let element = self.tree.nearest_by(position, |element| self.turn_penalty * turn(element).max(0.0))?;
        Some(Vertex {
            origin: position + geometric_normal * (LIFT * self.size.length()),
            normal: self.smooth_normal(&hit).unwrap_or(geometric_normal),
            geometric_normal,
            triangle: hit.triangle,
            element,
        })
    }

    fn smooth_normal(&self, hit: &Hit) -> Option<Vec3> {
        let [a, b, c] = self.corner_normals.as_ref()?[hit.triangle as usize];
        let [v, w] = hit.barycentric;
        (a * (1.0 - v - w) + b * v + c * w).try_normalize()
    }
}

impl fmt::Debug for Tracer {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Tracer").field("triangles", &self.normals.len()).finish_non_exhaustive()
    }
}

/// The part of the first rays whose density follows the cosine. The others are uniform in solid angle, because a glossy
/// lobe times both cosines does not fall with the cosine.
const COSINE_PART: f32 = 0.5;

/// Direction of ray `number` about `normal`.
fn first_direction(normal: Vec3, number: u64) -> Vec3 {
    // Facets follow another sequence (R2), so that points and directions are not correlated.
    let (u, v) = (radical_inverse(number, 2) as f32, radical_inverse(number, 3) as f32);
    if u < COSINE_PART {
        from_cosine(normal, u / COSINE_PART, v)
    } else {
        from_solid_angle(normal, (u - COSINE_PART) / (1.0 - COSINE_PART), v)
    }
}

/// The digits of a number in some base, mirrored at the point (van der Corput 1935).
fn radical_inverse(mut number: u64, base: u64) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0 / base as f64);
    while number > 0 {
        value += (number % base) as f64 * digit;
        number /= base;
        digit /= base as f64;
    }
    value
}

/// Density of the directions of first rays at a cosine to the normal.
pub(super) fn first_density(cosine: f32) -> f32 {
    COSINE_PART * cosine * FRAC_1_PI + (1.0 - COSINE_PART) * 0.5 * FRAC_1_PI
}

fn wrap(position: Vec3, size: Vec2) -> Vec3 {
    let wrapped = position.truncate() - size * (position.truncate() / size).floor();
    wrapped.clamp(Vec2::ZERO, size).extend(position.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_directions_pass_the_chi_squared_test_for_their_density() {
        const RAYS: u64 = 16 * 8192;
        for normal in [Vec3::Z, crate::math::directions::from_angles(1.1, 2.0)] {
            let (x, y) = normal.any_orthonormal_pair();
            let mut counts = vec![0.0; 8 * 16];
            for number in 0..RAYS {
                let d = first_direction(normal, number);
                let at = |axis: Vec3| f64::from(d.dot(axis));
                // Rings of equal solid angle.
                let ring = (8.0 * (1.0 - at(normal))).clamp(0.0, 7.0) as usize;
                let sector = (16.0 * (at(y).atan2(at(x)) / std::f64::consts::TAU + 1.0).fract()) as usize;
                counts[16 * ring + sector.min(15)] += 1.0;
            }
            // The density is linear in the cosine, so its value in the middle of a ring is its mean.
            let expected = |bin: usize| f64::from(first_density(1.0 - (bin as f32 / 16.0).floor() / 8.0 - 0.0625));
            // Šidák's correction: two tests at a joint level of 0.01.
            let p = crate::testing::chi_square::p_value(&counts, &(0..128).map(expected).collect::<Vec<_>>());
            assert!(p > 1.0 - 0.99_f64.sqrt(), "{normal}: {p}");
        }
    }
}
