//! The figures of a [`super::Health`]. Each is measured at a few hundred directions, within a second.

use std::f32::consts::{PI, TAU};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{FactorHealth, HealthInputs, MaterialHealth, MeasuredHealth, ResultHealth, SurfaceHealth, VisibilityInput};
use crate::brdf::{Brdf, LUMINANCE, LobeAngles, Material, Measured, Term};
use crate::effective::{EffectiveBrdf, Reflectance, Representation};
use crate::math::directions::{PolarGrid, from_angles};
use crate::metrics::{Errors, mirror_biased_pairs};

/// Angles of the examined directions from the normal [degrees].
const POLAR_ANGLES_DEG: [f32; 6] = [5.0, 25.0, 45.0, 60.0, 70.0, 80.0];
/// Azimuths of the examined directions per polar angle.
const AZIMUTHS: usize = 8;
/// Fewest rings of lights over which albedos are summed.
const MIN_RINGS: usize = 12;
/// Most rings of lights over which albedos are summed.
const MAX_RINGS: usize = 22;
/// Half width of the narrowest lobe that `MAX_RINGS` resolve [degrees].
const NARROWEST_DEG: f32 = 5.0;
/// Number of direction pairs for reciprocity.
const PAIRS: usize = 96;
/// Number of normals about which facets are counted.
const NORMALS: usize = 64;

/// Examined directions with their angles [degrees]. They avoid the axes, along which many tiles are aligned.
fn views() -> impl Iterator<Item = ([f32; 2], Vec3)> {
    POLAR_ANGLES_DEG.into_iter().flat_map(|theta| {
        (0..AZIMUTHS).map(move |k| {
            let phi = 360.0 * (k as f32 + 0.37) / AZIMUTHS as f32;
            ([theta, phi], from_angles(theta.to_radians(), phi.to_radians()))
        })
    })
}

/// Measures the materials. `max_color_weight` is the largest weight of the colour image per channel.
pub fn materials(
    materials: &[Material],
    names: &[String],
    max_color_weight: Vec3,
) -> (Vec<MeasuredHealth>, Vec<MaterialHealth>) {
    let mut measured: Vec<MeasuredHealth> = Vec::new();
    let mut all = Vec::new();
    for (k, material) in materials.iter().enumerate() {
        for table in material.brdf.terms.iter().filter_map(Term::measured) {
            let report = table.report();
            let health = MeasuredHealth {
                name: table.name().to_owned(),
                samples: report.total,
                rejected: report.invalid_samples,
                reciprocity_residual: report.reciprocity_residual,
                resampling_error: report.resampling_error,
            };
            if !measured.contains(&health) {
                measured.push(health);
            }
        }
        let name = names.get(k).cloned().unwrap_or_default();
        let narrowest = material.brdf.terms.iter().filter_map(half_width).reduce(f32::min);
        all.push(MaterialHealth {
            name,
            largest_albedo: largest_albedo(&material.brdf, material.color * max_color_weight),
            narrowest_lobe_deg: narrowest.map(f32::to_degrees),
        });
    }
    (measured, all)
}

fn largest_albedo(brdf: &Brdf, color: Vec3) -> f32 {
    let angles = [0.0_f32, 20.0, 40.0, 60.0, 80.0];
    angles
        .iter()
        .map(|theta| (brdf.directional_albedo(theta.to_radians(), 48) * color).max_element())
        .fold(0.0, f32::max)
}

/// Angle between normal and half vector at which a lobe falls to about a third of its peak [rad]; `None` for a lobe
/// without a peak.
fn half_width(term: &Term) -> Option<f32> {
    match term {
        Term::Lambertian { .. } => None,
        Term::BlinnPhong { exponent, .. } => (*exponent > 4.0).then(|| (2.0 / exponent).sqrt()),
        Term::CookTorrance { roughness, .. } | Term::Ward { roughness, .. } => Some(roughness.atan()),
        // (tan²θ/α² + 1)² = e.
        Term::Ggx { roughness, .. } => Some((0.8 * roughness).atan()),
        Term::Measured(table) => half_width_of_table(table.as_ref()),
    }
}

