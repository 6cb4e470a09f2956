//! Colours of pixels by a few reads of tables in single precision: the prefiltered table, and two tables over a number
//! that know no colour map. `shaders/color_map/` holds the twins.

use std::sync::LazyLock;

use glam::{Vec2, Vec3};

use super::heights::{Largest, MAX_LAMBDA, lambda};
use super::prefiltered::MAX_DEVIATION;
use super::slopes::visible_moments;
use super::{DEVIATIONS, MEANS, PrefilteredTable};

/// Entries of each table over a number.
pub const ENTRIES: usize = 512;
/// Octaves of `1 + a` that [`heights`] covers: exponents to 2e7.
const OCTAVES: f32 = 24.5;
/// Bound of Λ: `1/(1+Λ)` below it is 0 in single precision.
const LEAST: f32 = 1e-7;

/// Bound of ν, which is infinite from above.
const MOST_NU: f32 = 1e30;

/// A table over a number from 0 to 1, read linearly.
pub type Entries = [[f32; 4]; ENTRIES];

/// `1/(1+Λ)` (Eq. 3), and mean and variance of visible slopes, over `ν/(1+ν)`, for ν ≥ 0.
pub fn directions() -> &'static Entries {
    static TABLE: LazyLock<Entries> = LazyLock::new(|| {
        std::array::from_fn(|k| {
            let t = k as f64 / (ENTRIES - 1) as f64;
            let nu = if t < 1.0 { t / (1.0 - t) } else { f64::INFINITY };
            let seen = if t == 0.0 { 0.0 } else { 1.0 / (1.0 + lambda(nu).min(MAX_LAMBDA)) };
            let (mean, variance) = if t < 1.0 { visible_moments(nu) } else { (0.0, 1.0) };
            [seen as f32, mean as f32, variance as f32, 0.0]
        })
    });
    &TABLE
}

/// Mean and deviation of D_h (Eq. 16) over [`octave`] of `1 + a`, divided by 24.5.
pub fn heights() -> &'static Entries {
    static TABLE: LazyLock<Entries> = LazyLock::new(|| {
        std::array::from_fn(|k| {
            let octave = f64::from(OCTAVES) * k as f64 / (ENTRIES - 1) as f64;
            let exponent = octave.floor().exp2() * (1.0 + octave.fract()) - 1.0;
            let at = Largest { exponent }.exact_moments();
            [at.mean as f32, at.deviation as f32, 0.0, 0.0]
        })
    });
    &TABLE
}

/// The logarithm to base 2 at powers of 2, and linear between them: it is read from the bits of the number.
#[inline]
fn octave(x: f32) -> f32 {
    const ONE: u32 = 0x3f80_0000;
    const PER_BIT: f32 = 1.0 / 8_388_608.0;
    x.to_bits().saturating_sub(ONE) as f32 * PER_BIT
}

#[inline]
fn entry(table: &Entries, t: f32) -> [f32; 3] {
    let x = t.clamp(0.0, 1.0) * (ENTRIES - 1) as f32;
    let k = (x as usize).min(ENTRIES - 2);
    let (f, a, b) = (x - k as f32, &table[k], &table[k + 1]);
    [a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1]), a[2] + f * (b[2] - a[2])]
}

/// A prefiltered table and the tables over a number.
#[derive(Debug, Clone, Copy)]
pub struct ColorReads<'a> {
    colors: &'a [Vec3],
    low: f32,
    /// Entries per mean.
    per_mean: f32,
    directions: &'a Entries,
    heights: &'a Entries,
}

/// Heights or slopes that a pixel holds: mean and deviation in deviations of the driver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Within {
    pub mean: f32,
    pub deviation: f32,
}

impl<'a> ColorReads<'a> {
    pub fn new(table: &'a PrefilteredTable) -> Self {
        let (low, per_mean) = table.mean_axis();
        Self { colors: table.colors(), low, per_mean, directions: directions(), heights: heights() }
    }

