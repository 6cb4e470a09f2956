//! What an edit of the geometry asks of a graphics processor before its picture, counted; and what the processor does before.

use std::time::Instant;

use glam::{Mat3, Vec3};

use super::gbuffer::Point;
use crate::effective::{GpuVisibilityInput, Heights, Nodes, Sliced};
use crate::geometry::Facets;
use crate::gpu::shading::tests::{TestScene, open_gpu};
use crate::gpu::visibility::{crossings, looks};
use crate::gpu::{Gpu, GpuRenderer};
use crate::math::directions::HemispherePairGrid;
use crate::math::simd::azimuth_and_elevation;
use crate::pipeline::{GpuTile, Pipeline};
use crate::render::image::shading_points::ShadingPoints;
use crate::render::{CameraView, GBuffer, RenderScene};
use crate::scene;
use crate::scene::LoadedScene;
use crate::visibility::HorizonMap;

/// Operations, counted by hand in the shaders: of a walk over a height-field at each edge; of a slice at each cell or triangle,
/// and at each that it cuts.
const CROSSING: f64 = 45.0;
const LOOK: f64 = 22.0;
const CUT: f64 = 90.0;
/// Of a lobe of a facet at a pair of directions: what both make with its normal 22, GGX and its weight 29; the next lobe 10.
const SEE: f64 = 22.0;
const LOBE: f64 = 29.0;
const NEXT_LOBE: f64 = 10.0;
/// Of two directions that one facet sees, above horizons and between slices.
const ABOVE: f64 = 22.0;
const BETWEEN: f64 = 100.0;
/// A direction to a light, its azimuth and elevation, how far that reaches, and its half vector.
const DIRECTION: f64 = 85.0;
/// Bytes from caches: an edge's two heights; a cell's or triangle's entry; a pick and its facet, and what two directions ask
/// of it above horizons and between slices; rows of a table.
const EDGE_BYTES: f64 = 8.0;
const LOOK_BYTES: f64 = 48.0;
const PICK_BYTES: f64 = 24.0;
const ABOVE_BYTES: f64 = 16.0;
const BETWEEN_BYTES: f64 = 40.0;
const PAIR_BYTES: f64 = 32.0 * 16.0;
/// Walks over all facets to pick some about each half vector, and what the last of them adds up.
const WALKS: f64 = 4.0;
const UP_TO: f64 = 40.0;
/// Of a pair read from a table of up to four columns: its place 140, eight rows of four nodes 320, tints 40.
const PAIR: f64 = 500.0;
/// Operations and bytes of memory a second: a half and a quarter of what an H100 is sold for (67 T, 3.35 TB), and a quarter of
/// a small card (8 T, 0.4 TB).
const CARDS: [(f64, f64); 3] = [(33.5e12, 1.7e12), (17.0e12, 0.8e12), (2.0e12, 0.1e12)];
/// Pictures of 1920 x 1080 with 32 lights, half covered.
const POINTS: f64 = 1920.0 * 1080.0;
const PAIRS: f64 = 0.5 * POINTS * 32.0;

/// The same tile twice, a little edited: of each scene what an edit of its geometry changes.
const EDITS: [(&str, &str, [&str; 2]); 5] = [
    ("table4_plate", "height_scale", ["0.04", "0.041"]),
    ("table4_teapot", "height", ["0.05", "0.051"]),
    ("table4_pillow", "radius", ["0.018", "0.0181"]),
    ("table4_cup", "depth", ["0.13", "0.131"]),
    ("table4_skirt", "warp_width", ["0.85", "0.851"]),
];

/// Some of the facets, which stand for all where software counts.
fn some(facets: &Facets) -> Facets {
    let step = facets.len().div_ceil(1024);
    facets.picked(&(0..facets.len()).step_by(step).collect::<Vec<_>>())
}

/// Operations of visibility, and bytes.
fn sight(gpu: &Gpu, unseen: &GpuTile) -> [f64; 2] {
    match &unseen.sum.sight {
        GpuVisibilityInput::Heights(Heights { samples, tile_size, facets, azimuths, .. }) => {
            let crossed = crossings(gpu, (samples, *tile_size, &some(facets)), *azimuths);
            [CROSSING, EDGE_BYTES].map(|each| (facets.len() * azimuths) as f64 * crossed * each)
        }
        GpuVisibilityInput::OcclusionIntervals(of) => {
            let Sliced { grid, facets, azimuths, overhangs, .. } = &**of;
            let [looks, cuts] = looks(gpu, grid, &some(facets), *azimuths, *overhangs);
            [LOOK * looks + CUT * cuts, LOOK_BYTES * looks].map(|each| (facets.len() * azimuths) as f64 * each)
        }
        GpuVisibilityInput::Seen(_) | GpuVisibilityInput::Maps(_) => panic!("another route"),
    }
}

