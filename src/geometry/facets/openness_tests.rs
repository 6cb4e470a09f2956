use super::*;
use crate::geometry;
use crate::math::directions::from_angles;

/// Leaning rods, much of which is hidden.
fn velvet() -> TileMesh {
    let loaded = crate::scene::open("fig6a_velvet_spread", &[]).unwrap();
    geometry::build(&loaded.scene.tile, &loaded.base_dir).unwrap()
}

fn samples(mesh: &TileMesh, count: usize, by_openness: bool) -> impl Iterator<Item = Facets> {
    let sampler = FacetSampler::new(mesh);
    let openness = Openness::measure(&sampler, mesh, &PeriodicGrid::new(mesh));
    (1..=6).map(SampleShift::from_seed).map(move |shift| {
        if by_openness {
            sampler.sample_by_openness(mesh, count, shift, &openness)
        } else {
            sampler.sample(mesh, count, shift)
        }
    })
}

#[test]
fn facets_by_openness_keep_the_number_the_area_and_the_moments_of_the_surface() {
    let mesh = velvet();
    let area = FacetSampler::new(&mesh).area();
    let moment = |facets: &Facets| -> f64 {
        facets.positions.iter().zip(&facets.areas).map(|(p, area)| f64::from(p.z * area)).sum()
    };
    let expected = moment(&Facets::sample(&mesh, 200_000, 1));
    let mut mean = 0.0;
    for facets in samples(&mesh, 1500, true) {
        assert_eq!((facets.len(), facets.replicates.len()), (1500, 1500));
        let sum: f64 = facets.areas.iter().map(|area| f64::from(*area)).sum();
        assert!((sum / area - 1.0).abs() < 1e-5, "{sum} {area}");
        mean += moment(&facets) / 6.0;
    }
    assert!((mean / expected - 1.0).abs() < 0.01, "{mean} {expected}");
}

#[test]
fn diffuse_reflection_varies_less_between_samples_by_openness() {
    let mesh = velvet();
    let grid = PeriodicGrid::new(&mesh);
    let variance = |by_openness: bool| -> f64 {
        let samples: Vec<Facets> = samples(&mesh, 2048, by_openness).collect();
        let at = |k: usize| {
            let [i, o] = [1.7, 4.1].map(|step| from_angles(0.2 + 0.1 * k as f32, step * k as f32));
            let reflected = |facets: &Facets| -> f64 {
                let visible = |s: &usize| [i, o].iter().all(|to| is_facet_visible(&grid, facets, *s, *to));
                let seen = |s: usize| facets.areas[s] * facets.normals[s].dot(i) * facets.normals[s].dot(o);
                (0..facets.len()).filter(visible).map(|s| f64::from(seen(s))).sum()
            };
            let values: Vec<f64> = samples.iter().map(reflected).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            values.iter().map(|value| (value / mean - 1.0).powi(2)).sum::<f64>()
        };
        (0..10).into_par_iter().map(at).sum()
    };
    let (by_area, by_openness) = (variance(false), variance(true));
    assert!(by_openness < 0.5 * by_area, "{by_openness} {by_area}");
}

#[test]
fn shares_sum_to_the_number_of_facets_and_leave_out_no_group() {
    let group = |count: usize, openness: f64| Group { candidates: (0..count).collect(), openness };
    let groups = [group(1, 0.2), group(100, 0.2), group(100, 1.0), group(3, 50.0)];
    let counts = shares(&groups, 51);
    assert_eq!(counts.iter().sum::<usize>(), 51);
    assert_eq!((counts[0], counts[3]), (1, 3));
    assert!(counts[2] > 4 * counts[1], "{counts:?}");
}
