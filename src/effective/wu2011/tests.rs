//! The `wu2011` preset against brute force on small cases.

use std::f32::consts::{PI, TAU};

use glam::{DVec3, Vec2, Vec3};

use super::visible_normals::BinnedFacets;
use super::*;
use crate::brdf::{Brdf, Term};
use crate::geometry::{PeriodicGrid, TileMesh};
use crate::math::directions::ParaboloidSphere;
use crate::visibility::ray_cast;

/// Settings without truncation: more random rows than the 450 columns of a Lambertian M.
fn exact() -> Wu2011Settings {
    Wu2011Settings { keep_m: 1.0, keep_n: 1.0, projection_rows: 460, m_directions: Some(132), ..Default::default() }
}

fn material(term: Term) -> Material {
    Material { brdf: Brdf { terms: vec![term] }, color: Vec3::ONE }
}

fn lambertian() -> Material {
    material(Term::Lambertian { albedo: Vec3::new(0.8, 0.4, 0.2) })
}

fn glossy() -> Material {
    material(Term::CookTorrance { roughness: 0.5, f0: Vec3::splat(0.9) })
}

fn flat() -> TileMesh {
    TileMesh {
        size: Vec2::ONE,
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        triangle_slot: vec![0; 2],
        slots: vec!["default".into()],
        ..Default::default()
    }
}

/// Bumps on a square grid, with two slots in a checkerboard of quadrants.
fn bumps() -> TileMesh {
    const N: usize = 16;
    let mut mesh = TileMesh { size: Vec2::ONE, slots: vec!["a".into(), "b".into()], ..Default::default() };
    for j in 0..=N {
        for i in 0..=N {
            let (x, y) = (i as f32 / N as f32, j as f32 / N as f32);
            mesh.positions.push(Vec3::new(x, y, 0.15 * (TAU * x).sin() * (TAU * y).cos()));
        }
    }
    for j in 0..N {
        for i in 0..N {
            let at = (j * (N + 1) + i) as u32;
            let up = at + N as u32 + 1;
            mesh.triangles.extend([[at, at + 1, up + 1], [at, up + 1, up]]);
            mesh.triangle_slot.extend([u16::from((i < N / 2) == (j < N / 2)); 2]);
        }
    }
    mesh
}

struct Sampled {
    facets: Facets,
    visibility: PackedVisibility,
    map: ParaboloidMap,
}

fn sampled(mesh: &TileMesh, count: usize) -> Sampled {
    let mut facets = Facets::sample_wu2011(mesh, count, 3);
    facets.sort_for_sums();
    let map = ParaboloidMap::nearest_to(Wu2011Settings::VISIBILITY_DIRECTIONS);
    let visibility = ray_cast(&PeriodicGrid::new(mesh), &facets, map.directions());
    Sampled { facets, visibility, map }
}

impl Sampled {
    fn build(&self, material_of_slot: &[usize], materials: &[Material], settings: &Wu2011Settings) -> Wu2011 {
        Wu2011::build(&self.facets, &self.visibility, &self.map, 1.0, material_of_slot, materials, settings).unwrap()
    }

    /// `Σ_s ΔA α V V f(nearest normal)` by definition.
    fn brute_force(&self, i: usize, o: usize, normals: &[Vec3], material_of: impl Fn(usize) -> Material) -> DVec3 {
        let (to_light, to_viewer) = (self.map.directions()[i], self.map.directions()[o]);
        (0..self.facets.len())
            .filter(|&s| self.visibility.is_visible(i, s) && self.visibility.is_visible(o, s))
            .map(|s| {
                let material = material_of(s);
                let f = material.brdf.f(normals[s], to_light, to_viewer) * material.color * self.facets.colors[s];
                (f * self.facets.areas[s]).as_dvec3()
            })
            .sum()
    }

    fn binned_normals(&self, material: &Material) -> Vec<Vec3> {
        let half = ParaboloidMap::nearest_to(sampling::Sampling::of(&material.brdf).half_normals);
        let normals = ParaboloidSphere::new(half);
        self.facets.normals.iter().map(|&n| normals.direction(normals.nearest(n))).collect()
    }