/// Operations and bytes of a table, and of reading it for a image; or of summing over facets for each pair.
fn product(loaded: &LoadedScene, unseen: &GpuTile) -> [[f64; 2]; 2] {
    let sum = &unseen.sum.sum;
    let overhangs = matches!(unseen.sum.sight, GpuVisibilityInput::OcclusionIntervals(ref of) if of.overhangs);
    let (two, bytes) = if overhangs { (BETWEEN, BETWEEN_BYTES) } else { (ABOVE, ABOVE_BYTES) };
    let Some(Nodes { grid, mirrors, facets: Some(picked), .. }) = unseen.sum.nodes else {
        return [[0.0; 2], clustered_sum(loaded, unseen)];
    };
    let HemispherePairGrid { turn, difference, .. } = grid;
    let nodes = grid.originals(mirrors) as f64;
    let half_vectors = nodes / (turn * difference) as f64;
    let (all, picked) = (sum.facet_count() as f64, picked as f64);
    // Of each group's lobes two at a time; the groups share the picks as they share the facets.
    let lobes = sum.groups().iter().map(|group| group.lobes.len()).max().unwrap_or(0);
    let (walks, extra) = (lobes.div_ceil(2) as f64, (lobes / 2) as f64);
    let lobe = SEE + LOBE + NEXT_LOBE * extra / walks;
    let table = if all < 2.0 * picked {
        [nodes * all * (SEE + LOBE + two) * lobes as f64, nodes * all * (16.0 + bytes) * lobes as f64]
    } else {
        let (to_pick, to_sum) = (walks * half_vectors * all, walks * nodes * picked);
        [
            to_pick * (WALKS * lobe + UP_TO) + to_sum * (lobe + two),
            to_pick * WALKS * 16.0 + to_sum * (PICK_BYTES + bytes),
        ]
    };
    [table, [PAIRS * PAIR, PAIRS * PAIR_BYTES]]
}

/// Threads that go together: what one of them needs, all wait for.
const TOGETHER: usize = 32;

/// Operations and bytes of a sum over facets of few normals for each pair of a picture of this scene, and of its projected areas
/// (`shade_patches.wgsl`, `sum_patch_areas.wgsl`).
fn clustered_sum(loaded: &LoadedScene, unseen: &GpuTile) -> [f64; 2] {
    let horizons = match &unseen.sum.sight {
        GpuVisibilityInput::Heights(Heights { samples, tile_size, facets, azimuths, ramp }) => {
            HorizonMap::march(samples, *tile_size, facets, *azimuths, *ramp)
        }
        GpuVisibilityInput::OcclusionIntervals(of) => HorizonMap::scan(&of.grid, &of.facets, of.azimuths, of.ramp),
        GpuVisibilityInput::Seen(_) | GpuVisibilityInput::Maps(_) => panic!("another route"),
    };
    let groups = unseen.sum.sum.groups();
    let patches: Vec<_> =
        groups.iter().flat_map(|group| group.patches.iter().flatten().map(move |patch| (group, patch))).collect();
    let ranges: Vec<_> = patches.iter().map(|(_, patch)| patch.range.clone()).collect();
    let reach = horizons.reach(&ranges);
    let seen = |d: Vec3, patch: usize| {
        let (azimuth, elevation) = azimuth_and_elevation(d);
        let [a, b] = horizons.taps(azimuth).map(|(azimuth, _)| reach[azimuth * ranges.len() + patch]);
        if elevation <= a[0].min(b[0]) {
            Part::Nothing
        } else if elevation >= a[1].max(b[1]) {
            Part::Everything
        } else {
            Part::Some
        }
    };
    let stage = RenderScene::new(loaded).unwrap();
    let view = CameraView::new(&stage.camera, &stage.mesh, [960, 540]).unwrap();
    let points = ShadingPoints::new(&GBuffer::new(&stage.mesh, &view, 1), &view, 1);
    let [mut operations, mut bytes] = [0.0; 2];
    let mut sum = |facets: usize, sides: f64| {
        operations += facets as f64 * (0.5 * ABOVE * sides + 2.0);
        bytes += facets as f64 * (0.5 * ABOVE_BYTES * sides + 16.0);
    };
    let mut others = 0.0;
    let all: Vec<usize> = (0..points.len()).collect();
    for some in all.chunks(TOGETHER) {
        let frames: Vec<_> = some
            .iter()
            .map(|&k| {
                Mat3::from_cols(points.tangents[k], points.normals[k].cross(points.tangents[k]), points.normals[k])
                    .transpose()
            })
            .collect();
        let views: Vec<_> =
            frames.iter().zip(some).map(|(frame, &k)| *frame * (view.eye - points.positions[k]).normalize()).collect();
        for (place, (group, patch)) in patches.iter().enumerate() {
            let facets = patch.range.len();
            let of_view: Vec<_> =
                views.iter().map(|&o| if patch.normal.dot(o) > 0.0 { seen(o, place) } else { Part::Nothing }).collect();
            let mut asked = of_view.contains(&Part::Some);
            if asked {
                sum(facets, 1.0);
            }
            if group.color == Vec3::ZERO || of_view.iter().all(|part| *part == Part::Nothing) {
                continue;
            }
            for light in &stage.lights.directional {
                let of_light = frames.iter().map(|frame| {
                    let i = *frame * light.direction;
                    if i.z > 0.0 && patch.normal.dot(i) > 0.0 { seen(i, place) } else { Part::Nothing }
                });
                let of_both: Vec<_> = of_light
                    .zip(&of_view)
                    .filter(|(light, view)| *light != Part::Nothing && **view != Part::Nothing)
                    .collect();
                others += DIRECTION;
                if of_both.is_empty() {
                    continue;
                }
                others += SEE + LOBE + NEXT_LOBE * (group.lobes.len() - 1) as f64;
                // Ways that part wait for one another.
                if asked && of_both.contains(&(Part::Everything, &Part::Some)) {
                    sum(facets, 1.0);
                    asked = false;
                }
                if of_both.contains(&(Part::Some, &Part::Everything)) {
                    sum(facets, 1.0);
                }
                if of_both.contains(&(Part::Some, &Part::Some)) {
                    sum(facets, 2.0);
                }
            }
        }
    }
    let pairs = (all.len() * stage.lights.directional.len()) as f64 / TOGETHER as f64;
    [operations + others, bytes].map(|count| count * PAIRS / pairs)
}

