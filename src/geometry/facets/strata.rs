//! Strata of the surface: parts with one material slot and similar luminance of the colour field. Each stratum gets
//! facets of its own, so that no small part of the surface is missed.

use glam::{UVec2, Vec2, Vec3};

use crate::brdf::LUMINANCE;
use crate::geometry::{ColorField, TileMesh};

/// A part of a triangle, by the barycentric coordinates of its corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Part {
    pub triangle: u32,
    pub corners: [Vec3; 3],
}

/// Parts of triangles, and the stratum of each. Triangles within one stratum are not divided.
#[derive(Debug, Clone, Default)]
pub(crate) struct Strata {
    /// Stratum of each triangle; `None` if it is divided.
    pub of_triangle: Vec<Option<u32>>,
    pub parts: Vec<(Part, u32)>,
}

/// Maximum number of parts. It bounds the time on images whose strata alternate from texel to texel, where area alone
/// samples well.
const MAX_PARTS: usize = 1 << 16;
/// Side of a part that is not divided further [texels].
const MIN_TEXELS: f32 = 0.5;
/// Ratio of luminance between classes of colour. Class 0 reaches up to this multiple of the image's mean, so that at
/// most a quarter of an image is in the other classes.
const CLASS_RATIO: f32 = 4.0;
/// Number of classes of colour.
const CLASSES: u32 = 6;

impl Strata {
    /// Divides a mesh into strata.
    pub fn new(mesh: &TileMesh) -> Self {
        let slots = mesh.painted_slots.as_ref().map(|field| ClassImage::new(field.size, field.texels.to_vec(), 0.0));
        // A colour map places no facets, because an edit of a stop would then recompute visibility. The order of facets
        // through normals and positions samples heights and slopes evenly.
        let colors = match mesh.color.image() {
            ColorField::Image { size, texels } => luminance_classes(*size, texels),
            ColorField::Uniform | ColorField::Mapped { .. } => None,
        };
        let divider = Divider { mesh, slots: slots.filter(|image| image.rarest() > 0.0), colors };
        if divider.slots.is_none() && divider.colors.is_none() {
            let slots = &mesh.triangle_slot[..mesh.triangles.len()];
            let of_triangle = slots.iter().map(|slot| Some(u32::from(*slot) * CLASSES)).collect();
            return Self { of_triangle, parts: Vec::new() };
        }
        divider.divide()
    }
}

/// Returns true if the colour field of a mesh decides where facets are.
pub(crate) fn colors_place_facets(mesh: &TileMesh) -> bool {
    matches!(mesh.color.image(), ColorField::Image { size, texels } if luminance_classes(*size, texels).is_some())
}

/// Classes of luminance relative to the image's mean; `None` if all texels are in one class.
fn luminance_classes(size: UVec2, texels: &[Vec3]) -> Option<ClassImage> {
    let luminance = |texel: &Vec3| texel.dot(LUMINANCE);
    let mean = texels.iter().map(|texel| f64::from(luminance(texel))).sum::<f64>() / texels.len().max(1) as f64;
    if mean <= 0.0 {
        return None;
    }
    let class = |texel: &Vec3| {
        let ratio = luminance(texel) / mean as f32;
        (0..CLASSES - 1).take_while(|k| ratio >= CLASS_RATIO.powi(*k as i32 + 1)).count() as u8
    };
    let classes: Vec<u8> = texels.iter().map(class).collect();
    // The field interpolates between texel centres, so that a texel reaches half a texel beyond its sides.
    classes.iter().any(|class| *class > 0).then(|| ClassImage::new(size, classes, 0.5))
}

/// Classes of texels, with the range of classes over squares of 2ⁿ texels.
struct ClassImage {
    size: UVec2,
    /// Distance beyond its sides up to which a texel has influence [texels].
    reach: f32,
    /// Smallest and largest class by level, row by row.
    levels: Vec<(UVec2, Vec<[u8; 2]>)>,
    /// Number of texels of each class.
    counts: [usize; 256],
}

