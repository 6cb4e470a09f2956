//! Sizes of images that fit into a time, from the costs of the pixels before.

use crate::render::image::render::RenderTimes;

use super::preview_renderer::KnownPoints;

/// Maximum side of an image in pixels. Every GPU can render the final image, which has twice as many samples per side.
const MAX_SIDE: f64 = 4096.0;
/// Costs that are assumed until they are measured [ms].
const FIRST_SHADING: f64 = 1.6e-2;
const FIRST_POINT: f64 = 4e-3;
/// Factor on the time limit for an image whose points must be found again in a new size. Later images of the view have
/// the same points.
const FIRST_OF_VIEW: f64 = 1.6;
/// Divisors of the sides of an image. They are few, so that the image does not change its size at every edit.
const DIVISORS: [f64; 10] = [1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0, 6.0, 8.0];
/// Smallest side of an image in pixels.
const MIN_SIDE: usize = 24;

/// Kinds of shading, whose costs differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shading {
    /// With the draft's BRDF.
    Draft,
    /// With the refined BRDF, from a table or from a sum over few facets.
    Refined,
    /// With the refined BRDF itself, on the CPU: no table is wanted, or none is close enough.
    Exact,
    /// Under a colour map that is filtered in each pixel.
    Filtered,
}

impl Shading {
    /// Samples per side of a pixel in images before the final one.
    fn samples_per_side(self) -> usize {
        if self == Self::Filtered { 2 } else { 1 }
    }
}

/// Milliseconds per pixel of the last images.
#[derive(Debug)]
pub struct PixelCosts {
    /// Of each [`Shading`], for one and for four samples. With four, most of the time goes to edges.
    shading: [[Option<f64>; 2]; 4],
    /// To find the point that a pixel shows and the lights that reach it, for one and for four samples.
    points: [f64; 2],
}

impl Default for PixelCosts {
    fn default() -> Self {
        Self { shading: [[None; 2]; 4], points: [FIRST_POINT; 2] }
    }
}

impl PixelCosts {
    /// Records the times of an image.
    pub fn record(&mut self, shading: Shading, samples_per_side: usize, size: [usize; 2], times: &RenderTimes) {
        let pixels = (size[0] * size[1]) as f64;
        let samples = usize::from(samples_per_side > 1);
        self.shading[shading as usize][samples] = Some(times.shading_ms / pixels);
        if times.gbuffer_ms > 0.0 {
            self.points[samples] = (times.gbuffer_ms + times.shadows_ms) / pixels;
        }
    }

    /// The estimated times of an image [ms]: of its shading, and of its points, unless they are known.
    pub fn of_image(&self, size: [usize; 2], shading: Shading, samples_per_side: usize) -> [f64; 2] {
        let pixels = (size[0] * size[1]) as f64;
        let [one, four] = self.shading[shading as usize];
        let known = if samples_per_side > 1 { four.or(one) } else { one.or(four) };
        [known.unwrap_or(FIRST_SHADING), self.points[samples_per_side - 1]].map(|cost| pixels * cost)
    }

    /// The largest size with the aspect ratio of `full` that is estimated to take at most `budget_ms`. `known` returns the
    /// points that are kept for a size and a number of samples per side.
    pub fn affordable(
        &self,
        full: [usize; 2],
        shading: Shading,
        budget_ms: f64,
        known: impl Fn([usize; 2], usize) -> KnownPoints,
    ) -> [usize; 2] {
        let samples_per_side = shading.samples_per_side();
        let mut sizes =
            DIVISORS.map(|part| full.map(|side| ((side as f64 / part).round() as usize).max(MIN_SIDE))).into_iter();
        let is_quick = |size: &[usize; 2]| {
            let [shading, points] = self.of_image(*size, shading, samples_per_side);
            match known(*size, samples_per_side) {
                KnownPoints::All => shading <= budget_ms,
                KnownPoints::OtherSampling => shading <= budget_ms && shading + points <= FIRST_OF_VIEW * budget_ms,
                KnownPoints::None => shading + points <= budget_ms,
            }
        };
        let smallest = sizes.next_back().unwrap_or(full);
        sizes.find(is_quick).unwrap_or(smallest)
    }
}

/// The size of a view, reduced to the largest size that is rendered.
pub fn fitting(size: [usize; 2], max_pixels: f64) -> [usize; 2] {
    let size = size.map(|side| side.clamp(MIN_SIDE, 8192));
    let longest = size[0].max(size[1]) as f64;
    let scale = (max_pixels / (size[0] * size[1]) as f64).sqrt().min(MAX_SIDE / longest).min(1.0);
    size.map(|side| ((side as f64 * scale) as usize).max(MIN_SIDE))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_has_fewer_pixels_where_they_cost_more_and_more_where_their_points_are_known() {
        let mut costs = PixelCosts::default();
        let times = RenderTimes { gbuffer_ms: 30.0, shadows_ms: 10.0, shading_ms: 10.0, ..RenderTimes::default() };
        costs.record(Shading::Draft, 1, [100, 100], &times);
        // 5 µs per pixel, of which 4 are for its point.
        let size = |budget_ms, known| costs.affordable([400, 200], Shading::Draft, budget_ms, |_, _| known);
        assert_eq!(size(400.0, KnownPoints::None), [400, 200]);
        assert_eq!(size(100.0, KnownPoints::None), [200, 100]);
        assert_eq!(size(100.0, KnownPoints::All), [400, 200]);
        assert_eq!(size(63.0, KnownPoints::OtherSampling), [200, 100], "1.6 times the limit, for the first of a view");
        assert_eq!(size(1e-3, KnownPoints::All), [50, 25], "the smallest, however long it takes");
        let refined = costs.affordable([400, 200], Shading::Refined, 100.0, |_, _| KnownPoints::None);
        assert!(refined[0] < 200, "the refined BRDF was not measured yet: {refined:?}");
        costs.record(Shading::Refined, 1, [100, 100], &RenderTimes { shading_ms: 5.0, ..RenderTimes::default() });
        let exact = costs.affordable([400, 200], Shading::Exact, 100.0, |_, _| KnownPoints::All);
        assert!(exact[0] < 400, "that a table is quick says nothing about the BRDF itself: {exact:?}");
        // Four samples cost what one does until they are measured; later, neither changes the other.
        assert_eq!(costs.of_image([100, 100], Shading::Draft, 2)[0], 10.0);
        costs.record(Shading::Draft, 2, [100, 100], &RenderTimes { shading_ms: 50.0, ..RenderTimes::default() });
        assert_eq!([1, 2].map(|samples| costs.of_image([100, 100], Shading::Draft, samples)[0]), [10.0, 50.0]);
    }
}
