use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::pipeline::Pipeline;
use crate::testing::gaussian_tile::{BANDS, layer, loaded, smooth};

/// A file of queries with some bytes replaced, inserted or removed.
fn mutated(random: &mut ChaCha8Rng, text: &str) -> Vec<u8> {
    const PARTS: &[u8] = b"0123456789.,-+eE\n\r\"naif u\xff";
    let mut bytes = text.as_bytes().to_vec();
    for _ in 0..random.random_range(1..6) {
        let at = random.random_range(text.find('\n').unwrap_or(0)..bytes.len().max(text.len()));
        let part = PARTS[random.random_range(0..PARTS.len())];
        match random.random_range(0..3) {
            0 if at < bytes.len() => bytes[at] = part,
            1 if at < bytes.len() => drop(bytes.remove(at)),
            _ => bytes.insert(at.min(bytes.len()), part),
        }
    }
    bytes
}

#[test]
fn any_file_of_queries_is_refused_as_input_or_has_finite_colours_between_those_of_the_stops() {
    let flat = format!(
        "[tile]\ngeometry = {{ kind = \"flat\" }}\n{}",
        layer("{ kind = \"noise\", basis = \"perlin\", cells = 4 }", BANDS)
    );
    let surface = layer("{ kind = \"slope\" }", BANDS)
        .replace("[color_map]\n", "[color_map]\ndistribution = \"smith\"\nsurface = { height = 0.1 }\n");
    let pipeline = Pipeline::new();
    let scenes = [flat, format!("[tile]\ngeometry = {{ kind = \"flat\" }}\n{surface}")].map(|text| loaded(&text));
    let filters = scenes.each_ref().map(|scene| pipeline.color_filter(scene).unwrap());
    let path = std::env::temp_dir().join(format!("biscale_queries_{}.csv", std::process::id()));
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut evaluated = 0;
    for (_, header, _) in KINDS.iter().cycle().take(1000) {
        let numbers = header.split(',').map(|_| "0.5").collect::<Vec<_>>().join(",");
        std::fs::write(&path, mutated(&mut random, &format!("{header}\n{numbers}\n"))).unwrap();
        let queries = match Queries::read(&path) {
            Ok(queries) => queries,
            Err(error) => {
                assert_eq!(error.exit_code(), 2, "{error}");
                continue;
            }
        };
        let of_surface = usize::from(queries.kind == Kind::View || queries.kind == Kind::Pair);
        let filter = &filters[of_surface];
        let scene = &scenes[of_surface];
        let results = evaluate(&queries, FilterMethod::Filtered, None, filter, &pipeline, scene).unwrap();
        let first = queries.results.split(',').position(|name| name == "r").unwrap();
        for row in &results.rows {
            evaluated += 1;
            assert!(row[first..first + 3].iter().all(|value| (0.0..=0.951).contains(value)), "{header} {row:?}");
        }
    }
    std::fs::remove_file(&path).unwrap();
    assert!(evaluated > 100, "{evaluated}");
}

#[test]
fn colours_of_heights_slopes_and_overhangs_are_those_of_rays() {
    let (height, slope) = ("{ kind = \"height\" }", "{ kind = \"slope\", azimuth_deg = 30 }");
    let weave = format!(
        "[tile]\ngeometry = {{ kind = \"weave\" }}\n[quality]\npreset = \"standard\"\n{}",
        layer(height, BANDS)
    );
    let tiles = [
        ("heights", smooth(96, 8, "standard", &layer(height, BANDS))),
        ("slopes", smooth(96, 8, "standard", &layer(slope, BANDS))),
        ("heights of a weave", loaded(&weave)),
    ];
    let pairs = crate::metrics::mirror_biased_pairs(40, 9);
    for (name, loaded) in tiles {
        let pipeline = Pipeline::new();
        let filter = pipeline.color_filter(&loaded).unwrap();
        let truth = true_colors(&pipeline, &loaded, &pairs, 16_384).unwrap();
        let (mut square, mut of_naive, mut worst) = (0.0, 0.0, 0.0_f64);
        for (pair, (expected, _)) in pairs.iter().zip(&truth) {
            let error = filter.pair(pair.i.as_dvec3(), pair.o.as_dvec3()).color - *expected;
            square += error.length_squared() / 3.0;
            of_naive += (filter.naive() - *expected).length_squared() / 3.0;
            worst = worst.max(error.abs().max_element());
        }
        let [rms, of_naive] = [square, of_naive].map(|sum| (sum / pairs.len() as f64).sqrt());
        println!("{name}: RMS {rms:.4}, worst {worst:.4}; colour of the mean {of_naive:.4}");
        assert!(rms < 0.01 && worst < 0.03, "{name}: RMS {rms}, worst {worst}");
        assert!(of_naive > 0.05, "{name}: {of_naive}");
    }
}
