//! A fitted GGX base as a glTF 2.0 material with the Khronos extensions for specular, anisotropy and sheen.

use glam::Vec3;
use serde_json::json;

use super::Fit;

/// Reflectance at normal incidence of glTF's dielectrics.
const DIELECTRIC_F0: f32 = 0.04;

/// Returns a glTF file that contains only the material. The material is a metal if its specular lobe has more luminance
/// than its diffuse part.
///
/// A glTF metal has no diffuse part and a white edge, and glTF's sheen attenuates the base layer. `extras` hold all
/// numbers of the fit.
pub fn gltf(fit: &Fit, name: &str) -> String {
    let weight = |k: usize| fit.weights.get(k).copied().unwrap_or_default();
    let (base, f0, sheen) = (weight(0), weight(1), weight(2));
    let luminance = |color: Vec3| color.dot(crate::brdf::LUMINANCE);
    let metal = luminance(f0) > luminance(base);
    let color = if metal { f0 } else { base }.clamp(Vec3::ZERO, Vec3::ONE);
    let (roughness, anisotropy) = fit.shape.perceptual();
    let mut extensions = serde_json::Map::new();
    if !metal {
        // `specularFactor` scales the edge and f0, `specularColorFactor` f0 alone.
        let strength = fit.shape.edge.max(f0.max_element()).clamp(0.0, 1.0);
        let factor = if strength > 0.0 { (f0 / (DIELECTRIC_F0 * strength)).max(Vec3::ZERO) } else { Vec3::ONE };
        extensions.insert(
            "KHR_materials_specular".into(),
            json!({ "specularFactor": strength, "specularColorFactor": factor.to_array() }),
        );
    }
    if anisotropy > 0.0 {
        let strength = json!({ "anisotropyStrength": anisotropy, "anisotropyRotation": fit.shape.wide_azimuth() });
        extensions.insert("KHR_materials_anisotropy".into(), strength);
    }
    if sheen.max_element() > 0.0 {
        let color = sheen.clamp(Vec3::ZERO, Vec3::ONE).to_array();
        extensions.insert(
            "KHR_materials_sheen".into(),
            json!({ "sheenColorFactor": color, "sheenRoughnessFactor": 0.5f32.sqrt() }),
        );
    }
    let used: Vec<&String> = extensions.keys().collect();
    let weights: serde_json::Map<String, serde_json::Value> = fit
        .model
        .weight_names()
        .iter()
        .zip(&fit.weights)
        .map(|(name, weight)| ((*name).into(), json!(weight.to_array())))
        .collect();
    let mut file = json!({
        "asset": { "version": "2.0", "generator": concat!("biscale ", env!("CARGO_PKG_VERSION")) },
        "materials": [{
            "name": name,
            "pbrMetallicRoughness": {
                "baseColorFactor": [color.x, color.y, color.z, 1.0],
                "metallicFactor": if metal { 1.0 } else { 0.0 },
                "roughnessFactor": roughness,
            },
            "extensions": extensions,
            "extras": { "fit": weights, "alpha": fit.shape.roughness, "rotation": fit.shape.rotation, "edge": fit.shape.edge, "rel_l2": fit.errors.rel_l2 },
        }],
    });
    // The schema forbids an empty list.
    if !used.is_empty() {
        file["extensionsUsed"] = json!(used);
    }
    format!("{file:#}\n")
}
