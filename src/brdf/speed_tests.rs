//! Nanoseconds per BRDF evaluation.

use std::f32::consts::TAU;
use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use glam::Vec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Brdf, LobeAngles, MeasuredCache, MeasuredKind, Term};
use crate::math::directions::{from_angles, half_vector};

/// Time of the fastest of thirty runs, in nanoseconds per item; the minimum excludes other load on the machine.
fn nanoseconds(items: usize, mut run: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..30)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e9 / items as f64
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[0]
}

#[test]
#[ignore = "a measurement: cargo bench --bench measure -- brdf"]
fn nanoseconds_per_evaluation() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut direction = |max_theta: f32| from_angles(rng.random_range(0.0..max_theta), rng.random_range(0.0..TAU));
    // Angles as in a sum over facets, with 512 normals per direction pair, and random angles.
    let mut facets = Vec::new();
    for _ in 0..64 {
        let (i, o) = (direction(1.4), direction(1.4));
        facets.extend((0..512).map(|_| LobeAngles::new(direction(0.6), i, o, half_vector(i, o))));
    }
    let random: Vec<LobeAngles> = (0..1 << 18)
        .map(|_| {
            let (i, o) = (direction(1.4), direction(1.4));
            LobeAngles::new(Vec3::Z, i, o, half_vector(i, o))
        })
        .collect();
    let mut out = vec![0.0_f32; random.len()];
    let color = Vec3::new(0.9, 0.6, 0.3);
    let mut terms = vec![
        Term::Lambertian { albedo: color },
        Term::BlinnPhong { exponent: 50.0, specular: color },
        Term::CookTorrance { roughness: 0.2, f0: color },
        Term::Ward { roughness: 0.3, specular: color },
        Term::Ggx { roughness: 0.2, f0: color },
    ];
    let mut cache = MeasuredCache::default();
    let merl = PathBuf::from("/tmp/merl/gold-metallic-paint.binary");
    terms.extend(cache.load(MeasuredKind::Merl, &merl).ok().map(Term::Measured));
    let rgl = PathBuf::from(std::env::var("BISCALE_DATA").unwrap_or_default()).join("vch_silk_blue_rgb.bsdf");
    terms.extend(cache.load(MeasuredKind::Rgl, &rgl).ok().map(Term::Measured));
    for term in terms {
        let many = nanoseconds(facets.len(), || term.lobe_cos_many(black_box(&facets), &mut out));
        let brdf = Brdf { terms: vec![term.clone()] };
        let colour = |angles: &[LobeAngles]| {
            nanoseconds(angles.len(), || {
                black_box(black_box(angles).iter().map(|a| brdf.f_cos(a)).sum::<Vec3>());
            })
        };
        let (near, far) = (colour(&facets), colour(&random));
        if let Some(table) = term.measured() {
            let mut out = vec![Vec3::ZERO; facets.len()];
            let many = nanoseconds(facets.len(), || table.f_r_many(black_box(&facets), &mut out));
            println!("{:<24} f_r_many {many:.1} ns", table.name());
        }
        let basis = super::ColorBasis::of(&brdf);
        println!(
            "{:<24} lobe_cos_many {many:5.2} ns, f_cos {near:5.1} ns (facets) {far:5.1} ns (random)  colours {:?} {:?}",
            term.measured().map_or_else(
                || format!("{term:?}").split(' ').next().unwrap_or_default().to_owned(),
                |t| t.name().to_owned()
            ),
            basis.energy,
            basis.directions[0],
        );
    }
}
