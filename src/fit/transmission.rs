//! A thin rough surface of glTF or OpenPBR in place of a slab: one GGX lobe around the straight direction.
//!
//! A thin-walled surface transmits what a mirror of the same roughness would reflect, turned to the other side: with the
//! light mirrored about the surface, its BTDF is `c (1 - F) D(h) G(i, o) / (4 |cos θ_i cos θ_o|)`.

use glam::{DVec3, Vec3};
use serde_json::json;

use crate::base::progress::{in_parallel, part};
use crate::base::{Error, Progress, Result, require_finite};
use crate::effective::Transmittance;
use crate::metrics::{Errors, Pair, compare, mirror_biased_pairs};
use crate::slab::Slab;
use crate::slab::fresnel::reflectance;

/// Number of pairs that are fitted, and of other pairs over which the error is measured.
const FITTED: usize = 3000;
const CHECKED: usize = 1000;
const SEED: u64 = 2009;
/// Steps of the search for the roughness, which narrows an interval by the golden section.
const STEPS: usize = 30;
/// Even steps before it.
const FIRST_STEPS: usize = 24;
/// Smallest and largest GGX roughness.
const ROUGHNESS: [f64; 2] = [1e-3, 1.0];

/// A fitted thin surface.
#[derive(Debug, Clone, PartialEq)]
pub struct ThinFit {
    /// Index of refraction, the mean of the channels.
    pub eta: f32,
    /// GGX roughness α of the lobe; 0 if all light keeps its direction.
    pub alpha: f32,
    /// Factor on the lobe without Fresnel reflection, linear RGB.
    pub color: Vec3,
    /// Part of light along the normal that keeps its direction, linear RGB.
    pub straight: Vec3,
    /// Errors of the scattered `f̄` over pairs that are not part of the fit.
    pub errors: Errors,
}

/// Smallest cosine of both directions, 60°. A thin surface scatters grazing light unlike a slab, and these bright pairs would
/// decide the fit.
const LEAST_COSINE: f32 = 0.5;

/// Pairs with the light above and the viewer below.
fn pairs(count: usize, seed: u64) -> Vec<Pair> {
    let over = |v: Vec3| Vec3::new(v.x, v.y, -v.z);
    let near = mirror_biased_pairs(4 * count, seed).into_iter().filter(|pair| pair.i.z.min(pair.o.z) > LEAST_COSINE);
    near.take(count).map(|pair| Pair { o: over(pair.o), ..pair }).collect()
}

/// `(1 - F) D(h) G(i, o) |cos θ_i| / (4 |cos θ_i cos θ_o|)` of GGX with the viewer mirrored to the light's side.
fn lobe(alpha: f64, eta: f64, i: DVec3, o: DVec3) -> f64 {
    let o = DVec3::new(o.x, o.y, -o.z);
    let Some(h) = (i + o).try_normalize().filter(|_| i.z > 0.0 && o.z > 0.0) else { return 0.0 };
    let square = alpha * alpha;
    let slope = (1.0 - h.z * h.z) / (h.z * h.z);
    let d = square / (std::f64::consts::PI * (h.z * h.z * (square + slope)).powi(2));
    let lambda = |w: DVec3| 0.5 * ((1.0 + square * (1.0 - w.z * w.z) / (w.z * w.z)).sqrt() - 1.0);
    (1.0 - reflectance(i.dot(h), eta)) * d / (1.0 + lambda(i) + lambda(o)) / (4.0 * o.z)
}

/// The best colour of a roughness, and what it leaves of the squares.
fn solve(alpha: f64, eta: f64, pairs: &[Pair], targets: &[Vec3]) -> (DVec3, f64) {
    let (mut product, mut square, mut all) = (DVec3::ZERO, 0.0, 0.0);
    for (pair, target) in pairs.iter().zip(targets) {
        let (value, target) = (lobe(alpha, eta, pair.i.as_dvec3(), pair.o.as_dvec3()), target.as_dvec3());
        product += value * target;
        square += value * value;
        all += target.length_squared();
    }
    let color = if square > 0.0 { (product / square).max(DVec3::ZERO) } else { DVec3::ZERO };
    (color, all - color.dot(product))
}