fn half_width_of_table(table: &dyn Measured) -> Option<f32> {
    let at = |theta: f32| {
        let (sin, cos) = theta.sin_cos();
        let angles = LobeAngles { n_dot_i: cos, n_dot_o: cos, n_dot_h: cos, sin2_theta_h: sin * sin, i_dot_h: 1.0 };
        table.f_r(&angles).dot(LUMINANCE)
    };
    let steps: Vec<f32> = (0..180).map(|k| (0.25 + k as f32 * 0.25).to_radians()).collect();
    let peak = steps.iter().map(|&theta| at(theta)).fold(0.0, f32::max);
    let base = at(60.0_f32.to_radians()).min(peak);
    // The peak of a diffuse BRDF is hardly above its base.
    (peak > 3.0 * base.max(1e-6))
        .then(|| steps.into_iter().find(|&theta| at(theta) - base < (peak - base) / std::f32::consts::E))
        .flatten()
}

pub fn surface(inputs: &HealthInputs, lobe_deg: Option<f32>) -> SurfaceHealth {
    let facets = &inputs.facets;
    let mut health = SurfaceHealth {
        facets: facets.len(),
        is_exact: facets.replicates.is_empty(),
        triangles_left_out: facets.skipped_triangles,
        largest_color_weight: inputs.color.max().max_element(),
        has_holes: !inputs.closes_plane,
        fewest_visible_facets: facets.len(),
        facets_in_a_lobe: lobe_deg.and_then(|degrees| facets_within(&facets.normals, degrees.to_radians())),
        ..SurfaceHealth::default()
    };
    let mut visible = vec![false; facets.len()];
    match &inputs.visibility {
        VisibilityInput::Soft(visibility) => {
            health.truncated_searches = visibility.truncated();
            let mut v = vec![0.0; facets.len()];
            for (angles, direction) in views() {
                visibility.fill(direction, 0..facets.len(), &mut v);
                let mut count = 0;
                for ((visible, v), normal) in visible.iter_mut().zip(&v).zip(&facets.normals) {
                    let is_visible = *v > 0.5 && normal.dot(direction) > 0.0;
                    *visible |= is_visible;
                    count += usize::from(is_visible);
                }
                if count < health.fewest_visible_facets {
                    (health.fewest_visible_facets, health.fewest_visible_at_deg) = (count, angles);
                }
            }
        }
        VisibilityInput::Packed(packed) => {
            for direction in 0..packed.direction_count {
                for (facet, visible) in visible.iter_mut().enumerate() {
                    *visible |= packed.is_visible(direction, facet);
                }
            }
        }
    }
    let (mut hidden, mut all) = (0.0, 0.0);
    for (area, visible) in facets.areas.iter().zip(&visible) {
        all += f64::from(*area);
        hidden += if *visible { 0.0 } else { f64::from(*area) };
    }
    health.area_never_visible = if all > 0.0 { hidden / all } else { 0.0 };
    health
}

/// Number of normals within the angle `width` [rad] of a facet's normal: the smallest number but for a tenth of the
/// facets.
fn facets_within(normals: &[Vec3], width: f32) -> Option<usize> {
    let min_cosine = width.cos();
    let upward: Vec<Vec3> = normals.iter().copied().filter(|normal| normal.z > 0.05).collect();
    let step = (upward.len() / NORMALS).max(1);
    let mut counts: Vec<usize> = upward
        .par_iter()
        .step_by(step)
        // For very narrow lobes the cosine is not precise enough, so the distance is tested as well.
        .map(|n| normals.iter().filter(|other| (**other - *n).length() < width || other.dot(*n) > min_cosine).count())
        .collect();
    counts.sort_unstable();
    counts.get(counts.len() / 10).copied()
}

