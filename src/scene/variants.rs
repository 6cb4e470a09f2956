//! Random variants of a material: its numbers and colours, each changed by up to a fifth.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use toml::Value;

use super::{KeyEntry, Scene, keys_of, load_with_overrides};

/// Parts of a scene whose numbers describe the material, and not the view of it.
const PARTS: [&str; 4] = ["tile.", "material.", "slab.", "color_map."];
/// Largest relative change of a number.
const CHANGE: f64 = 0.2;
/// Changes that are drawn before the program gives up, because values may exclude each other.
const ATTEMPTS: u64 = 8;

/// Returns true if a key describes the material, and not the view of it.
pub fn describes_material(entry: &KeyEntry) -> bool {
    PARTS.iter().any(|part| entry.key.starts_with(part))
}

/// A scene whose numbers and colours differ from those of `scene` by up to a fifth, within their ranges. `None` if no such
/// scene is valid.
pub fn variant(scene: &Scene, seed: u64) -> Option<Scene> {
    let text = scene.to_toml().ok()?;
    let keys = keys_of(scene).ok()?;
    (0..ATTEMPTS).find_map(|attempt| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(attempt);
        let assignments = keys.iter().filter(|entry| describes_material(entry)).filter_map(|entry| {
            let value = varied(entry, || 1.0 + CHANGE * (2.0 * random.random::<f64>() - 1.0))?;
            Some(format!("{}={value}", entry.key))
        });
        load_with_overrides(&text, &assignments.collect::<Vec<_>>()).ok()
    })
}

/// The value of a key times random factors; `None` if nothing changes.
fn varied(entry: &KeyEntry, mut factor: impl FnMut() -> f64) -> Option<Value> {
    let value = entry.value.as_ref()?;
    let [least, most] = entry.range.unwrap_or([0.0, 1.0]);
    let mut scaled = |value: f64| (value * factor()).clamp(least, most);
    let varied = match (value, entry.kind) {
        (Value::Float(number), "number") => Value::Float(scaled(*number)),
        (Value::Integer(number), "number") => Value::Float(scaled(*number as f64)),
        // Another seed is another surface.
        (Value::Integer(number), "integer") if !entry.key.ends_with(".seed") => {
            Value::Integer(scaled(*number as f64).round() as i64)
        }
        (Value::Array(channels), "color") => {
            let channels = channels.iter().map(|channel| channel.as_float().or(channel.as_integer().map(|n| n as f64)));
            Value::Array(channels.map(|channel| Some(Value::Float(scaled(channel?)))).collect::<Option<_>>()?)
        }
        _ => return None,
    };
    (varied != *value).then_some(varied)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Geometry, open};

    #[test]
    fn variants_differ_by_up_to_a_fifth_and_keep_the_view() {
        for name in ["fig4b_bicolor_cup", "fig7a_shot_silk", "fig1b_heights_color_map", "table4_pillow", "slab_fig5_45"]
        {
            let scene = open(name, &[]).unwrap().scene;
            for seed in 0..9 {
                let varied = variant(&scene, seed).unwrap();
                assert_eq!(
                    (&varied.camera, &varied.light, &varied.quality),
                    (&scene.camera, &scene.light, &scene.quality)
                );
                assert_ne!(varied, scene, "{name}");
                let (before, after) = (keys_of(&scene).unwrap(), keys_of(&varied).unwrap());
                assert_eq!(before.len(), after.len());
                for (before, after) in before.iter().zip(&after).filter(|(entry, _)| entry.kind == "number") {
                    let [old, new] = [before, after].map(|entry| entry.value.as_ref().and_then(Value::as_float));
                    if let [Some(old), Some(new)] = [old, new] {
                        assert!((new - old).abs() <= 0.2001 * old.abs(), "{name}, {}: {old} {new}", before.key);
                    }
                }
            }
            assert_ne!(variant(&scene, 1), variant(&scene, 2));
            assert_eq!(variant(&scene, 1), variant(&scene, 1));
        }
    }

    #[test]
    fn values_stay_within_their_ranges() {
        let mut scene = open("fig4b_bicolor_cup", &[]).unwrap().scene;
        scene.materials[0].color = glam::Vec3::ONE;
        scene.tile.geometry = Geometry::with_defaults("pyramids").unwrap();
        for seed in 0..20 {
            assert!(variant(&scene, seed).unwrap().validate().is_ok());
        }
    }
}
