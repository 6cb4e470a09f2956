//! Counts of the GPU operations that an edit of the geometry takes until its image, and times of the CPU work before.

use std::time::Instant;

use glam::{Mat3, Vec3};

use super::gbuffer::GpuPoint;
use crate::effective::{GpuVisibilityInput, HeightMarchInput, Nodes, SliceInput};
use crate::geometry::Facets;
use crate::gpu::shading::tests::{TestScene, open_gpu};
use crate::gpu::visibility::{crossings, steps};
use crate::gpu::{Gpu, GpuRenderer};
use crate::math::directions::HemispherePairGrid;
use crate::pipeline::{GpuTile, Pipeline};
use crate::render::image::shading_points::ShadingPoints;
use crate::render::{CameraView, GBuffer, RenderScene};
use crate::scene;
use crate::scene::LoadedScene;
use crate::visibility::HorizonMap;

/// Operations per crossed edge of a walk over a height field. All operations are counted by hand in the shaders.
const CROSSING: f64 = 45.0;
/// Operations per step of a slice.
const STEP: f64 = 22.0;
/// Operations per triangle that a slice cuts.
const CUT: f64 = 90.0;
/// Operations per facet and pair for the lobe angles.
const LOBE_ANGLES: f64 = 22.0;
/// Operations of a GGX lobe and its weight.
const LOBE: f64 = 29.0;
/// Operations of a second lobe.
const NEXT_LOBE: f64 = 10.0;
/// Operations per facet for its visibility along two directions, with a horizon map.
const ABOVE: f64 = 18.0;
/// Operations per facet for its visibility along two directions, with occlusion intervals.
const BETWEEN: f64 = 100.0;
/// Operations per light for its direction, azimuth, weights of horizons, horizon bounds and half vector.
const DIRECTION: f64 = 103.0;
/// Bytes from caches of the two heights of an edge.
const EDGE_BYTES: f64 = 8.0;
/// Bytes from caches of the entry of a cell or triangle.
const STEP_BYTES: f64 = 48.0;
/// Bytes from caches of a sampled facet.
const SAMPLE_BYTES: f64 = 24.0;
/// Bytes from caches per facet for its visibility along two directions, with a horizon map.
const ABOVE_BYTES: f64 = 16.0;
/// Bytes from caches per facet for its visibility along two directions, with occlusion intervals.
const BETWEEN_BYTES: f64 = 40.0;
/// Bytes from caches per pair that is read from a table.
const PAIR_BYTES: f64 = 32.0 * 16.0;
/// Walks over all facets that draw the subset of a half vector.
const WALKS: f64 = 4.0;
/// Operations per facet of the prefix sum in the last of these walks.
const PREFIX_SUM: f64 = 40.0;
/// Operations per pair that is read from a table of up to four columns: coordinates 140, eight rows of four nodes 320,
/// tints 40.
const PAIR: f64 = 500.0;
/// Operations and bytes of memory per second: a half and a quarter of the specification of an H100 (67 T, 3.35 TB), and
/// a quarter of that of a small GPU (8 T, 0.4 TB).
const GPUS: [(f64, f64); 3] = [(33.5e12, 1.7e12), (17.0e12, 0.8e12), (2.0e12, 0.1e12)];
/// Pixels of an image of 1920 x 1080, with one point each.
const POINTS: f64 = 1920.0 * 1080.0;
/// Pairs of directions of an image with 32 lights that the object covers by half.
const PAIRS: f64 = 0.5 * POINTS * 32.0;

/// Scenes, and the setting of their geometry that an edit changes, with two values.
const EDITS: [(&str, &str, [&str; 2]); 5] = [
    ("table4_plate", "height_scale", ["0.04", "0.041"]),
    ("table4_teapot", "height", ["0.05", "0.051"]),
    ("table4_pillow", "radius", ["0.018", "0.0181"]),
    ("table4_cup", "depth", ["0.13", "0.131"]),
    ("table4_skirt", "warp_width", ["0.85", "0.851"]),
];

