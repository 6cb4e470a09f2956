//! The lights on an object: directional lights that represent an environment, and those listed in the scene.

use std::path::Path;

use glam::Vec3;

use super::environment;
use super::environment::Environment;
use crate::base::{InputError, Result};
use crate::scene;

/// Maximum number of lights that an environment may be split into.
pub const MAX_COUNT: usize = 4096;

/// Light from one direction. Radiance towards the viewer is `Σ irradiance · f̄(direction, o)`; f̄ includes the cosine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectionalLight {
    /// Unit vector towards the light, in the world frame.
    pub direction: Vec3,
    /// Irradiance on a surface that faces the light (radiance times solid angle), linear RGB.
    pub irradiance: Vec3,
}

/// The lights of a scene and the environment that they represent.
#[derive(Debug, Clone, Default)]
pub struct Lights {
    pub directional: Vec<DirectionalLight>,
    /// Environment as loaded: rotation and intensity apply to `directional`, not to these texels.
    pub environment: Environment,
    pub warnings: Vec<String>,
}

/// Loads the environment, splits it into `light.count` directional lights and adds the listed ones.
pub fn build(light: &scene::Light, base_dir: &Path) -> Result<Lights> {
    check(light)?;
    let environment = environment::load(&light.environment, base_dir)?;
    Ok(from_environment(light, environment))
}

/// Builds the lights from a loaded environment, after an edit of count, rotation or intensity.
pub fn from_environment(light: &scene::Light, environment: Environment) -> Lights {
    let rotation = glam::Quat::from_rotation_y(light.rotation_deg.to_radians());
    let mut directional: Vec<_> = environment::split(&environment.map, light.count.min(MAX_COUNT))
        .into_iter()
        .map(|l| DirectionalLight { direction: rotation * l.direction, irradiance: l.irradiance * light.intensity })
        .filter(|l| l.irradiance != Vec3::ZERO)
        .collect();
    directional.extend(light.directional.iter().filter_map(|listed| {
        let direction = listed.direction.as_dvec3().try_normalize()?.as_vec3();
        Some(DirectionalLight { direction, irradiance: listed.irradiance })
    }));
    let mut warnings = environment.warnings.clone();
    if directional.is_empty() {
        warnings.push("the scene has no light, so the image is black".to_owned());
    }
    Lights { directional, environment, warnings }
}

/// Refuses lights out of range.
pub fn check(light: &scene::Light) -> Result<()> {
    if light.count > MAX_COUNT {
        return Err(InputError::new("light.count", light.count, format!("0 to {MAX_COUNT}")).into());
    }
    if !light.rotation_deg.is_finite() {
        return Err(InputError::new("light.rotation_deg", light.rotation_deg, "a finite angle in degrees").into());
    }
    if !(light.intensity >= 0.0 && light.intensity.is_finite()) {
        return Err(InputError::new("light.intensity", light.intensity, "a finite number from 0").into());
    }
    for (k, listed) in light.directional.iter().enumerate() {
        if listed.direction.as_dvec3().try_normalize().is_none() || !listed.direction.is_finite() {
            let place = format!("light.directional[{k}].direction");
            return Err(InputError::new(place, listed.direction, "a finite direction that is not zero").into());
        }
        if !listed.irradiance.is_finite() || listed.irradiance.min_element() < 0.0 {
            let place = format!("light.directional[{k}].irradiance");
            return Err(InputError::new(place, listed.irradiance, "finite numbers from 0").into());
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(environment: &str, count: usize) -> scene::Light {
        scene::Light { environment: environment.to_owned(), count, ..scene::Light::default() }
    }

    #[test]
    fn rotation_turns_about_the_vertical_and_intensity_scales() {
        let plain = build(&light("sun", 8), Path::new(".")).unwrap().directional;
        let turned = scene::Light { rotation_deg: 90.0, intensity: 2.0, ..light("sun", 8) };
        let turned = build(&turned, Path::new(".")).unwrap().directional;
        assert_eq!((plain.len(), turned.len()), (1, 1));
        let expected = Vec3::new(plain[0].direction.z, plain[0].direction.y, -plain[0].direction.x);
        assert!((turned[0].direction - expected).length() < 1e-6);
        assert_eq!(turned[0].irradiance, plain[0].irradiance * 2.0);
    }

    #[test]
    fn listed_lights_are_added_with_unit_directions() {
        let direction = Vec3::new(0.0, 0.0, 1e-30);
        let listed = scene::DirectionalSpec { direction, irradiance: Vec3::ONE };
        let lights = build(&scene::Light { directional: vec![listed], ..light("none", 32) }, Path::new(".")).unwrap();
        assert_eq!(lights.directional, [DirectionalLight { direction: Vec3::Z, irradiance: Vec3::ONE }]);
    }

    #[test]
    fn bad_lights_are_named() {
        let zero = scene::DirectionalSpec { direction: Vec3::ZERO, irradiance: Vec3::ONE };
        let negative = scene::DirectionalSpec { direction: Vec3::Y, irradiance: Vec3::NEG_X };
        let cases = [
            (scene::Light { directional: vec![zero], ..light("none", 1) }, "light.directional[0].direction"),
            (scene::Light { directional: vec![negative], ..light("none", 1) }, "light.directional[0].irradiance"),
            (scene::Light { intensity: f32::NAN, ..light("none", 1) }, "light.intensity"),
            (scene::Light { rotation_deg: f32::INFINITY, ..light("none", 1) }, "light.rotation_deg"),
            (light("none", 1 << 20), "light.count"),
            (light("studoi", 1), "did you mean \"studio\""),
        ];
        for (light, expected) in cases {
            let error = build(&light, Path::new(".")).unwrap_err();
            assert!(error.to_string().contains(expected), "{error}");
        }
    }

    #[test]
    fn no_environment_and_no_list_is_dark_and_says_so() {
        let lights = build(&light("none", 32), Path::new(".")).unwrap();
        assert!(lights.directional.is_empty() && !lights.warnings.is_empty());
    }
}
