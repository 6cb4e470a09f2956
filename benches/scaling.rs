//! Growth of the time of each stage with its size: `cargo bench --bench scaling`. Each line multiplies one size, takes
//! the shortest of a few runs, and fits an exponent. The last lines compare one thread with two.

use std::f32::consts::TAU;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use biscale::base::Result;
use biscale::brdf::{Brdf, Material, Term};
use biscale::effective::{Direct, EffectiveBrdf, FacetSum, Representation};
use biscale::geometry;
use biscale::geometry::families::heightfield;
use biscale::geometry::{Facets, PeriodicGrid, TileMesh};
use biscale::metrics::mirror_biased_pairs;
use biscale::pipeline::Pipeline;
use biscale::render::RenderScene;
use biscale::render::image::shading::ImageBackground;
use biscale::render::render;
use biscale::visibility::{HorizonMap, OcclusionIntervals, Visibility};
use glam::{UVec2, Vec2, Vec3};

const RUNS: usize = 3;
/// Width of the soft step at a horizon [rad].
const TRANSITION_WIDTH: f32 = 0.02;
const SHADING: &str = "fig8a_hammered";

type Work = Box<dyn FnMut() + Send>;

struct Bench {
    /// True under `cargo test --benches`, which runs each line once.
    once: bool,
}

impl Bench {
    /// Times `work` at each size, and prints the times and the exponent of their growth.
    fn line(
        &self,
        name: &str,
        expected: f64,
        sizes: &[usize],
        mut work: impl FnMut(usize) -> Result<Work>,
    ) -> Result<()> {
        let sizes = if self.once { &sizes[..1] } else { sizes };
        let mut times = Vec::new();
        for &size in sizes {
            let mut run = work(size)?;
            times.push(self.shortest_ms(&mut *run));
        }
        let exponent = slope(sizes, &times);
        let times: Vec<String> = times.iter().map(|ms| format!("{ms:.3}")).collect();
        println!(
            "{name:<44} {:>9} to {:>9} {exponent:>8.2} {expected:>9.2}   {} ms",
            sizes[0],
            sizes[sizes.len() - 1],
            times.join(" ")
        );
        Ok(())
    }

    fn shortest_ms(&self, run: &mut (dyn FnMut() + Send)) -> f64 {
        let once = |run: &mut (dyn FnMut() + Send)| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e3
        };
        (0..if self.once { 1 } else { RUNS }).map(|_| once(run)).fold(f64::INFINITY, f64::min)
    }
}

/// Returns the slope of log time over log size, by least squares.
fn slope(sizes: &[usize], times: &[f64]) -> f64 {
    let logs: Vec<(f64, f64)> = sizes.iter().zip(times).map(|(&n, ms)| ((n as f64).ln(), ms.ln())).collect();
    let count = logs.len() as f64;
    let (x, y) = logs.iter().fold((0.0, 0.0), |(x, y), (a, b)| (x + a / count, y + b / count));
    let (covariance, variance) = logs.iter().fold((0.0, 0.0), |(covariance, variance), (a, b)| {
        (covariance + (a - x) * (b - y), variance + (a - x) * (a - x))
    });
    covariance / variance
}

fn facets_of(mesh: &TileMesh, count: usize) -> Facets {
    let mut facets = Facets::sample(mesh, count, 1);
    facets.sort_for_sums();
    facets
}

fn tile(scene: &str) -> Result<TileMesh> {
    let loaded = biscale::scene::open(scene, &[])?;
    geometry::build(&loaded.scene.tile, &loaded.base_dir)
}

/// Returns a height field of waves with about this many triangles.
fn waves(triangles: usize) -> TileMesh {
    let side = ((triangles as f64 / 2.0).sqrt().round() as u32).max(2);
    heightfield::from_function(UVec2::splat(side), Vec2::ONE, |p| {
        0.05 * ((3.0 * TAU * p.x).sin() * (2.0 * TAU * p.y).cos() + (TAU * (5.0 * p.x + 4.0 * p.y)).sin())
    })
}

fn main() -> Result<()> {
    let bench = Bench { once: !std::env::args().any(|argument| argument == "--bench") };
    println!("{:<44} {:>22} {:>8} {:>9}   times", "what grows", "from, to", "exponent", "expected");
    let rods = Arc::new(tile("fig6a_velvet_spread")?);
    let rod_grid = Arc::new(PeriodicGrid::for_slices(&rods));
    let field = Arc::new(tile("fig8a_hammered")?);
    geometry_lines(&bench, &rods, &rod_grid, &field)?;
    sum_lines(&bench, &field)?;
    image_lines(&bench)?;
    if !bench.once {
        thread_lines(&bench, &rods, &rod_grid)?;
    }
    Ok(())
}

