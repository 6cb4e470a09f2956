//! Times of the stages, one at a time: `cargo bench --bench stages`. The times are medians of seven runs after a
//! warm-up, beside a yardstick of the machine from the same run. `cargo bench --bench stages -- horizon` runs the lines
//! whose name contains a word.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use biscale::base::Cancel;
use biscale::brdf::{Brdf, Material, Term, analytic_lobe};
use biscale::effective::{
    Direct, EffectiveBrdf, FacetSum, LowRank, Nodes, Reflectance, Representation, RotatedBasis, RotatedLobe,
    ShadingTable,
};
use biscale::geometry;
use biscale::geometry::{Facets, PeriodicGrid, TileMesh};
use biscale::math::directions::{HemispherePairGrid, from_angles};
use biscale::metrics::{image_pairs, mirror_biased_pairs};
use biscale::plan::{Preset, Settings};
use biscale::visibility::{HorizonMap, OcclusionIntervals, Visibility};
use glam::Vec3;

const RUNS: usize = 7;

/// Runs and prints one line at a time.
struct Bench {
    filter: Option<String>,
    /// True under `cargo test --benches`, which runs each line once.
    once: bool,
    yardstick_ms: f64,
}

impl Bench {
    fn new() -> Self {
        let arguments: Vec<String> = std::env::args().skip(1).collect();
        let mut bench = Self {
            filter: arguments.iter().find(|argument| !argument.starts_with('-')).cloned(),
            once: !arguments.iter().any(|argument| argument == "--bench"),
            yardstick_ms: 0.0,
        };
        bench.yardstick_ms = bench.median_ms(|| {
            let mut sum = 0.0_f32;
            for k in 0..1_000_000 {
                sum = (sum + black_box(k) as f32).sqrt();
            }
            sum
        });
        println!("yardstick: a million dependent square roots, {:.3} ms", bench.yardstick_ms);
        println!("{:<40} {:>12} {:>14} {:>12}", "stage", "median", "each", "yardsticks");
        bench
    }