    /// The mean colour of a texture with this mean and deviation within the pixel. Means beyond the table count as its ends,
    /// which is exact only for deviations that are small against the distance to the stops.
    #[inline]
    pub fn texture(&self, at: Within) -> Vec3 {
        let x = ((at.mean - self.low) * self.per_mean).clamp(0.0, (MEANS - 1) as f32);
        let y = (at.deviation * (1.0 / MAX_DEVIATION as f32)).clamp(0.0, 1.0).sqrt() * (DEVIATIONS - 1) as f32;
        let (i, j) = ((x as usize).min(MEANS - 2), (y as usize).min(DEVIATIONS - 2));
        let (f, g) = (x - i as f32, y - j as f32);
        let row = |j: usize| {
            let at = j * MEANS + i;
            self.colors[at].lerp(self.colors[at + 1], f)
        };
        row(j).lerp(row(j + 1), g)
    }

    /// The mean colour of heights that are seen and lit. `nu` holds ν of viewer and light, `apart` the difference of
    /// their azimuths from 0 to π.
    #[inline]
    pub fn height(&self, nu: Vec2, apart: f32, at: Within) -> Vec3 {
        let lambda = |nu: f32| {
            let nu = nu.clamp(0.0, MOST_NU);
            1.0 / entry(self.directions, nu / (1.0 + nu))[0].max(LEAST) - 1.0
        };
        let (o, i) = (lambda(nu.x), lambda(nu.y));
        let independence = 4.41 * apart / (4.41 * apart + 1.0);
        let exponent = o.max(i) + independence * o.min(i);
        let [mean, deviation, _] = entry(self.heights, octave(1.0 + exponent) * (1.0 / OCTAVES));
        self.texture(Within { mean: at.mean + at.deviation * mean, deviation: at.deviation * deviation })
    }

