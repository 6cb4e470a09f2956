use super::super::Term;
use super::*;

fn basis(terms: Vec<Term>) -> ColorBasis {
    ColorBasis::of(&Brdf { terms })
}

fn assert_orthonormal(basis: &ColorBasis) {
    for a in 0..3 {
        for b in 0..3 {
            let expected = if a == b { 1.0 } else { 0.0 };
            assert!((basis.directions[a].dot(basis.directions[b]) - expected).abs() < 1e-6);
        }
    }
}

#[test]
fn one_tint_is_one_direction_with_all_the_energy() {
    let color = Vec3::new(0.9, 0.3, 0.1);
    let found = basis(vec![Term::Ward { roughness: 0.2, specular: color }]);
    assert!(found.directions[0].dot(color.normalize()) > 1.0 - 1e-6);
    assert!(found.energy[0] > 1.0 - 1e-9 && found.count_for(1.0) == 1);
    assert_orthonormal(&found);
}

#[test]
fn disjoint_colours_are_found_with_their_share_of_the_energy() {
    // The two colours share no channel, so the eigenvectors are the axes.
    let term = |specular| Term::Ward { roughness: 0.3, specular };
    let (red, green) = (term(Vec3::X * 2.0), Term::Lambertian { albedo: Vec3::Y });
    let alone = |term: &Term, c: usize| {
        let mut sum = 0.0;
        for h in 0..SAMPLED_BINS[0] {
            for d in 0..SAMPLED_BINS[1] {
                for phi in 0..SAMPLED_BINS[2] {
                    let (angles, weight) = sample_point([h, d, phi]);
                    sum += f64::from(term.f_cos(&angles)[c]).powi(2) * weight;
                }
            }
        }
        sum
    };
    let found = basis(vec![red.clone(), green.clone()]);
    let (r, g) = (alone(&red, 0), alone(&green, 1));
    assert!((found.energy[0] + found.energy[1] - 1.0).abs() < 1e-12 && found.energy[2] < 1e-12);
    // The two lobes overlap, so only the trace and the determinant are known.
    assert!((found.energy[0] * found.energy[1]) <= r * g / (r + g).powi(2) + 1e-12);
    assert!(found.directions[2].z.abs() > 1.0 - 1e-6 && found.count_for(0.9999) == 2);
    assert_orthonormal(&found);
}

#[test]
fn three_lobes_of_three_colours_need_three_directions_and_rebuild_exactly() {
    let terms = vec![
        Term::Lambertian { albedo: Vec3::new(0.1, 0.2, 0.8) },
        Term::Ward { roughness: 0.1, specular: Vec3::new(0.9, 0.1, 0.1) },
        Term::BlinnPhong { exponent: 4.0, specular: Vec3::new(0.1, 0.9, 0.1) },
    ];
    let found = basis(terms);
    assert_eq!(found.count_for(1.0), 3);
    let color = Vec3::new(0.2, 0.7, 0.4);
    let rebuilt: Vec3 = found.project(color).iter().zip(found.directions).map(|(&c, d)| c * d).sum();
    assert!((rebuilt - color).length() < 1e-6);
}

#[test]
fn the_sampled_energy_is_that_of_random_direction_pairs() {
    // ∫∫ (cosθ_i cosθ_o / π)² dω_i dω_o = (2/3)² for a Lambertian; the weights omit the factor 4 · 2π · 4 · bin
    // widths.
    let [bins_h, bins_d, bins_phi] = SAMPLED_BINS;
    let lambertian = Term::Lambertian { albedo: Vec3::X };
    let mut sum = 0.0;
    for bin in (0..bins_h * bins_d * bins_phi).map(|k| [k / (bins_d * bins_phi), k / bins_phi % bins_d, k % bins_phi]) {
        let (angles, weight) = sample_point(bin);
        sum += f64::from(lambertian.f_cos(&angles).x).powi(2) * weight;
    }
    use std::f64::consts::{FRAC_PI_2, PI};
    // θ_h = (π/2) t², so dθ_h = 2 √(π/2) √θ_h dt. All φ_h give 2π, and φ_d covers four times [0, π/2].
    let widths = 2.0 * FRAC_PI_2.sqrt() / bins_h as f64 * FRAC_PI_2 / bins_d as f64 * FRAC_PI_2 / bins_phi as f64;
    let integral = sum * 4.0 * widths * 2.0 * PI * 4.0;
    assert!((integral / (4.0 / 9.0) - 1.0).abs() < 0.01, "{integral}");
}

#[test]
fn a_black_brdf_has_no_energy_and_one_direction() {
    let found = basis(vec![Term::Lambertian { albedo: Vec3::ZERO }]);
    assert_eq!(found.energy, [0.0; 3]);
    assert!(basis(Vec::new()).directions[0].is_finite());
}
