//! Built-in environments. Radiances are relative: a white Lambertian surface that faces the main light has about 1.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

use super::{LatLongMap, luminance};

const WIDTH: usize = 512;
const HEIGHT: usize = 256;
/// Direction towards the sun of `clear_sky` and `sun`: high to the right, in front of the object.
const SUN_DIRECTION: DVec3 = DVec3::new(0.55, 0.62, 0.56);

/// A rectangular light at infinity: a rectangle in the gnomonic plane about `towards`.
struct SoftBox {
    towards: DVec3,
    /// Half extents across and up, as tangents of the angle.
    half: [f64; 2],
    radiance: DVec3,
}

impl SoftBox {
    /// Returns the radiance along `direction`, with edges softened over a tenth of the half extents.
    fn at(&self, direction: DVec3) -> DVec3 {
        let axis = self.towards.normalize_or(DVec3::Y);
        let right = DVec3::Y.cross(axis).normalize_or(DVec3::X);
        let up = axis.cross(right);
        let depth = direction.dot(axis);
        if depth <= 0.0 {
            return DVec3::ZERO;
        }
        let edge = |offset: f64, half: f64| smooth_step((1.0 - (offset / depth).abs() / half) / 0.1 + 0.5);
        self.radiance * (edge(direction.dot(right), self.half[0]) * edge(direction.dot(up), self.half[1]))
    }
}

fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// A photographer's studio in a grey room that is darker below. A large warm key light is in front to the upper left, a
/// tall cool strip to the right. Rim lights are behind the object, and a weak light is above.
pub(super) fn studio() -> LatLongMap {
    let boxes = [
        SoftBox { towards: DVec3::new(-0.75, 0.75, 0.85), half: [0.36, 0.36], radiance: DVec3::new(5.9, 5.6, 5.2) },
        SoftBox { towards: DVec3::new(0.95, 0.30, 0.45), half: [0.13, 0.62], radiance: DVec3::new(1.55, 1.7, 1.9) },
        SoftBox { towards: DVec3::new(0.55, 0.55, -0.95), half: [0.45, 0.16], radiance: DVec3::new(4.2, 4.2, 4.2) },
        SoftBox { towards: DVec3::new(-0.90, 0.10, -0.55), half: [0.12, 0.55], radiance: DVec3::new(1.8, 1.8, 1.95) },
        SoftBox { towards: DVec3::new(0.0, 1.0, 0.12), half: [0.60, 0.22], radiance: DVec3::new(0.9, 0.9, 0.9) },
    ];
    LatLongMap::from_fn(WIDTH, HEIGHT, |direction| {
        let room = 0.03 + 0.06 * smooth_step(0.5 + 0.5 * direction.y);
        boxes.iter().fold(DVec3::splat(room), |sum, soft_box| sum + soft_box.at(direction))
    })
}

/// The CIE standard overcast sky, `L = L_z (1 + 2 sin γ)/3` (Moon and Spencer 1942), over a dim ground. Its zenith
/// radiance gives a horizontal surface an irradiance of π from the sky alone.
pub(super) fn overcast_sky() -> LatLongMap {
    let zenith = 9.0 / 7.0;
    let tint = DVec3::new(0.97, 1.0, 1.05);
    LatLongMap::from_fn(WIDTH, HEIGHT, |direction| {
        let sky = zenith * (1.0 + 2.0 * direction.y.max(0.0)) / 3.0;
        tint * (sky * above_ground(direction, 0.2))
    })
}

/// Returns 1 in the sky and `ground` below, blended over the texels at the horizon.
fn above_ground(direction: DVec3, ground: f64) -> f64 {
    let texel = PI / HEIGHT as f64;
    ground + (1.0 - ground) * (0.5 + direction.y / texel).clamp(0.0, 1.0)
}