fn geometry_lines(
    bench: &Bench,
    rods: &Arc<TileMesh>,
    rod_grid: &Arc<PeriodicGrid>,
    field: &Arc<TileMesh>,
) -> Result<()> {
    let counts = [1024, 4096, 16_384];
    bench.line("facets: sampled and sorted (rods)", 1.0, &[4096, 16_384, 65_536], |n| {
        let rods = rods.clone();
        Ok(Box::new(move || drop(black_box(facets_of(&rods, n)))))
    })?;
    bench.line("facets: slices (rods)", 1.0, &counts, |n| {
        let (grid, facets) = (rod_grid.clone(), facets_of(rods, n));
        Ok(Box::new(move || drop(black_box(OcclusionIntervals::scan(&grid, &facets, 16, TRANSITION_WIDTH)))))
    })?;
    bench.line("azimuths: slices (rods)", 1.0, &[8, 32, 128], |azimuths| {
        let (grid, facets) = (rod_grid.clone(), facets_of(rods, 1024));
        Ok(Box::new(move || drop(black_box(OcclusionIntervals::scan(&grid, &facets, azimuths, TRANSITION_WIDTH)))))
    })?;
    if field.height_grid.is_some() {
        bench.line("facets: horizon maps (height field)", 1.0, &counts, |n| {
            let (field, facets) = (field.clone(), facets_of(field, n));
            Ok(Box::new(move || {
                let heights = field.height_grid.as_ref();
                black_box(heights.map(|heights| HorizonMap::march(heights, field.size, &facets, 64, TRANSITION_WIDTH)));
            }))
        })?;
    }
    let triangles = [1000, 10_000, 100_000, 1_000_000];
    bench.line("triangles: grid of cells (waves)", 1.0, &triangles, |n| {
        let mesh = waves(n);
        Ok(Box::new(move || drop(black_box(PeriodicGrid::for_slices(&mesh)))))
    })?;
    // A slice visits a line of cells with a few triangles each.
    bench.line("triangles: slices of 2048 facets (waves)", 0.5, &triangles, |n| {
        let mesh = waves(n);
        let (grid, facets) = (PeriodicGrid::for_slices(&mesh), facets_of(&mesh, 2048));
        Ok(Box::new(move || drop(black_box(OcclusionIntervals::scan(&grid, &facets, 16, TRANSITION_WIDTH)))))
    })
}

fn sum_lines(bench: &Bench, field: &Arc<TileMesh>) -> Result<()> {
    let direct = |facets: usize| {
        let facets = facets_of(field, facets);
        let horizon_map = HorizonMap::scan(&PeriodicGrid::for_slices(field), &facets, 32, TRANSITION_WIDTH);
        let material = Material {
            brdf: Brdf { terms: vec![Term::Ggx { roughness: 0.2, f0: Vec3::splat(0.8) }] },
            color: Vec3::ONE,
        };
        let sum = FacetSum::new(&facets, &vec![0; field.slots.len()], &[material]);
        let representation =
            Representation::Direct(Direct::new(Arc::new(sum), Arc::new(Visibility::HorizonMap(horizon_map))));
        EffectiveBrdf { representation, base_area: f64::from(field.base_area()) }
    };
    bench.line("facets: 64 pairs of the sum (height field)", 1.0, &[1024, 4096, 16_384, 65_536], |n| {
        let (brdf, pairs) = (direct(n), mirror_biased_pairs(64, 1));
        Ok(Box::new(move || {
            black_box(pairs.iter().map(|pair| brdf.eval(pair.i, pair.o)).sum::<Vec3>());
        }))
    })?;
    let brdf = Arc::new(direct(4096));
    bench.line("pairs: the sum over 4096 facets", 1.0, &[64, 256, 1024], |n| {
        let (brdf, pairs) = (brdf.clone(), mirror_biased_pairs(n, 1));
        Ok(Box::new(move || {
            black_box(pairs.iter().map(|pair| brdf.eval(pair.i, pair.o)).sum::<Vec3>());
        }))
    })
}

/// Renders an image of a scene with a shadow cache, as an edit of the camera does.
fn image(scene: &str, lights: usize, side: usize) -> Result<Work> {
    let overrides = [format!("light.count={lights}"), "quality.backend=cpu".to_owned()];
    let loaded = biscale::scene::open(scene, &overrides)?;
    let shading_brdf = Pipeline::new().effective(&loaded)?.shading_brdf(&biscale::base::Cancel::default())?;
    let mut render_scene = RenderScene::new(&loaded)?;
    render_scene.cache_shadows(&Pipeline::new())?;
    Ok(Box::new(move || {
        let background = ImageBackground::default();
        let rendered = render(&render_scene.input(&*shading_brdf.brdf, [side, side], 1, &background));
        black_box(rendered.is_ok());
    }))
}

fn image_lines(bench: &Bench) -> Result<()> {
    bench.line("lights: an image of 384 x 384", 1.0, &[16, 64, 256], |lights| image(SHADING, lights, 384))?;
    bench.line("pixels: an image with 32 lights", 1.0, &[128 * 128, 256 * 256, 512 * 512, 1024 * 1024], |pixels| {
        image(SHADING, 32, pixels.isqrt())
    })
}

/// Times the same work on one thread and on two.
fn thread_lines(bench: &Bench, rods: &Arc<TileMesh>, rod_grid: &Arc<PeriodicGrid>) -> Result<()> {
    println!("\n{:<44} {:>12} {:>12} {:>8}", "threads", "one", "two", "speed-up");
    let facets = facets_of(rods, 4096);
    let grid = rod_grid.clone();
    let intervals: Work =
        Box::new(move || drop(black_box(OcclusionIntervals::scan(&grid, &facets, 32, TRANSITION_WIDTH))));
    let image = image(SHADING, 32, 384)?;
    for (name, mut work) in [("slices (rods)", intervals), ("an image of 384 x 384, 32 lights", image)] {
        let times = [1, 2].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.map_or(f64::NAN, |pool| pool.install(|| bench.shortest_ms(&mut *work)))
        });
        println!("{name:<44} {:>9.1} ms {:>9.1} ms {:>8.2}", times[0], times[1], times[0] / times[1]);
    }
    Ok(())
}