    /// Relative L2 over a subset of all pairs of nodes.
    fn error(&self, built: &Wu2011, truth: impl Fn(usize, usize) -> DVec3) -> f64 {
        let (mut difference, mut norm) = (0.0, 0.0);
        for o in (0..self.map.len()).step_by(7) {
            let lights: Vec<usize> = (0..self.map.len()).step_by(5).collect();
            let directions: Vec<Vec3> = lights.iter().map(|&i| self.map.directions()[i]).collect();
            built.sums(&directions, self.map.directions()[o], |k, sum| {
                let expected = truth(lights[k], o);
                difference += (sum - expected).length_squared();
                norm += expected.length_squared();
            });
        }
        (difference / norm).sqrt()
    }
}

#[test]
fn rows_and_pairs_are_each_others_inverse() {
    for row in (0..60_000).chain([1_725_152, 1_725_153]) {
        let (i, o) = pair_of_row(row);
        assert!(i <= o && rows_of(o) + i == row);
    }
    assert_eq!(rows_of(132), 8778);
}

#[test]
fn a_flat_lambertian_tile_reflects_albedo_over_pi_times_cosine() {
    let tile = sampled(&flat(), 300);
    let built = tile.build(&[0], &[lambertian()], &exact());
    for &o in tile.map.directions().iter().step_by(3) {
        let lights = tile.map.directions();
        let mut sums = vec![DVec3::ZERO; lights.len()];
        let area = built.sums(lights, o, |k, sum| sums[k] = sum);
        assert!((area - f64::from(o.z)).abs() < 1e-5);
        for (sum, light) in sums.iter().zip(lights) {
            let expected = DVec3::new(0.8, 0.4, 0.2) * f64::from(light.z / PI);
            // Singular values below 1e-5 of the largest are dropped, and only one column of 450 contributes.
            assert!((*sum / area - expected).length() < 5e-4, "{} {expected}", *sum / area);
        }
    }
}

#[test]
fn without_truncation_the_product_is_the_binned_sum_at_the_nodes() {
    let tile = sampled(&bumps(), 400);
    for material in [lambertian(), glossy()] {
        let built = tile.build(&[0, 0], std::slice::from_ref(&material), &exact());
        let normals = tile.binned_normals(&material);
        let error = tile.error(&built, |i, o| tile.brute_force(i, o, &normals, |_| material.clone()));
        assert!(error < 2e-3, "{error}: {:?}", built.ranks());
    }
}

#[test]
fn several_materials_and_colour_weights_add_up() {
    let mut tile = sampled(&bumps(), 300);
    for (color, position) in tile.facets.colors.iter_mut().zip(&tile.facets.positions) {
        *color = Vec3::new(position.x, 1.0 - position.x, 0.5);
    }
    let materials = [lambertian(), Material { color: Vec3::new(1.0, 0.5, 0.1), ..lambertian() }];
    let built = tile.build(&[0, 1], &materials, &exact());
    assert_eq!(built.ranks().len(), 2);
    let normals = tile.binned_normals(&materials[0]);
    let error = tile.error(&built, |i, o| {
        tile.brute_force(i, o, &normals, |s| materials[usize::from(tile.facets.slots[s])].clone())
    });
    assert!(error < 2e-3, "{error}");
}