    /// The mean colour of the slope along an azimuth that a viewer sees. `nu` is that of the viewer, `correlation` that
    /// of the slopes towards the viewer and along the azimuth. A plane that faces away from the viewer counts as ν = 0.
    #[inline]
    pub fn slope(&self, nu: f32, correlation: f32, at: Within) -> Vec3 {
        let nu = nu.clamp(0.0, MOST_NU);
        let [_, mean, variance] = entry(self.directions, nu / (1.0 + nu));
        let spread = (1.0 + correlation * correlation * (variance - 1.0)).max(0.0).sqrt();
        self.texture(Within { mean: at.mean + at.deviation * correlation * mean, deviation: at.deviation * spread })
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::super::heights::pair_exponent;
    use super::super::slopes::{Slopes, cotangent, direction};
    use super::super::stops::tests::map;
    use super::super::{Normal, StopMap};
    use super::*;

    fn near(ours: Vec3, exact: glam::DVec3, most: f64, what: &str) {
        let error = (ours.as_dvec3() - exact).abs().max_element();
        assert!(error < most, "{what}: {ours} {exact}");
    }

    #[test]
    fn reads_of_textures_heights_and_slopes_are_the_means_under_their_normal_distributions() {
        let smooth: StopMap = map("ramp");
        let table = PrefilteredTable::new(&smooth);
        let reads = ColorReads::new(&table);
        let slopes = Slopes { mean: DVec2::new(0.05, -0.02), covariance: [0.12, 0.03, 0.09] };
        for theta in [0.0_f64, 20.0, 55.0, 75.0, 85.0, 86.0] {
            for phi in [0.0_f64, 0.6, 2.8] {
                let (o, i) = (direction(theta.to_radians(), 0.3), direction(0.9, 0.3 + phi));
                let nu = [slopes.nu(o), slopes.nu(i)];
                let heights = Largest { exponent: pair_exponent(lambda(nu[0]), lambda(nu[1]), phi) }.moments();
                let within = Within { mean: 0.2, deviation: 0.7 };
                let exact = smooth.mean(&Normal { mean: 0.2 + 0.7 * heights.mean, deviation: 0.7 * heights.deviation });
                near(reads.height(Vec2::new(nu[0] as f32, nu[1] as f32), phi as f32, within), exact, 2e-3, "heights");
                // The slope along 0.5 rad, standardized.
                let (azimuth, (_, t)) = (0.5_f64, cotangent(o));
                let unit = slopes.driver(azimuth);
                let axis = DVec2::from_angle(azimuth);
                let [xx, xy, yy] = slopes.covariance;
                let times = DVec2::new(xx * t.x + xy * t.y, xy * t.x + yy * t.y);
                let correlation = times.dot(axis) / (slopes.variance_along(t).sqrt() * unit.deviation);
                let seen = slopes.visible(o).driver(azimuth);
                let exact = smooth.mean(&Normal {
                    mean: (seen.mean - unit.mean) / unit.deviation,
                    deviation: seen.deviation / unit.deviation,
                });
                let within = Within { mean: 0.0, deviation: 1.0 };
                near(reads.slope(nu[0] as f32, correlation as f32, within), exact, 2e-3, "slopes");
            }
        }
        for (mean, deviation) in [(-9.0, 0.2), (0.3, 0.0), (0.1, 1.2), (2.9, 1.5)] {
            let exact = smooth.mean(&Normal { mean, deviation });
            near(reads.texture(Within { mean: mean as f32, deviation: deviation as f32 }), exact, 2e-3, "textures");
        }
    }

    #[test]
    fn reads_are_finite_and_between_the_colours_of_the_stops_for_any_number() {
        let table = PrefilteredTable::new(&map("bands"));
        let reads = ColorReads::new(&table);
        for nu in [-1.0, 0.0, 1e-20, 1.0, 1e20, f32::INFINITY] {
            for within in [Within { mean: 0.0, deviation: 0.0 }, Within { mean: -1e9, deviation: 1e9 }] {
                for color in [reads.height(Vec2::new(nu, 0.5), 0.0, within), reads.slope(nu, -1.0, within)] {
                    assert!(color.min_element() >= 0.0499 && color.max_element() <= 0.9501, "{nu} {within:?}: {color}");
                }
            }
        }
    }

    /// Milliseconds of an image of 1920 x 1080 pixels, the fastest of several.
    fn milliseconds(color: impl Fn(usize) -> Vec3 + Sync) -> f64 {
        use rayon::prelude::*;
        let mut image = vec![Vec3::ZERO; 1920 * 1080];
        let mut fastest = f64::MAX;
        for _ in 0..7 {
            let start = std::time::Instant::now();
            image.par_chunks_mut(1920).enumerate().for_each(|(row, pixels)| {
                pixels.iter_mut().enumerate().for_each(|(column, pixel)| *pixel = color(row * 1920 + column));
            });
            fastest = fastest.min(start.elapsed().as_secs_f64() * 1e3);
            assert!(std::hint::black_box(&image).iter().all(|color| color.is_finite()));
        }
        fastest
    }

    #[test]
    #[ignore = "a measurement: cargo bench --bench measure -- color-map-speed"]
    fn the_table_of_speeds() {
        let bands = map("bands");
        let table = PrefilteredTable::new(&bands);
        let reads = ColorReads::new(&table);
        // Numbers that differ from pixel to pixel, as those of a noise do.
        let part = |k: usize, salt: usize| ((k * 2_654_435_761 + salt * 40_503) % 65_536) as f32 / 65_536.0;
        let numbers: Vec<[f32; 4]> =
            (0..1920 * 1080).map(|k| [part(k, 1), part(k, 2), part(k, 3), part(k, 4)]).collect();
        let two = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        let rows = two.install(|| {
            let within = |n: &[f32; 4]| Within { mean: 4.0 * n[0] - 2.0, deviation: 0.02 + n[1] };
            let naive = milliseconds(|k| bands.color(f64::from(4.0 * numbers[k][0] - 2.0)).as_vec3());
            let texture = milliseconds(|k| reads.texture(within(&numbers[k])));
            let height = milliseconds(|k| {
                let n = &numbers[k];
                reads.height(Vec2::new(4.0 * n[2], 4.0 * n[3]), 3.0 * n[3], within(n))
            });
            let slope = milliseconds(|k| reads.slope(4.0 * numbers[k][2], numbers[k][3], within(&numbers[k])));
            let build = (0..5)
                .map(|_| {
                    let start = std::time::Instant::now();
                    std::hint::black_box(PrefilteredTable::new(&bands));
                    start.elapsed().as_secs_f64() * 1e3
                })
                .fold(f64::MAX, f64::min);
            [
                ("naive map", naive),
                ("texture", texture),
                ("heights", height),
                ("slopes", slope),
                ("stops to table", build),
            ]
        });
        println!("| colour of 1920 x 1080 pixels on two cores | ms | relative to the naive map |");
        println!("|---|---|---|");
        for (name, ms) in rows {
            let ratio = if name == "stops to table" { "".to_owned() } else { format!("{:.1}", ms / rows[0].1) };
            println!("| {name} | {ms:.1} | {ratio} |");
        }
        println!("| tables together | {} kB | |", (table.bytes() + 2 * size_of::<Entries>()) / 1024);
    }
}