/// Returns about 1024 facets that represent all, because counting on a software adapter is slow.
fn sampled(facets: &Facets) -> Facets {
    let step = facets.len().div_ceil(1024);
    facets.subset(&(0..facets.len()).step_by(step).collect::<Vec<_>>())
}

/// Returns the operations and bytes of visibility.
fn visibility_cost(gpu: &Gpu, tile: &GpuTile) -> [f64; 2] {
    match &tile.input.visibility_input {
        GpuVisibilityInput::Heights(HeightMarchInput { samples, tile_size, facets, azimuths, .. }) => {
            let crossings_per_walk = crossings(gpu, (samples, *tile_size, &sampled(facets)), *azimuths);
            [CROSSING, EDGE_BYTES].map(|each| (facets.len() * azimuths) as f64 * crossings_per_walk * each)
        }
        GpuVisibilityInput::OcclusionIntervals(of) => {
            let SliceInput { grid, facets, azimuths, overhangs, .. } = &**of;
            let [steps, cuts] = steps(gpu, grid, &sampled(facets), *azimuths, *overhangs);
            [STEP * steps + CUT * cuts, STEP_BYTES * steps].map(|each| (facets.len() * azimuths) as f64 * each)
        }
        GpuVisibilityInput::Computed(_) | GpuVisibilityInput::Maps(_) => panic!("another algorithm"),
    }
}

/// Returns the operations and bytes of a table, and of reading it for an image. Without a table, those of a clustered
/// sum.
fn sum_cost(loaded: &LoadedScene, tile: &GpuTile) -> [[f64; 2]; 2] {
    let sum = &tile.input.sum;
    let overhangs =
        matches!(tile.input.visibility_input, GpuVisibilityInput::OcclusionIntervals(ref of) if of.overhangs);
    let (visibility_operations, bytes) = if overhangs { (BETWEEN, BETWEEN_BYTES) } else { (ABOVE, ABOVE_BYTES) };
    let Some(Nodes { grid, mirrors, facets: Some(subset_size), .. }) = tile.input.nodes else {
        return [[0.0; 2], clustered_sum_cost(loaded, tile)];
    };
    let HemispherePairGrid { phi_d, theta_d, .. } = grid;
    let nodes = grid.originals(mirrors) as f64;
    let half_vectors = nodes / (phi_d * theta_d) as f64;
    let (all, subset_size) = (sum.facet_count() as f64, subset_size as f64);
    // Each sum evaluates two lobes of a group. The groups share the sampled facets in proportion to their facets.
    let lobes = sum.groups().iter().map(|group| group.lobes.len()).max().unwrap_or(0);
    let (walks, extra) = (lobes.div_ceil(2) as f64, (lobes / 2) as f64);
    let lobe = LOBE_ANGLES + LOBE + NEXT_LOBE * extra / walks;
    let table = if all < 2.0 * subset_size {
        [
            nodes * all * (LOBE_ANGLES + LOBE + visibility_operations) * lobes as f64,
            nodes * all * (16.0 + bytes) * lobes as f64,
        ]
    } else {
        let (to_draw, to_sum) = (walks * half_vectors * all, walks * nodes * subset_size);
        [
            to_draw * (WALKS * lobe + PREFIX_SUM) + to_sum * (lobe + visibility_operations),
            to_draw * WALKS * 16.0 + to_sum * (SAMPLE_BYTES + bytes),
        ]
    };
    [table, [PAIRS * PAIR, PAIRS * PAIR_BYTES]]
}

/// Threads that execute together; a branch of one takes the time of all.
const WARP: usize = 32;