pub fn result(brdf: &EffectiveBrdf, inputs: &HealthInputs, lobe_deg: Option<f32>) -> ResultHealth {
    let mut health = ResultHealth::default();
    let geometric = inputs.facets.normals == inputs.facets.geometric_normals;
    if inputs.closes_plane && geometric && !inputs.facets.is_empty() {
        let mut worst = 0.0;
        for (angles, direction) in views() {
            let error = (f64::from(brdf.relative_projected_area(direction) / direction.z) - 1.0).abs();
            if error >= worst {
                (worst, health.worst_angle_deg) = (error, angles);
            }
        }
        health.projected_area_error = Some(worst);
    }
    let values: Vec<[Vec3; 2]> =
        mirror_biased_pairs(PAIRS, 11).into_par_iter().map(|p| [brdf.g(p.i, p.o), brdf.g(p.o, p.i)]).collect();
    let (mut difference, mut power) = (0.0, 0.0);
    for [there, back] in &values {
        let is_sound = |v: &Vec3| v.is_finite() && v.min_element() >= 0.0;
        health.unsound_values += usize::from(!is_sound(there)) + usize::from(!is_sound(back));
        difference += (*there - *back).as_dvec3().length_squared();
        power += there.as_dvec3().length_squared();
    }
    health.reciprocity_residual = if difference > 0.0 { (difference / power).sqrt() } else { 0.0 };
    if let Some(grid) = grid_for(lobe_deg) {
        let EffectiveAlbedo { largest: albedo, at, mean } = effective_albedo(brdf, grid);
        health.largest_albedo = Some(albedo);
        health.largest_albedo_at_deg = at;
        health.mean_albedo = Some(mean);
        health.unsound_values += usize::from(!albedo.is_finite());
    }
    health
}

/// The coarsest grid of lights that resolves lobes of a half width; `None` if it would be too fine.
fn grid_for(lobe_deg: Option<f32>) -> Option<PolarGrid> {
    let needed = lobe_deg.map_or(0, |degrees| (MAX_RINGS as f32 * NARROWEST_DEG / degrees).ceil() as usize);
    let rings = needed.max(MIN_RINGS);
    (rings <= MAX_RINGS).then(|| PolarGrid::new(rings, (13 * rings).div_ceil(4)))
}

/// `∫ f̄(i,o) dω_i` over a few viewers.
struct EffectiveAlbedo {
    /// The largest of any channel, and its viewer (theta, phi) [degrees].
    largest: f32,
    at: [f32; 2],
    /// Mean over channels and viewers, weighted by projected solid angles.
    mean: f32,
}

fn effective_albedo(brdf: &EffectiveBrdf, grid: PolarGrid) -> EffectiveAlbedo {
    let viewers: Vec<[f32; 2]> =
        [0.0_f32, 30.0, 60.0, 80.0].iter().flat_map(|&theta| [[theta, 20.0], [theta, 110.0]]).skip(1).collect();
    let albedos: Vec<Vec3> = viewers
        .par_iter()
        .map(|[theta, phi]| {
            let (lights, solid_angles) = lights_around(phi / 360.0 * TAU + PI, grid);
            let mut values = vec![Vec3::ZERO; lights.len()];
            brdf.eval_lights(&lights, from_angles(theta.to_radians(), phi / 360.0 * TAU), &mut values);
            let sum: DVec3 = values.iter().zip(solid_angles).map(|(v, part)| v.as_dvec3() * f64::from(part)).sum();
            sum.as_vec3()
        })
        .collect();
    let weights = viewers.iter().map(|[theta, _]| (2.0 * theta.to_radians()).sin());
    let [sum, total] = albedos
        .iter()
        .zip(weights)
        .fold([0.0; 2], |[sum, total], (albedo, weight)| [sum + weight * albedo.element_sum() / 3.0, total + weight]);
    let largest = albedos.iter().map(|albedo| albedo.max_element()).zip(viewers).max_by(|a, b| a.0.total_cmp(&b.0));
    let (largest, at) = largest.unwrap_or_default();
    EffectiveAlbedo { largest, at, mean: sum / total }
}