#[test]
fn the_papers_truncation_stays_within_its_stated_power() {
    let tile = sampled(&bumps(), 400);
    for (material, paper) in [(lambertian(), 7), (glossy(), 17)] {
        let settings = Wu2011Settings { m_directions: Some(132), ..Default::default() };
        let m = MaterialFactors::new(&material, &settings).unwrap();
        // The random projection is not optimal; its rank is near that of Table 3.
        assert!(m.channels[0].kept > 0.97 && m.channels[0].kept <= 1.0 + 1e-6, "{}", m.channels[0].kept);
        assert!(m.rank() >= paper / 2 && m.rank() <= 3 * paper, "{} {paper}", m.rank());
    }
    // N is rebuilt row by row from its factors.
    let normals = ParaboloidSphere::new(ParaboloidMap::nearest_to(224));
    let nearest: Vec<usize> = tile.facets.normals.iter().map(|&n| normals.nearest(n)).collect();
    let visibility: Vec<f32> = (0..tile.map.len())
        .flat_map(|d| {
            (0..tile.facets.len()).map({
                let tile = &tile;
                move |s| f32::from(u8::from(tile.visibility.is_visible(d, s)))
            })
        })
        .collect();
    let binned = BinnedFacets::new(&tile.map, &visibility, &nearest, &normals);
    for (rows, lost) in [(50, 4.0 * 0.005), (400, 1.5 * 0.005)] {
        let settings = Wu2011Settings { projection_rows: rows, ..Default::default() };
        let n = binned.factor(&tile.facets.areas, &settings).unwrap();
        let (mut error, mut power) = (0.0, 0.0);
        for row in 0..rows_of(tile.map.len()) {
            let (i, o) = pair_of_row(row);
            let weight = f64::from(tile.map.solid_angle(i) * tile.map.solid_angle(o)) * if i == o { 1.0 } else { 2.0 };
            let mut exact = vec![0.0; binned.bins.len()];
            for s in 0..tile.facets.len() {
                if tile.visibility.is_visible(i, s) && tile.visibility.is_visible(o, s) {
                    exact[binned.bin_of_facet[s]] += f64::from(tile.facets.areas[s]);
                }
            }
            let u = &n.table[(o * tile.map.len() + i) * n.rank..][..n.rank];
            #[expect(clippy::needless_range_loop, reason = "several arrays are walked by one index")]
            for j in 0..exact.len() {
                let centred = exact[j] - n.mean[j];
                let rebuilt: f64 = u.iter().zip(&n.vectors[j * n.rank..]).map(|(u, v)| f64::from(*u) * v).sum();
                error += weight * (binned.bin_weights[j] * (centred - rebuilt)).powi(2);
                power += weight * (binned.bin_weights[j] * centred).powi(2);
            }
        }
        assert!(error < lost * power, "{rows} rows: {}", error / power);
        assert!(n.rank > 1 && n.rank < rows.min(binned.bins.len()));
    }
}

#[test]
fn the_same_seed_gives_the_same_bits_with_any_number_of_threads() {
    let tile = sampled(&bumps(), 200);
    let settings = Wu2011Settings { m_directions: Some(60), ..Default::default() };
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| tile.build(&[0, 0], &[glossy()], &settings).groups[0].tables[0].values.clone())
    };
    let one = with_threads(1);
    assert_eq!(one, with_threads(3));
    assert!(one.iter().all(|value| value.is_finite()));
}

#[test]
fn wrong_settings_are_errors_and_values_below_the_horizon_are_zero() {
    let tile = sampled(&flat(), 50);
    let bad = [
        Wu2011Settings { keep_m: f64::NAN, ..exact() },
        Wu2011Settings { projection_rows: 0, ..exact() },
        Wu2011Settings { colors: 4, ..exact() },
        Wu2011Settings { m_directions: Some(1 << 40), ..exact() },
    ];
    for settings in bad {
        let built = Wu2011::build(&tile.facets, &tile.visibility, &tile.map, 1.0, &[0], &[lambertian()], &settings);
        assert!(matches!(built, Err(Error::Input(_))));
    }
    let without = Wu2011::build(&tile.facets, &tile.visibility, &tile.map, 1.0, &[], &[lambertian()], &exact());
    assert!(without.is_err());
    let built = tile.build(&[0], &[material(Term::Lambertian { albedo: Vec3::ZERO })], &exact());
    assert_eq!(built.sums(&[Vec3::Z], Vec3::Z, |_, sum| assert_eq!(sum, DVec3::ZERO)), 1.0);
    let built = tile.build(&[0], &[lambertian()], &exact());
    assert_eq!(built.sums(&[Vec3::Z], -Vec3::Z, |_, sum| assert_eq!(sum, DVec3::ZERO)), 0.0);
    built.sums(&[-Vec3::Z], Vec3::Z, |_, sum| assert_eq!(sum, DVec3::ZERO));
}