impl ClassImage {
    fn new(size: UVec2, classes: Vec<u8>, reach: f32) -> Self {
        let mut counts = [0; 256];
        classes.iter().for_each(|class| counts[usize::from(*class)] += 1);
        let mut levels = vec![(size, classes.into_iter().map(|class| [class; 2]).collect::<Vec<_>>())];
        while let Some((below_size, below)) = levels.last().filter(|(size, _)| size.max_element() > 1) {
            let size = (*below_size + 1) / 2;
            let range = |x: u32, y: u32| {
                let (right, top) = ((2 * x + 2).min(below_size.x), (2 * y + 2).min(below_size.y));
                let cells = (2 * y..top).flat_map(|y| (2 * x..right).map(move |x| (x, y)));
                cells.fold([u8::MAX, 0], |range, (x, y)| joined(range, below[(y * below_size.x + x) as usize]))
            };
            let level = (0..size.y).flat_map(|y| (0..size.x).map(move |x| (x, y))).map(|(x, y)| range(x, y)).collect();
            levels.push((size, level));
        }
        Self { size, reach, levels, counts }
    }

    /// Part of the texels that the rarest class covers; 0 if there is one class only.
    fn rarest(&self) -> f64 {
        let present: Vec<usize> = self.counts.iter().copied().filter(|count| *count > 0).collect();
        if present.len() < 2 {
            return 0.0;
        }
        present.into_iter().min().unwrap_or(0) as f64 / self.counts.iter().sum::<usize>() as f64
    }

    /// Range of the classes that influence a rectangle `[low, high]` of the unit square, which repeats. The range may
    /// include classes near the rectangle.
    fn range(&self, low: Vec2, high: Vec2) -> [u8; 2] {
        let size = self.size.as_vec2();
        let (low, high) =
            ((low * size - self.reach).floor().as_i64vec2(), (high * size + self.reach).floor().as_i64vec2());
        let mut range = [u8::MAX, 0];
        for (y, y_end) in wrapped_runs(low.y, high.y, self.size.y) {
            for (x, x_end) in wrapped_runs(low.x, high.x, self.size.x) {
                let span = (x_end - x).max(y_end - y);
                // At this level the rectangle covers at most three cells per axis.
                let level = span.checked_ilog2().unwrap_or(0).min(self.levels.len() as u32 - 1);
                let (cells, values) = &self.levels[level as usize];
                for y in y >> level..=y_end >> level {
                    for x in x >> level..=x_end >> level {
                        range = joined(range, values[(y * cells.x + x) as usize]);
                    }
                }
            }
        }
        range
    }

    /// The rarer of the two ends of a range.
    fn rarer(&self, [low, high]: [u8; 2]) -> u8 {
        if self.counts[usize::from(low)] < self.counts[usize::from(high)] { low } else { high }
    }
}

fn joined(a: [u8; 2], b: [u8; 2]) -> [u8; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// The texels `low..=high` of a repeated row of `size` texels, as runs `(first, last)` within the row.
fn wrapped_runs(low: i64, high: i64, size: u32) -> impl Iterator<Item = (u32, u32)> {
    let count = i64::from(size);
    let runs = if high - low + 1 >= count {
        [Some((0, size - 1)), None]
    } else {
        let (first, last) = (low.rem_euclid(count) as u32, high.rem_euclid(count) as u32);
        if first <= last { [Some((first, last)), None] } else { [Some((first, size - 1)), Some((0, last))] }
    };
    runs.into_iter().flatten()
}

struct Divider<'a> {
    mesh: &'a TileMesh,
    slots: Option<ClassImage>,
    colors: Option<ClassImage>,
}

