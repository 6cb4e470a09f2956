//! Light that meets only level facets: it passes straight through, or is mirrored, as by a window.

use glam::DVec3;

use super::fresnel::{inside, reflectance};
use super::ndf::Ndf;
use super::optics::Channel;

/// Parts of the incident light.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Straight {
    /// Part that leaves along the incident direction.
    pub transmitted: f64,
    /// Part that leaves in the mirror direction.
    pub reflected: f64,
}

/// The straight and mirrored parts of light from `i`, which points up. With bounces, light that goes up and down between
/// level facets is summed as a geometric series; for a flat slab without absorption they are `(1-R)/(1+R)` and
/// `2R/(1+R)`. A slab of index 1 transmits everything that it does not absorb.
pub fn straight(top: &Ndf, bottom: &Ndf, i: DVec3, channel: Channel, bounces: bool) -> Straight {
    if i.z.is_nan() || i.z <= 0.0 {
        // At grazing incidence a face reflects all light, but for a slab that has no faces.
        let is_clear = channel.is_clear() && channel.depth <= 0.0;
        return Straight {
            transmitted: if is_clear { 1.0 } else { 0.0 },
            reflected: if is_clear { 0.0 } else { top.level() },
        };
    }
    let down = inside(-i, channel.eta);
    let through = channel.transmission(down);
    if channel.is_clear() {
        return Straight { transmitted: through, reflected: 0.0 };
    }
    let up = DVec3::new(down.x, down.y, -down.z);
    let mirror = DVec3::new(-i.x, -i.y, i.z);
    let r = reflectance(i.z, channel.eta);
    // Light that leaves is masked by the facets around it, light that arrives by the part of the face that it sees.
    let entering = top.level() * top.seen(i) * (1.0 - r) * top.seen(down);
    let leaving = bottom.level() * bottom.seen(-down) * (1.0 - r) * bottom.seen(-i);
    let back_down = top.level() * top.seen(-up) * r * top.seen(down);
    let back_up = bottom.level() * bottom.seen(-down) * r * bottom.seen(up);
    let out_again = top.level() * top.seen(-up) * (1.0 - r) * top.seen(mirror);
    let first = top.level() * top.seen(i) * r * top.seen(mirror);
    let once = entering * through;
    if !bounces {
        return Straight { transmitted: once * leaving, reflected: first };
    }
    // The product is below 1 except where nothing enters.
    let series = 1.0 / (1.0 - (back_up * back_down * through * through).min(1.0 - 1e-15));
    Straight { transmitted: once * leaving * series, reflected: first + once * back_up * through * out_again * series }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flat_slab_transmits_by_the_closed_form_at_0_to_89_degrees() {
        let flat = Ndf::smooth();
        let channel = Channel { eta: 1.5, depth: 0.0 };
        for degrees in [0.0, 30.0, 60.0, 75.0, 85.0, 89.0_f64] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let i = DVec3::new(sin, 0.0, cos);
            let r = reflectance(cos, 1.5);
            let with = straight(&flat, &flat, i, channel, true);
            assert!((with.transmitted - (1.0 - r) / (1.0 + r)).abs() < 1e-12, "{degrees}");
            assert!((with.transmitted + with.reflected - 1.0).abs() < 1e-12, "{degrees}");
            let without = straight(&flat, &flat, i, channel, false);
            assert!((without.transmitted - (1.0 - r) * (1.0 - r)).abs() < 1e-12 && without.reflected == r);
        }
    }

    #[test]
    fn absorption_follows_the_refracted_ray() {
        let flat = Ndf::smooth();
        let i = DVec3::new(0.6, 0.0, 0.8);
        let depth = 0.7;
        let single = straight(&flat, &flat, i, Channel { eta: 1.5, depth }, false).transmitted;
        let clear = straight(&flat, &flat, i, Channel { eta: 1.5, depth: 0.0 }, false).transmitted;
        let cosine = (1.0 - (0.6_f64 / 1.5).powi(2)).sqrt();
        assert!((single / clear - (-depth / cosine).exp()).abs() < 1e-12);
    }

    #[test]
    fn a_slab_of_index_1_passes_all_light_at_every_angle() {
        let rough = Ndf::analytic(super::super::Profile::Ggx, glam::DVec2::splat(0.5), 0.0);
        for cosine in [1.0, 0.5, 1e-4, 0.0_f64] {
            let i = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
            let parts = straight(&rough, &rough, i, Channel { eta: 1.0, depth: 0.0 }, true);
            assert_eq!(parts, Straight { transmitted: 1.0, reflected: 0.0 });
        }
    }
}
