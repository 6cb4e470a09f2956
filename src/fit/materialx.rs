//! A fitted GGX base as a MaterialX document with an OpenPBR surface.

use glam::Vec3;

use super::Fit;

/// Bounds f0, and thereby the index of refraction.
const MAX_F0: f32 = 0.98;

/// Returns a MaterialX document. `specular_color` scales the whole Fresnel factor of a dielectric, so it holds the
/// fitted edge. The index of refraction is the one whose f0, times the edge, is the largest channel of the fitted f0. A
/// metal's edge is white.
pub fn materialx(fit: &Fit, name: &str) -> String {
    let weight = |k: usize| fit.weights.get(k).copied().unwrap_or_default();
    let (base, f0, fuzz) = (weight(0), weight(1).clamp(Vec3::ZERO, Vec3::splat(MAX_F0)), weight(2));
    let metal = f0.dot(crate::brdf::LUMINANCE) > base.dot(crate::brdf::LUMINANCE);
    let largest = f0.max_element();
    let edge = fit.shape.edge.max(largest / MAX_F0).min(1.0);
    let root = if edge > 0.0 { (largest / edge).min(MAX_F0).sqrt() } else { 0.0 };
    let ior = (1.0 + root) / (1.0 - root);
    let tint = edge * if largest > 1e-6 { f0 / largest } else { Vec3::ONE };
    let [x, y] = fit.shape.roughness;
    let (wide, narrow) = (x.max(y), x.min(y));
    // OpenPBR: α_t = r² √(2 / (1 + (1-a)²)), α_b = (1-a) α_t.
    let anisotropy = 1.0 - narrow / wide;
    let roughness = (wide / (2.0 / (1.0 + (1.0 - anisotropy).powi(2))).sqrt()).sqrt();
    let color = |color: Vec3| {
        let color = color.clamp(Vec3::ZERO, Vec3::ONE);
        format!("{:.6}, {:.6}, {:.6}", color.x, color.y, color.z)
    };
    let input = |name: &str, kind: &str, value: String| {
        format!("    <input name=\"{name}\" type=\"{kind}\" value=\"{value}\" />\n")
    };
    let inputs = [
        input("base_color", "color3", color(if metal { f0 } else { base })),
        input("base_metalness", "float", if metal { "1" } else { "0" }.to_owned()),
        input("specular_color", "color3", color(if metal { Vec3::ONE } else { tint })),
        input("specular_ior", "float", format!("{ior:.6}")),
        input("specular_roughness", "float", format!("{roughness:.6}")),
        input("specular_roughness_anisotropy", "float", format!("{anisotropy:.6}")),
        if anisotropy > 0.0 { tangent_input() } else { String::new() },
        input("fuzz_weight", "float", format!("{:.6}", fuzz.max_element().clamp(0.0, 1.0))),
        input(
            "fuzz_color",
            "color3",
            color(if fuzz.max_element() > 0.0 { fuzz / fuzz.max_element() } else { Vec3::ONE }),
        ),
    ];
    let nodes = if anisotropy > 0.0 { tangent_nodes(fit.shape.wide_azimuth().to_degrees()) } else { String::new() };
    document(&nodes, &inputs.concat(), name)
}

/// A document with one OpenPBR surface: `nodes` before it, and its inputs.
pub(super) fn document(nodes: &str, inputs: &str, name: &str) -> String {
    // A name must not begin with a digit.
    let prefix = if name.starts_with(|c: char| c.is_ascii_digit()) { "_" } else { "" };
    let identifier: String =
        prefix.chars().chain(name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })).collect();
    format!(
        "<?xml version=\"1.0\"?>\n<materialx version=\"1.39\" colorspace=\"lin_rec709\">\n{nodes}  <open_pbr_surface name=\"{identifier}_surface\" \
         type=\"surfaceshader\">\n{inputs}  </open_pbr_surface>\n  <surfacematerial name=\"{identifier}\" type=\"material\">\n    <input \
         name=\"surfaceshader\" type=\"surfaceshader\" nodename=\"{identifier}_surface\" />\n  </surfacematerial>\n</materialx>\n"
    )
}

fn tangent_input() -> String {
    "    <input name=\"geometry_tangent\" type=\"vector3\" nodename=\"lobe_tangent\" />\n".to_owned()
}

/// Returns nodes for the tangent along which the lobe is wide: the surface tangent, rotated about the normal.
fn tangent_nodes(degrees: f32) -> String {
    format!(
        "  <tangent name=\"surface_tangent\" type=\"vector3\">\n    <input name=\"space\" type=\"string\" value=\"world\" />\n  </tangent>\n  \
         <normal name=\"surface_normal\" type=\"vector3\">\n    <input name=\"space\" type=\"string\" value=\"world\" />\n  </normal>\n  \
         <rotate3d name=\"lobe_tangent\" type=\"vector3\">\n    <input name=\"in\" type=\"vector3\" nodename=\"surface_tangent\" />\n    \
         <input name=\"amount\" type=\"float\" value=\"{degrees:.4}\" />\n    <input name=\"axis\" type=\"vector3\" \
         nodename=\"surface_normal\" />\n  </rotate3d>\n"
    )
}