impl Divider<'_> {
    fn divide(&self) -> Strata {
        let count = self.mesh.triangles.len();
        let mut strata = Strata { of_triangle: vec![None; count], parts: Vec::new() };
        let mut level: Vec<Part> = Vec::new();
        for triangle in 0..count as u32 {
            let whole = Part { triangle, corners: [Vec3::X, Vec3::Y, Vec3::Z] };
            match self.stratum(&whole, false) {
                Some(stratum) => strata.of_triangle[triangle as usize] = Some(stratum),
                None => level.push(whole),
            }
        }
        // Level by level, so that the limit leaves the coarsest parts that are possible everywhere.
        while !level.is_empty() {
            let is_last = strata.parts.len() + 4 * level.len() > MAX_PARTS;
            let mut finer = Vec::new();
            for part in &level {
                for part in quarters(part) {
                    match self.stratum(&part, is_last) {
                        Some(stratum) => strata.parts.push((part, stratum)),
                        None => finer.push(part),
                    }
                }
            }
            level = finer;
        }
        // The parts follow each other in rows and columns of texels. Facets are a systematic selection, which could keep to one
        // column, so the order is mixed.
        let mixed = |k: u32| (k ^ k >> 15).wrapping_mul(0x2c1b_3c6d).rotate_left(13).wrapping_mul(0x297a_2d39);
        let mut numbered: Vec<(u32, (Part, u32))> = (0..).zip(strata.parts).map(|(k, part)| (mixed(k), part)).collect();
        numbered.sort_by_key(|(key, _)| *key);
        strata.parts = numbered.into_iter().map(|(_, part)| part).collect();
        strata
    }

    /// The stratum of a part; `None` if it must be divided. A mixed part that is not divided further (`is_last`, or
    /// small) counts with its rarest slot and its brightest class.
    fn stratum(&self, part: &Part, is_last: bool) -> Option<u32> {
        let corners = self.mesh.corners(part.triangle as usize).map(Vec3::truncate);
        let points =
            part.corners.map(|at| (corners[0] * at.x + corners[1] * at.y + corners[2] * at.z) / self.mesh.size);
        let (low, high) = (points[0].min(points[1]).min(points[2]), points[0].max(points[1]).max(points[2]));
        let class = |image: &Option<ClassImage>, pick: &dyn Fn(&ClassImage, [u8; 2]) -> u8| match image {
            None => Some(0),
            Some(image) => {
                let range = image.range(low, high);
                let is_small = ((high - low) * image.size.as_vec2()).max_element() <= MIN_TEXELS;
                (range[0] == range[1] || is_small || is_last).then(|| pick(image, range))
            }
        };
        let painted = class(&self.slots, &ClassImage::rarer)?;
        let color = class(&self.colors, &|_, range| range[1])?;
        let slot = match (&self.mesh.painted_slots, painted) {
            (Some(field), 1..) if self.slots.is_some() => field.first + u16::from(painted) - 1,
            _ => self.mesh.triangle_slot[part.triangle as usize],
        };
        Some(u32::from(slot) * CLASSES + u32::from(color))
    }
}

/// Divides a part into four of equal area.
fn quarters(part: &Part) -> [Part; 4] {
    let [a, b, c] = part.corners;
    let (ab, bc, ca) = (0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a));
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]].map(|corners| Part { corners, ..*part })
}

/// Smallest part of the facets that a stratum gets, if there are few strata.
const MIN_SHARE: f64 = 1.0 / 8.0;

/// Divides `count` facets among strata of these areas: in proportion to area, but no stratum gets less than
/// [`MIN_SHARE`], or half of an equal share. Every stratum gets a facet. The counts sum to `count`, which must not be
/// smaller than the number of strata, or there is one stratum.
pub(crate) fn allocate(areas: &[f64], count: usize) -> Vec<usize> {
    let equal = count as f64 / areas.len() as f64;
    let least = (count as f64 * MIN_SHARE).min(0.5 * equal).max(1.0).min(equal).floor();
    let total: f64 = areas.iter().sum();
    let wanted: Vec<f64> = areas.iter().map(|area| (area / total * count as f64).max(least)).collect();
    // The facets above the least ones are shared again, so that the counts sum to `count`.
    let above: f64 = wanted.iter().map(|wanted| wanted - least).sum();
    let left = count as f64 - least * areas.len() as f64;
    let scale = if above > 0.0 { left / above } else { 0.0 };
    let mut sum = 0.0;
    let mut given = 0;
    let mut counts: Vec<usize> = Vec::with_capacity(areas.len());
    for wanted in wanted {
        sum += (wanted - least) * scale;
        let upto = sum.round() as usize;
        counts.push(least as usize + upto - given);
        given = upto;
    }
    let missing = count - counts.iter().sum::<usize>();
    if let Some(last) = counts.last_mut() {
        *last += missing;
    }
    counts
}

#[cfg(test)]
#[path = "strata_tests.rs"]
mod tests;