/// How much of the facets of one normal a direction sees.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Part {
    Nothing,
    Some,
    Everything,
}

/// Figures of docs/speed.md.
#[test]
#[ignore = "a table to be printed: cargo test --release --lib counts_of_an_edit -- --ignored --nocapture"]
fn counts_of_an_edit() {
    let Some(gpu) = open_gpu() else { return };
    let TestScene { mesh, occluder, .. } = TestScene::of("cup");
    // Written and read again: samples, points, origins, bits, radiance; then the image.
    let traffic = POINTS * (2.0 * (4.0 + 4.0 + size_of::<Point>() as f64 + 16.0 + 4.0 + 16.0) + 4.0);
    println!(
        "1920 x 1080, 32 lights; CPU and upload in ms here; 10⁹ operations and, from caches, 10⁹ bytes; then ms of"
    );
    println!(
        "the device at half and a quarter of an H100's pace and of a small card's, and of the edit with the first two"
    );
    println!(
        "{:<14} {:<9} {:>5} {:>6} {:>7} {:>7} {:>7} {:>6}   {:>6} {:>6} {:>6}   {:>6} {:>6}",
        "scene",
        "quality",
        "CPU",
        "upload",
        "sight",
        "table",
        "shading",
        "bytes",
        "half",
        "quart.",
        "small",
        "half",
        "quart."
    );
    for (name, key, values) in EDITS {
        for preset in ["draft", "standard", "fine"] {
            let set = |value| [format!("quality.preset={preset}"), format!("tile.geometry.{key}={value}")];
            let scenes = values.map(|value| scene::open(name, &set(value)).unwrap());
            let (mut pipeline, mut cpu, mut upload) = (Pipeline::new(), Vec::new(), Vec::new());
            let mut renderer = GpuRenderer::new(&gpu, &mesh, occluder.as_ref()).unwrap();
            let mut last = None;
            for k in 0..11 {
                let start = Instant::now();
                let unseen = pipeline.unseen(&scenes[k % 2]).unwrap().unwrap();
                cpu.push(start.elapsed().as_secs_f64() * 1e3);
                let start = Instant::now();
                renderer.set_tile(&gpu, &unseen.sum).unwrap();
                upload.push(start.elapsed().as_secs_f64() * 1e3);
                last = Some(unseen);
            }
            let unseen = last.unwrap();
            let median = |mut times: Vec<f64>| {
                times.sort_by(f64::total_cmp);
                times[times.len() / 2]
            };
            let (cpu, upload) = (median(cpu), median(upload));
            let (seen, [table, shading]) = (sight(&gpu, &unseen), product(&scenes[0], &unseen));
            let [operations, bytes] = [0, 1].map(|k| seen[k] + table[k] + shading[k]);
            let [half, quarter, small] = CARDS.map(|(pace, memory)| (operations / pace + traffic / memory) * 1e3);
            let [seen, table, shading, bytes] = [seen[0], table[0], shading[0], bytes].map(|count| count * 1e-9);
            let with_cpu = [half, quarter].map(|ms| ms + cpu + upload);
            println!(
                "{name:<14} {preset:<9} {cpu:>5.1} {upload:>6.1} {seen:>7.1} {table:>7.1} {shading:>7.1} {bytes:>6.1}   \
                 {half:>6.1} {quarter:>6.1} {small:>6.1}   {:>6.1} {:>6.1}",
                with_cpu[0], with_cpu[1]
            );
        }
    }
}