/// Fits a thin surface to a slab.
///
/// # Errors
/// As [`fit_thin`].
pub fn fit_slab(slab: &Slab, progress: &Progress<'_>) -> Result<ThinFit> {
    let straight = slab.straight(DVec3::Z)[0].as_vec3();
    let eta = (slab.optics.eta.element_sum() / 3.0) as f32;
    fit_thin(slab, eta, straight, progress)
}

/// Fits a thin surface to what a slab transmits, by least squares of `f̄` over directions up to 60° from the normal.
/// `straight` is the part of light along the normal that keeps its direction.
///
/// # Errors
/// [`Error::Cancelled`] if `progress` cancels, or a value that is not finite.
fn fit_thin(slab: &dyn Transmittance, eta: f32, straight: Vec3, progress: &Progress<'_>) -> Result<ThinFit> {
    let values = |pairs: &[Pair], progress: &Progress<'_>| {
        let values = in_parallel(pairs.len(), progress, |k| {
            let mut value = [Vec3::ZERO];
            slab.eval_transmitted(&[pairs[k].i], pairs[k].o, &mut value);
            value[0]
        })?;
        require_finite(&values)?;
        Ok::<_, Error>(values)
    };
    let (fitted, checked) = (pairs(FITTED, SEED), pairs(CHECKED, SEED + 1));
    let targets = values(&fitted, &part(progress, 0.0, 0.75))?;
    let exact = values(&checked, &part(progress, 0.75, 1.0))?;
    if targets.iter().all(|value| *value == Vec3::ZERO) {
        let errors = Errors { rel_l2: 0.0, psnr_db: f64::INFINITY };
        return Ok(ThinFit { eta, alpha: 0.0, color: Vec3::ZERO, straight, errors });
    }
    // The golden section, over the logarithm of the roughness, around the best of even steps.
    let [least, most] = ROUGHNESS.map(f64::ln);
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let index = f64::from(eta);
    let cost = |x: f64| solve(x.exp(), index, &fitted, &targets).1;
    let step = (most - least) / FIRST_STEPS as f64;
    let starts = (0..=FIRST_STEPS).map(|k| least + step * k as f64).map(|x| (cost(x), x));
    let (_, best) = starts.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, least));
    let (mut low, mut high) = ((best - step).max(least), (best + step).min(most));
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut at_a, mut at_b) = (cost(a), cost(b));
    for _ in 0..STEPS {
        if at_a < at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - ratio * (high - low);
            at_a = cost(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + ratio * (high - low);
            at_b = cost(b);
        }
    }
    let alpha = (0.5 * (low + high)).exp();
    let color = solve(alpha, index, &fitted, &targets).0;
    let of = |pair: &Pair| (lobe(alpha, index, pair.i.as_dvec3(), pair.o.as_dvec3()) * color).as_vec3();
    let errors = compare(&checked.iter().map(of).collect::<Vec<Vec3>>(), &exact);
    Ok(ThinFit { eta, alpha: alpha as f32, color: color.as_vec3(), straight, errors })
}

impl ThinFit {
    /// The colour of the whole transmitted light, and its roughness. Both formats have one lobe: straight light joins it.
    fn one_lobe(&self) -> (Vec3, f32) {
        let fresnel = ((self.eta - 1.0) / (self.eta + 1.0)).powi(2);
        // The formats multiply transmission by one minus the Fresnel reflectance, as the fitted lobe does.
        let total = self.color + self.straight / (1.0 - fresnel);
        let part = if total.element_sum() > 0.0 { self.color.element_sum() / total.element_sum() } else { 0.0 };
        (total.clamp(Vec3::ZERO, Vec3::ONE), self.alpha * part)
    }
}

/// A glTF file that contains only the material, with `KHR_materials_transmission`.
pub fn thin_gltf(fit: &ThinFit, name: &str) -> String {
    let (color, alpha) = fit.one_lobe();
    let file = json!({
        "asset": { "version": "2.0", "generator": concat!("biscale ", env!("CARGO_PKG_VERSION")) },
        "extensionsUsed": ["KHR_materials_transmission", "KHR_materials_ior"],
        "materials": [{
            "name": name,
            "doubleSided": true,
            "pbrMetallicRoughness": {
                "baseColorFactor": [color.x, color.y, color.z, 1.0],
                "metallicFactor": 0.0,
                // Roughness in the sense of glTF is the root of that of GGX.
                "roughnessFactor": alpha.sqrt(),
            },
            "extensions": {
                "KHR_materials_transmission": { "transmissionFactor": 1.0 },
                "KHR_materials_ior": { "ior": fit.eta },
            },
            "extras": {
                "fit": { "color": fit.color.to_array(), "straight": fit.straight.to_array() },
                "alpha": fit.alpha,
                "rel_l2": fit.errors.rel_l2,
            },
        }],
    });
    format!("{file:#}\n")
}