/// The lights of a grid with their solid angles. They are four times as dense at `azimuth` as on average, because half
/// vectors vary fastest there if the viewer is low.
fn lights_around(azimuth: f32, grid: PolarGrid) -> (Vec<Vec3>, Vec<f32>) {
    let lights = (0..grid.rings * grid.azimuths).map(|node| {
        let angle = TAU * (node % grid.azimuths) as f32 / grid.azimuths as f32;
        let density = 1.0 - 0.75 * angle.cos();
        let phi = azimuth + angle - 0.75 * angle.sin();
        (from_angles(grid.theta(node / grid.azimuths), phi), density * grid.solid_angle(node))
    });
    lights.unzip()
}

pub fn factorization(brdf: &EffectiveBrdf, factored: Option<Errors>, max_rank: usize) -> Option<FactorHealth> {
    let (used, ranks, step) = match brdf.direct_representation() {
        Representation::LowRank(factors) => {
            let step = std::f32::consts::FRAC_PI_2 / (factors.pairs.rings.max(2) - 1) as f32;
            (true, factors.channels.iter().map(|channel| channel.ranks.1).collect(), step)
        }
        Representation::Wu2011(tables) => {
            let ranks = tables.ranks();
            (true, ranks, (TAU / tables.direction_count().max(1) as f32).sqrt())
        }
        _ => {
            factored?;
            (false, Vec::new(), 0.0)
        }
    };
    let relative_error = factored.map(|errors| errors.rel_l2);
    Some(FactorHealth {
        used,
        relative_error,
        effective_digits: relative_error.filter(|error| *error > 0.0).map(|error| -error.log10()),
        at_rank_limit: matches!(brdf.direct_representation(), Representation::LowRank(_))
            && ranks.iter().any(|&rank: &usize| rank >= max_rank),
        ranks,
        lobe_grid_step_deg: step.to_degrees(),
    })
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::pipeline::Pipeline;
    use crate::scene;
    use crate::scene::{LoadedScene, Painted};

    #[test]
    fn albedos_are_summed_over_as_many_lights_as_lobes_need() {
        for (brdf, rings) in [
            (r#"{ kind = "lambertian", albedo = 0.5 }"#, 12),
            (r#"{ kind = "ggx", roughness = 0.35, f0 = 0.8 }"#, 12),
            (r#"{ kind = "ggx", roughness = 0.2, f0 = 0.8 }"#, 13),
            (r#"{ kind = "ggx", roughness = 0.132, f0 = 0.8 }"#, 19),
            (r#"{ kind = "ggx", roughness = 0.11, f0 = 0.8 }"#, 22),
            (r#"{ kind = "ggx", roughness = 0.15, f0 = 0.04 }"#, 17),
            (r#"{ kind = "cook_torrance", roughness = 0.15, f0 = 0.8 }"#, 13),
            (r#"{ kind = "blinn_phong", exponent = 100.0, specular = 0.8 }"#, 14),
        ] {
            for geometry in ["{ kind = \"flat\" }", "{ kind = \"pyramids\", spacing = 0.25, height = 0.1 }"] {
                let source = format!(
                    "[tile]\ngeometry = {geometry}\n[[material]]\nname = \"default\"\nbrdf = \
                     {brdf}\n[quality]\nfacets = 512\nmethod = \"direct\"\nbackend = \"cpu\"\n"
                );
                let (scene, name) = (scene::parse(&source).unwrap(), "test".to_owned());
                let loaded = LoadedScene { scene, base_dir: PathBuf::new(), name, painted: Painted::default() };
                let outcome = Pipeline::new().effective(&loaded).unwrap();
                let materials = materials(&outcome.health_inputs.materials.materials, &[], Vec3::ONE).1;
                let grid = grid_for(materials[0].narrowest_lobe_deg).unwrap();
                let [albedo, exact] =
                    [grid, PolarGrid::new(96, 320)].map(|grid| effective_albedo(&outcome.brdf, grid).largest);
                let error = (albedo / exact - 1.0).abs();
                eprintln!("{brdf} {geometry}: {} rings, {:.3} %", grid.rings, 100.0 * error);
                assert_eq!(grid.rings, rings, "{brdf}");
                assert!(error < 0.03, "{brdf}, {geometry}: {albedo} {exact}");
            }
        }
    }
}