/// Computes the horizon map of a tile on the CPU.
fn horizon_map(tile: &GpuTile) -> HorizonMap {
    match &tile.input.visibility_input {
        GpuVisibilityInput::Heights(HeightMarchInput { samples, tile_size, facets, azimuths, transition_width }) => {
            HorizonMap::march(samples, *tile_size, facets, *azimuths, *transition_width)
        }
        GpuVisibilityInput::OcclusionIntervals(of) => {
            HorizonMap::scan(&of.grid, &of.facets, of.azimuths, of.transition_width)
        }
        GpuVisibilityInput::Computed(_) | GpuVisibilityInput::Maps(_) => panic!("another algorithm"),
    }
}

/// Returns the operations and bytes of a clustered sum for all pairs of an image of this scene, and of its projected
/// areas (`shade_clusters.wgsl`, `sum_cluster_areas.wgsl`).
fn clustered_sum_cost(loaded: &LoadedScene, tile: &GpuTile) -> [f64; 2] {
    let horizons = horizon_map(tile);
    let groups = tile.input.sum.groups();
    let clusters: Vec<_> =
        groups.iter().flat_map(|group| group.clusters.iter().flatten().map(move |cluster| (group, cluster))).collect();
    let ranges: Vec<_> = clusters.iter().map(|(_, cluster)| cluster.range.clone()).collect();
    let bounds = horizons.horizon_bounds(&ranges);
    let visible = |d: Vec3, cluster: usize| {
        let taps = horizons.taps(d);
        let [a, b] = taps.azimuths.map(|azimuth| bounds[azimuth * ranges.len() + cluster]);
        if taps.between(a[0], b[0]) <= 0.0 {
            VisiblePart::None
        } else if taps.between(a[1], b[1]) >= 1.0 {
            VisiblePart::All
        } else {
            VisiblePart::Some
        }
    };
    let render_scene = RenderScene::new(loaded).unwrap();
    let view = CameraView::new(&render_scene.camera, render_scene.mesh(), [960, 540]).unwrap();
    let points = ShadingPoints::new(&GBuffer::new(render_scene.mesh(), &view, 1), &view, 1);
    let [mut operations, mut bytes] = [0.0; 2];
    let mut sum = |facets: usize, sides: f64| {
        operations += facets as f64 * (0.5 * ABOVE * sides + 2.0);
        bytes += facets as f64 * (0.5 * ABOVE_BYTES * sides + 16.0);
    };
    let mut other_operations = 0.0;
    let all: Vec<usize> = (0..points.len()).collect();
    for some in all.chunks(WARP) {
        let frames: Vec<_> = some
            .iter()
            .map(|&k| {
                Mat3::from_cols(points.tangents[k], points.normals[k].cross(points.tangents[k]), points.normals[k])
                    .transpose()
            })
            .collect();
        let views: Vec<_> =
            frames.iter().zip(some).map(|(frame, &k)| *frame * (view.eye - points.positions[k]).normalize()).collect();
        for (index, (group, cluster)) in clusters.iter().enumerate() {
            let facets = cluster.range.len();
            let view_parts: Vec<_> = views
                .iter()
                .map(|&o| if cluster.normal.dot(o) > 0.0 { visible(o, index) } else { VisiblePart::None })
                .collect();
            let mut is_view_summed = view_parts.contains(&VisiblePart::Some);
            if is_view_summed {
                sum(facets, 1.0);
            }
            if group.color == Vec3::ZERO || view_parts.iter().all(|part| *part == VisiblePart::None) {
                continue;
            }
            for light in &render_scene.lights().directional {
                let light_parts = frames.iter().map(|frame| {
                    let i = *frame * light.direction;
                    if i.z > 0.0 && cluster.normal.dot(i) > 0.0 { visible(i, index) } else { VisiblePart::None }
                });
                let common_parts: Vec<_> = light_parts
                    .zip(&view_parts)
                    .filter(|(light, view)| *light != VisiblePart::None && **view != VisiblePart::None)
                    .collect();
                other_operations += DIRECTION;
                if common_parts.is_empty() {
                    continue;
                }
                other_operations += LOBE_ANGLES + LOBE + NEXT_LOBE * (group.lobes.len() - 1) as f64;
                // Diverging branches execute one after the other.
                if is_view_summed && common_parts.contains(&(VisiblePart::All, &VisiblePart::Some)) {
                    sum(facets, 1.0);
                    is_view_summed = false;
                }
                if common_parts.contains(&(VisiblePart::Some, &VisiblePart::All)) {
                    sum(facets, 1.0);
                }
                if common_parts.contains(&(VisiblePart::Some, &VisiblePart::Some)) {
                    sum(facets, 2.0);
                }
            }
        }
    }
    let pairs = (all.len() * render_scene.lights().directional.len()) as f64 / WARP as f64;
    [operations + other_operations, bytes].map(|count| count * PAIRS / pairs)
}