/// The CIE standard clear sky (Kittler 1967; luminance distribution of CIE S 003) with the sun in one texel. Its colour
/// changes from haze at the horizon to blue at the zenith. The sun gives a surface that faces it an irradiance of 2.6.
/// The sky gives a horizontal surface about 0.7.
pub(super) fn clear_sky() -> LatLongMap {
    let sun = SUN_DIRECTION.normalize_or(DVec3::Y);
    let zenith_angle = sun.y.acos();
    let scattering = |chi: f64| 0.91 + 10.0 * (-3.0 * chi).exp() + 0.45 * chi.cos().powi(2);
    let gradation = |cos_z: f64| 1.0 - (-0.32 / cos_z.max(1e-3)).exp();
    let at_zenith = scattering(zenith_angle) * gradation(1.0);
    let (blue, haze) = (DVec3::new(0.42, 0.80, 1.75), DVec3::new(0.92, 1.0, 1.10));
    let (blue, haze) = (blue / luminance(blue), haze / luminance(haze));
    let mut map = LatLongMap::from_fn(WIDTH, HEIGHT, |direction| {
        let up = direction.y.max(0.0);
        let chi = direction.angle_between(sun);
        let relative = scattering(chi) * gradation(up) / at_zenith;
        let colour = haze.lerp(blue, (1.0 - (1.0 - up).powi(3)).max(0.0) * smooth_step(chi / FRAC_PI_2 + 0.3));
        let ground = DVec3::new(0.10, 0.095, 0.085);
        let sky = above_ground(direction, 0.0);
        colour * (0.12 * relative * sky) + ground * (1.0 - sky)
    });
    add_sun(&mut map, DVec3::new(2.75, 2.6, 2.25));
    map
}

/// A sun in black space with irradiance π: a white Lambertian surface that faces it has radiance 1.
pub(super) fn sun() -> LatLongMap {
    let mut map = LatLongMap::from_fn(WIDTH, HEIGHT, |_| DVec3::ZERO);
    add_sun(&mut map, DVec3::splat(PI));
    map
}

fn add_sun(map: &mut LatLongMap, irradiance: DVec3) {
    let (column, row) = map.texel_at(SUN_DIRECTION.normalize_or(DVec3::Y));
    let row = (row as usize).min(map.height - 1);
    let texel = row * map.width + (column as usize).min(map.width - 1);
    let radiance = irradiance / map.solid_angle(row);
    if let Some(texel) = map.texels.get_mut(texel) {
        *texel += radiance.as_vec3();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn irradiance(map: &LatLongMap, normal: DVec3) -> DVec3 {
        let texels = map.texels.iter().enumerate();
        texels
            .map(|(k, radiance)| {
                let (row, column) = (k / map.width, k % map.width);
                let cosine = map.direction(column as f64 + 0.5, row as f64 + 0.5).dot(normal).max(0.0);
                radiance.as_dvec3() * (cosine * map.solid_angle(row))
            })
            .sum()
    }

    #[test]
    fn the_overcast_sky_gives_a_horizontal_surface_seven_ninths_pi_of_its_zenith() {
        // ∫ (1+2 sin γ)/3 sin γ dω = 7π/9 (closed form).
        let up = irradiance(&overcast_sky(), DVec3::Y).y;
        assert!((up / PI - 1.0).abs() < 0.005, "{up}");
    }

    #[test]
    fn the_sun_is_one_texel_with_its_irradiance() {
        let map = sun();
        assert_eq!(map.texels.iter().filter(|t| t.x > 0.0).count(), 1);
        assert!((map.total().x - PI).abs() < 1e-5);
    }

    #[test]
    fn skies_have_sane_magnitudes_everywhere() {
        for (name, map) in [("studio", studio()), ("clear", clear_sky()), ("overcast", overcast_sky())] {
            assert!(map.texels.iter().all(|t| t.is_finite() && t.min_element() > 0.0), "{name}");
            let front = luminance(irradiance(&map, DVec3::new(0.0, 0.6, 0.8)));
            eprintln!("{name}: irradiance on a surface tilted back {front:.3}");
            assert!((1.0..6.0).contains(&front), "{name}: {front}");
        }
    }
}