    fn median_ms<T>(&self, mut work: impl FnMut() -> T) -> f64 {
        let runs = if self.once { 1 } else { RUNS };
        if !self.once {
            black_box(work());
        }
        let mut times: Vec<f64> = (0..runs)
            .map(|_| {
                let start = Instant::now();
                black_box(work());
                start.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        times.sort_by(f64::total_cmp);
        times[runs / 2]
    }

    /// Times `work`, one call of which computes `count` items of the kind `each`.
    fn line<T>(&self, name: &str, count: usize, each: &str, work: impl FnMut() -> T) {
        if self.filter.as_ref().is_some_and(|filter| !name.contains(filter)) {
            return;
        }
        let ms = self.median_ms(work);
        let ns = ms * 1e6 / count as f64;
        println!("{name:<40} {ms:>9.3} ms {ns:>10.1} ns/{each} {:>9.2}", ms / self.yardstick_ms);
    }
}

fn tile(scene: &str) -> Result<TileMesh, biscale::base::Error> {
    let loaded = biscale::scene::open(scene, &[])?;
    geometry::build(&loaded.scene.tile, &loaded.base_dir)
}

fn facets_of(mesh: &TileMesh, count: usize) -> Facets {
    let mut facets = Facets::sample(mesh, count, 1);
    facets.sort_for_sums();
    facets
}

fn terms() -> Vec<(&'static str, Term)> {
    vec![
        ("lambertian", Term::Lambertian { albedo: Vec3::splat(0.5) }),
        ("blinn_phong 50", Term::BlinnPhong { exponent: 50.0, specular: Vec3::ONE }),
        ("cook_torrance 0.2", Term::CookTorrance { roughness: 0.2, f0: Vec3::splat(0.8) }),
        ("ward 0.3", Term::Ward { roughness: 0.3, specular: Vec3::ONE }),
        ("ggx 0.2", Term::Ggx { roughness: 0.2, f0: Vec3::splat(0.8) }),
    ]
}

fn materials(term: &Term, slots: usize) -> (Vec<usize>, Vec<Material>) {
    (vec![0; slots], vec![Material { brdf: Brdf { terms: vec![term.clone()] }, color: Vec3::ONE }])
}

fn main() -> Result<(), biscale::base::Error> {
    let bench = Bench::new();
    let settings = Settings::of_preset(Preset::Standard);
    let count = settings.facets;
    let (field, rods) = (tile("fig8a_hammered")?, tile("fig6a_velvet_spread")?);
    let azimuths = settings.horizon_azimuths;

    for (name, mesh) in [("height field", &field), ("rods", &rods)] {
        bench.line(&format!("facets, {name}"), count, "facet", || facets_of(mesh, count));
        bench.line(&format!("periodic grid, {name}"), mesh.triangles.len(), "triangle", || PeriodicGrid::new(mesh));
    }
    let (facets, rod_facets) = (facets_of(&field, count), facets_of(&rods, count));
    if let Some(heights) = &field.height_grid {
        bench.line("horizon map, march over the samples", count * azimuths, "azimuth", || {
            HorizonMap::march(heights, field.size, &facets, azimuths, settings.penumbra)
        });
    }
    let (grid, rod_grid) = (PeriodicGrid::for_slices(&field), PeriodicGrid::for_slices(&rods));
    bench.line("horizon map, scan of the triangles", count * azimuths, "azimuth", || {
        HorizonMap::scan(&grid, &facets, azimuths, settings.penumbra)
    });
    let slice_azimuths = settings.slice_azimuths;
    bench.line("slices of the triangles (rods)", count * slice_azimuths, "slice", || {
        OcclusionIntervals::scan(&rod_grid, &rod_facets, slice_azimuths, settings.penumbra)
    });

    let (i, o) = (from_angles(0.5, 0.3), from_angles(0.9, 2.0));
    let horizon_map = Arc::new(Visibility::HorizonMap(HorizonMap::scan(&grid, &facets, azimuths, settings.penumbra)));
    let sliced = Visibility::OcclusionIntervals(OcclusionIntervals::scan(
        &rod_grid,
        &rod_facets,
        slice_azimuths,
        settings.penumbra,
    ));
    let mut visible = vec![0.0; count];
    for (name, visibility) in [("horizon map", horizon_map.as_ref()), ("occlusion intervals", &sliced)] {
        // Stratified sampling rounds the number of facets.
        visible.resize(visibility.facets(), 0.0);
        bench.line(&format!("visibility of a direction, {name}"), visible.len(), "facet", || {
            visibility.fill(black_box(i), 0..visible.len(), &mut visible);
        });
    }

    let pairs = mirror_biased_pairs(64, 1);
    let all_visible = vec![1.0; facets.len()];
    for (name, term) in terms() {
        let (material_of_slot, materials) = materials(&term, field.slots.len());
        let sum = FacetSum::new(&facets, &material_of_slot, &materials);
        bench.line(&format!("sum of a pair, {name}"), facets.len(), "facet", || {
            sum.sum(black_box(i), o, &all_visible, &all_visible)
        });
        let low_rank = settings.low_rank(false);
        if let Some(lobe) = analytic_lobe(&term) {
            let entries = low_rank.basis.pairs.nodes() * low_rank.basis.normal_rings;
            let lobe = RotatedLobe::Analytic(lobe);
            bench.line(&format!("rotated basis, {name}"), entries, "entry", || {
                RotatedBasis::new(lobe, low_rank.basis, low_rank.keep_m)
            });
        }
        let build = || LowRank::build(&facets, &horizon_map, &material_of_slot, &materials, &low_rank);
        bench.line(&format!("factors with their basis, {name}"), facets.len(), "facet", build);
        let base_area = f64::from(field.base_area());
        let direct = Direct::new(Arc::new(sum), horizon_map.clone());
        for (representation_name, representation) in
            [("direct", Representation::Direct(direct)), ("factors", Representation::LowRank(build()?))]
        {
            let brdf = EffectiveBrdf { representation, base_area };
            bench.line(&format!("eval, {representation_name}, {name}"), pairs.len(), "pair", || {
                pairs.iter().map(|pair| brdf.eval(pair.i, pair.o)).sum::<Vec3>()
            });
        }
    }
    images(&bench, &rods, &rod_facets, sliced)
}

/// Times shading BRDFs beside the sums that they replace.
fn images(bench: &Bench, rods: &TileMesh, facets: &Facets, sliced: Visibility) -> Result<(), biscale::base::Error> {
    let ggx = Term::Ggx { roughness: 0.2, f0: Vec3::splat(0.8) };
    let direct = |mesh: &TileMesh, facets: &Facets, visibility: Visibility| {
        let (material_of_slot, materials) = materials(&ggx, mesh.slots.len());
        Direct::new(Arc::new(FacetSum::new(facets, &material_of_slot, &materials)), Arc::new(visibility))
    };
    let rod_sum = direct(rods, facets, sliced);
    let grid = HemispherePairGrid { rings: 16, azimuths: 24, phi_d: 6, theta_d: 8 };
    let checked = image_pairs(64, 1);
    let all_nodes = Nodes::all(grid);
    for (name, nodes) in [
        ("all facets", all_nodes),
        ("a fifth of the facets", Nodes { facets: Some(facets.len() / 5), ..all_nodes }),
        ("all facets, nodes of 64 pairs", Nodes { read_by: Some(&checked), ..all_nodes }),
    ] {
        bench.line(&format!("table (rods), {name}"), grid.nodes(), "node", || {
            ShadingTable::build(&rod_sum, nodes, &Cancel::default())
        });
    }

    let lights: Vec<Vec3> = (0..32_u8).map(|k| from_angles(0.2 + 0.03 * f32::from(k), 2.4 * f32::from(k))).collect();
    let o = from_angles(0.6, 1.0);
    let grooves = tile("fig4b_bicolor_cup")?;
    let groove_facets = facets_of(&grooves, Settings::of_preset(Preset::Standard).facets);
    let settings = Settings::of_preset(Preset::Standard);
    let horizon_map = HorizonMap::scan(
        &PeriodicGrid::for_slices(&grooves),
        &groove_facets,
        settings.horizon_azimuths,
        settings.penumbra,
    );
    let groove_sum = direct(&grooves, &groove_facets, Visibility::HorizonMap(horizon_map));
    let total = |representation: &Representation, base_area: f64| {
        let (brdf, mut out) =
            (EffectiveBrdf { representation: representation.clone(), base_area }, vec![Vec3::ZERO; lights.len()]);
        move |lights: &[Vec3]| {
            brdf.eval_lights(lights, o, &mut out);
            out.iter().sum::<Vec3>()
        }
    };
    let mut lines =
        vec![("few distinct normals, all at once (grooves)", Representation::Direct(groove_sum.clone()), true)];
    if let Some(strided_subset) = groove_sum.strided_subset(27) {
        lines.push(("few distinct normals, every 27th facet (grooves)", Representation::Direct(strided_subset), true));
    }
    lines.push(("few distinct normals, light by light (grooves)", Representation::Direct(groove_sum), false));
    if let Some(table) = ShadingTable::build(&rod_sum, all_nodes, &Cancel::default())? {
        lines.push(("a table, all at once (rods)", Representation::Table(table), true));
    }
    lines.push(("the sum, light by light (rods)", Representation::Direct(rod_sum), false));
    for (name, representation, at_once) in lines {
        let mut eval = total(&representation, f64::from(rods.base_area()));
        bench.line(name, lights.len(), "light", || {
            if at_once { eval(&lights) } else { lights.iter().map(|light| eval(std::slice::from_ref(light))).sum() }
        });
    }
    Ok(())
}