/// The facets of a cluster that are visible along a direction.
#[derive(Debug, Clone, Copy, PartialEq)]
enum VisiblePart {
    None,
    Some,
    All,
}

/// Prints the counts of operations, and the times on the CPU.
#[test]
#[ignore = "a measurement: cargo bench --bench measure -- gpu-counts"]
fn counts_of_an_edit() {
    let Some(gpu) = open_gpu() else { return };
    let TestScene { mesh, occluder, .. } = TestScene::of("cup");
    // Bytes that are written and read: samples, points, origins, bits and radiance; then the image.
    let traffic = POINTS * (2.0 * (4.0 + 4.0 + size_of::<GpuPoint>() as f64 + 16.0 + 4.0 + 16.0) + 4.0);
    println!(
        "1920 x 1080, 32 lights; CPU and upload in ms on this machine; 10⁹ operations and, from caches, 10⁹ bytes;"
    );
    println!(
        "then GPU ms at half and a quarter of an H100 and a quarter of a small GPU, and the whole edit at the first two"
    );
    println!(
        "{:<14} {:<9} {:>5} {:>6} {:>7} {:>7} {:>7} {:>6}   {:>6} {:>6} {:>6}   {:>6} {:>6}",
        "scene",
        "quality",
        "CPU",
        "upload",
        "visib.",
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
            // The GPU computes what one facet reflects.
            let scenes = values.map(|value| scene::open(name, &set(value)).unwrap().without_interreflection());
            let (pipeline, mut cpu, mut upload) = (Pipeline::new(), Vec::new(), Vec::new());
            let mut renderer = GpuRenderer::new(&gpu, &mesh, occluder.as_ref()).unwrap();
            let mut last = None;
            for k in 0..11 {
                let start = Instant::now();
                let tile = pipeline.gpu_tile(&scenes[k % 2]).unwrap().unwrap();
                cpu.push(start.elapsed().as_secs_f64() * 1e3);
                let start = Instant::now();
                renderer.set_tile(&gpu, &tile.input).unwrap();
                upload.push(start.elapsed().as_secs_f64() * 1e3);
                last = Some(tile);
            }
            let tile = last.unwrap();
            let median = |mut times: Vec<f64>| {
                times.sort_by(f64::total_cmp);
                times[times.len() / 2]
            };
            let (cpu, upload) = (median(cpu), median(upload));
            let (visibility, [table, shading]) = (visibility_cost(&gpu, &tile), sum_cost(&scenes[0], &tile));
            let [operations, bytes] = [0, 1].map(|k| visibility[k] + table[k] + shading[k]);
            let [half, quarter, small] = GPUS.map(|(pace, memory)| (operations / pace + traffic / memory) * 1e3);
            let [visibility, table, shading, bytes] =
                [visibility[0], table[0], shading[0], bytes].map(|count| count * 1e-9);
            let with_cpu = [half, quarter].map(|ms| ms + cpu + upload);
            println!(
                "{name:<14} {preset:<9} {cpu:>5.1} {upload:>6.1} {visibility:>7.1} {table:>7.1} {shading:>7.1} {bytes:>6.1}   \
                 {half:>6.1} {quarter:>6.1} {small:>6.1}   {:>6.1} {:>6.1}",
                with_cpu[0], with_cpu[1]
            );
        }
    }
}