/// A MaterialX document with a thin-walled OpenPBR surface.
pub fn thin_materialx(fit: &ThinFit, name: &str) -> String {
    let (color, alpha) = fit.one_lobe();
    let input = |name: &str, kind: &str, value: String| {
        format!("    <input name=\"{name}\" type=\"{kind}\" value=\"{value}\" />\n")
    };
    let inputs = [
        input("transmission_weight", "float", "1".to_owned()),
        input("transmission_color", "color3", format!("{:.6}, {:.6}, {:.6}", color.x, color.y, color.z)),
        input("specular_ior", "float", format!("{:.6}", fit.eta)),
        input("specular_roughness", "float", format!("{:.6}", alpha.sqrt())),
        input("geometry_thin_walled", "boolean", "true".to_owned()),
    ];
    super::materialx::document("", &inputs.concat(), name)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A thin surface of known roughness and colour.
    struct Known;

    impl Transmittance for Known {
        fn eval_transmitted(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
            for (light, value) in lights.iter().zip(out) {
                *value = Vec3::new(0.9, 0.6, 0.3) * lobe(0.17, 1.5, light.as_dvec3(), o.as_dvec3()) as f32;
            }
        }
    }

    #[test]
    fn a_thin_surface_is_found_again_and_its_lobe_holds_nearly_all_light() {
        let fit = fit_thin(&Known, 1.5, Vec3::ZERO, &|_| true).unwrap();
        assert!((fit.alpha - 0.17).abs() < 1e-4 && (fit.color - Vec3::new(0.9, 0.6, 0.3)).length() < 1e-4, "{fit:?}");
        assert!(fit.errors.rel_l2 < 1e-4);
        // The lobe over the disc of exit directions: 1 but for masking.
        let i = DVec3::new(0.3, 0.0, 0.91_f64.sqrt());
        let side = 400;
        let at = |k: usize| (k as f64 + 0.5) * 2.0 / f64::from(side) - 1.0;
        let mut sum = 0.0;
        for (x, y) in (0..side as usize).flat_map(|x| (0..side as usize).map(move |y| (x, y))) {
            let square: f64 = at(x) * at(x) + at(y) * at(y);
            if square < 1.0 {
                let o = DVec3::new(at(x), at(y), -(1.0 - square).sqrt());
                sum += lobe(0.17, 1.0, i, o) / i.z * (2.0 / f64::from(side)).powi(2);
            }
        }
        assert!((sum - 1.0).abs() < 0.05, "{sum}");
    }

    #[test]
    fn the_files_hold_transmission_roughness_and_the_loss_of_a_frosted_slab() {
        let loaded = crate::scene::open("slab_fig3_both", &["quality.preset=draft".to_owned()]).unwrap();
        let slab = crate::pipeline::Pipeline::new().slab(&loaded).unwrap().slab;
        let fit = fit_thin(&*slab, 1.5, Vec3::ZERO, &|_| true).unwrap();
        println!("{fit:?}");
        // Two faces of 0.2 deflect as one mirror of about (η - 1) / 2 times their joint roughness.
        assert!((0.05..0.2).contains(&fit.alpha) && fit.errors.rel_l2 < 0.7, "{fit:?}");
        let gltf: serde_json::Value = serde_json::from_str(&thin_gltf(&fit, "glass")).unwrap();
        let material = &gltf["materials"][0];
        assert_eq!(material["extensions"]["KHR_materials_transmission"]["transmissionFactor"], 1.0);
        assert!(material["extras"]["rel_l2"].as_f64().unwrap() > 0.0);
        let text = thin_materialx(&fit, "frosted glass");
        assert!(text.contains("transmission_weight") && text.contains("frosted_glass_surface"), "{text}");
    }
}
