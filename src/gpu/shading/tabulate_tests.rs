//! Tests that tables of the GPU equal those of the CPU, value by value, and shade alike.

use std::sync::Arc;

use glam::Vec3;

use crate::base::Cancel;
use crate::brdf::{Brdf, Material, Term};
use crate::effective::{Direct, EffectiveBrdf, FacetSum, Interpolation, Nodes, Representation, ShadingTable};
use crate::geometry::Facets;
use crate::gpu::shading::tests::{
    FLAT, GROOVES, LOBES, PYRAMIDS, SHADING_TOLERANCE, TestScene, distances, effective, open, open_gpu, radiance,
};
use crate::gpu::shading::visibility::GpuVisibility;
use crate::gpu::shading::{GpuMaterial, GpuShading};
use crate::gpu::{Gpu, GpuError};
use crate::math::directions::{HemispherePairGrid, from_angles};
use crate::render::CameraView;
use crate::render::image::shading_points::ShadingPoints;
use crate::visibility::Visibility;

const GRID: HemispherePairGrid = HemispherePairGrid { rings: 5, azimuths: 10, phi_d: 4, theta_d: 6 };

/// A geometry with a horizon map, and a normal for every facet.
const RIPPLES: &str = "{ kind = \"heightfield\", path = \"asset:ripples.png\", height_scale = 0.2 }";

/// A geometry with overhangs: threads over threads.
const WEAVE: &str = "{ kind = \"weave\", pattern = \"plain\" }";

/// Largest difference of values of a table, relative to the value plus the mean of its column. Both sides sum in single
/// precision and round directions to 2e-7 rad. The transition of a facet, 1/50 rad wide, turns that into 1e-5 of its
/// area, and a lobe of width α into 4e-7/α. The tests print the differences.
const TABLE_TOLERANCE: f32 = 3e-5;
/// The same for surfaces with vertical walls. Beside a wall the slope of a horizon is up to some thousand, and changes as
/// much per radian of azimuth, so that a facet of a cluster of a hundred turns the rounding of azimuths into 1e-4.
const WALL_TOLERANCE: f32 = 3e-4;

/// Returns a material that reads a table, which the GPU computes from a direct sum.
fn tabulated(
    gpu: &Gpu,
    shading: &mut GpuShading,
    brdf: &EffectiveBrdf,
    of: (HemispherePairGrid, [bool; 2], Interpolation),
    shadowed: bool,
) -> Result<GpuMaterial, GpuError> {
    let (grid, mirrors, interpolation) = of;
    tabulated_at(gpu, shading, brdf, (Nodes { mirrors, ..Nodes::all(grid) }, interpolation), shadowed)
}

fn tabulated_at(
    gpu: &Gpu,
    shading: &mut GpuShading,
    brdf: &EffectiveBrdf,
    of: (Nodes, Interpolation),
    shadowed: bool,
) -> Result<GpuMaterial, GpuError> {
    let Representation::Direct(direct) = &brdf.representation else { panic!("no sum over facets") };
    let (pass, table) =
        shading.tabulated(gpu, (&direct.sum, &GpuVisibility::Computed(&direct.visibility)), of, shadowed)?;
    Ok(GpuMaterial { preparation: Some(table), ..GpuMaterial::of(vec![pass], brdf.base_area) })
}

/// Computes and returns the table and the projected areas of a material on the GPU.
fn computed(gpu: &Gpu, material: &GpuMaterial) -> [Vec<f32>; 2] {
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    for sums in material.sums() {
        encoder.clear_buffer(sums, 0, None);
    }
    for part in material.parts(u64::MAX) {
        material.prepare(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()), part);
    }
    gpu.queue.submit([encoder.finish()]);
    let sums = &material.preparation.as_ref().unwrap().sums;
    [&sums[0], &sums[1]].map(|buffer| gpu.read(buffer).unwrap())
}

/// Returns the largest difference of values in rows of `width`, and asserts that black columns agree.
fn worst(cpu: &[f32], gpu_values: &[f32], width: usize) -> f32 {
    assert_eq!(cpu.len(), gpu_values.len());
    let column = |numbers: &[f32], c: usize| -> Vec<f32> { numbers.iter().skip(c).step_by(width).copied().collect() };
    let mut worst = 0.0_f32;
    for c in 0..width {
        let (a, b) = (column(cpu, c), column(gpu_values, c));
        let level = a.iter().map(|a| a.abs()).sum::<f32>() / a.len() as f32;
        for (a, b) in a.iter().zip(&b) {
            let distance = (a - b).abs();
            assert!(b.is_finite() && (level > 0.0 || distance == 0.0), "column {c}: {a} {b}");
            worst = worst.max(distance / (level + a.abs()).max(f32::MIN_POSITIVE));
        }
    }
    worst
}

/// Asserts that GPU and CPU compute the same table of a sum, and returns its number of columns.
fn assert_same_table(what: &str, gpu: &Gpu, brdf: &EffectiveBrdf, mirrors: [bool; 2]) -> usize {
    assert_same_table_within(TABLE_TOLERANCE, what, gpu, brdf, mirrors)
}

/// As [`assert_same_table`], with a tolerance.
fn assert_same_table_within(tolerance: f32, what: &str, gpu: &Gpu, brdf: &EffectiveBrdf, mirrors: [bool; 2]) -> usize {
    let Representation::Direct(direct) = &brdf.representation else { panic!("{what}: not direct") };
    let table =
        ShadingTable::build(direct, Nodes { mirrors, ..Nodes::all(GRID) }, &Cancel::default()).unwrap().unwrap();
    let mut shading = GpuShading::new(gpu).unwrap();
    let material = tabulated(gpu, &mut shading, brdf, (GRID, mirrors, Interpolation::Cubic), false).unwrap();
    let [values, areas] = computed(gpu, &material);
    let distances = [
        worst(bytemuck::cast_slice(table.values()), &values, 4 * table.vec4s_per_node()),
        worst(table.areas().1, &areas, 1),
    ];
    eprintln!("{what}: the table within {:.1e}, areas within {:.1e}", distances[0], distances[1]);
    assert!(distances.iter().all(|&distance| distance < tolerance), "{what}: {distances:?}");
    assert_eq!(computed(gpu, &material)[0], values, "{what}: computed twice");
    table.weights().len()
}

fn maps_of(brdf: &EffectiveBrdf) -> EffectiveBrdf {
    let Representation::Direct(direct) = &brdf.representation else { panic!("not direct") };
    let Visibility::OcclusionIntervals(slices) = direct.visibility.as_ref() else { panic!("not slices") };
    let maps = Arc::new(Visibility::Maps(slices.maps(12)));
    EffectiveBrdf {
        representation: Representation::Direct(Direct::new(direct.sum.clone(), maps)),
        base_area: brdf.base_area,
    }
}

/// Returns a sum over more facets than one dispatch takes on software Vulkan, in two groups, unblocked. Ten consecutive
/// facets have one normal.
fn scattered(brdfs: [&str; 2], colored: bool) -> EffectiveBrdf {
    scattered_with_normals(brdfs, colored, |k| k / 10)
}

/// Like [`scattered`], but the first group has two normals, one of them with more facets than one dispatch takes.
fn scattered_in_clusters(brdfs: [&str; 2], colored: bool) -> EffectiveBrdf {
    scattered_with_normals(brdfs, colored, |k| if k < 700 { k / 600 } else { k / 10 })
}

fn scattered_with_normals(brdfs: [&str; 2], colored: bool, normal_of: impl Fn(usize) -> usize) -> EffectiveBrdf {
    const FACETS: usize = 1300;
    let mut facets = Facets::default();
    for k in 0..FACETS {
        let (theta, phi) = (1.1 * (normal_of(k) as f32 * 0.618).fract(), 2.4 * normal_of(k) as f32);
        facets.positions.push(Vec3::ZERO);
        facets.normals.push(from_angles(theta, phi));
        facets.areas.push((1.0 + 0.5 * (k as f32).sin()) / FACETS as f32);
        let color = Vec3::new(0.2, 0.9, 0.5) * (0.5 + 0.5 * (k as f32).cos());
        // Facets of the first group have their own colours.
        facets.colors.push(if colored && k < 700 { color } else { Vec3::ONE });
        facets.slots.push(u8::from(k >= 700).into());
    }
    let material = |brdf| crate::pipeline::Pipeline::new().materials(&open(FLAT, brdf, "direct")).unwrap().materials;
    let materials: Vec<_> = brdfs.iter().map(|brdf| material(brdf).remove(0)).collect();
    let sum = FacetSum::new(&facets, &[0, 1], &materials);
    let representation =
        Representation::Direct(Direct::new(sum.into(), Visibility::Unblocked { facets: FACETS }.into()));
    EffectiveBrdf { representation, base_area: 1.0 }
}

#[test]
fn gpu_and_cpu_compute_the_same_table_for_every_lobe_and_visibility() {
    let Some(gpu) = open_gpu() else { return };
    for lobe in LOBES {
        let brdf = effective(&open(RIPPLES, lobe, "direct"));
        let Representation::Direct(direct) = &brdf.representation else { panic!("{lobe}: not direct") };
        assert!(matches!(*direct.visibility, Visibility::HorizonMap(_)));
        assert_eq!(assert_same_table(&format!("ripples, {lobe}"), &gpu, &brdf, [false; 2]), 1);
    }
    let two = format!("[{}, {}]", LOBES[4], LOBES[0]);
    let mut weave = open(WEAVE, &two, "direct");
    // A direction along a slice blends that slice with either neighbour, and rounding decides which one. With 29
    // slices, only the first lies along a node.
    weave.scene.quality.azimuths = Some(29);
    let slices = effective(&weave);
    assert_eq!(assert_same_table("weave, slices", &gpu, &slices, [false; 2]), 4);
    assert_eq!(assert_same_table("weave, maps", &gpu, &maps_of(&slices), [false; 2]), 4);
}

#[test]
fn groups_lobes_and_channels_have_the_same_columns_as_on_the_cpu() {
    let Some(gpu) = open_gpu() else { return };
    let three = format!("[{}, {}, {}]", LOBES[0], LOBES[2], LOBES[3]);
    for (colored, columns) in [(false, 4), (true, 10)] {
        let brdf = scattered([&three, LOBES[4]], colored);
        assert_eq!(assert_same_table(&format!("facets, coloured {colored}"), &gpu, &brdf, [false; 2]), columns);
    }
}

#[test]
fn normal_clusters_have_the_same_visible_areas_as_on_the_cpu() {
    let Some(gpu) = open_gpu() else { return };
    let two = format!("[{}, {}]", LOBES[4], LOBES[0]);
    const TURNED: &str = "{ kind = \"grooves\", count = 4, rotation_deg = 27 }";
    // A mirror plane of the tile maps one normal to another, so tables of cluster areas use no mirror planes.
    for (geometry, columns) in [(PYRAMIDS, 4), (GROOVES, 3), (TURNED, 3)] {
        let mut scene = open(geometry, &two, "direct");
        // With 29 azimuths, only the first lies along a node of the table, where all facets of a normal may meet an edge.
        scene.scene.quality.azimuths = Some(29);
        let brdf = effective(&scene);
        assert_eq!(assert_same_table(geometry, &gpu, &brdf, [true; 2]), columns);
    }
    for (scene, columns) in [("fig4b_bicolor_cup", 4), ("fig6a_velvet_spread", 3)] {
        let quality = ["quality.preset=draft", "quality.facets=600", "quality.azimuths=29"].map(str::to_owned);
        let brdf = effective(&crate::scene::open(scene, &quality).unwrap());
        assert_eq!(assert_same_table_within(WALL_TOLERANCE, scene, &gpu, &brdf, [false; 2]), columns);
    }
}

#[test]
fn cluster_areas_and_lobes_of_facets_share_a_table_with_one_channel_each_if_colours_differ() {
    let Some(gpu) = open_gpu() else { return };
    let ripples = effective(&open(RIPPLES, LOBES[0], "direct"));
    let Representation::Direct(ripples) = &ripples.representation else { panic!("not direct") };
    let Visibility::HorizonMap(horizons) = ripples.visibility.as_ref() else { panic!("no horizons") };
    let two = format!("[{}, {}]", LOBES[4], LOBES[0]);
    for (colored, columns) in [(false, 4), (true, 8)] {
        let mut brdf = scattered_in_clusters([&two, &two], colored);
        let Representation::Direct(direct) = &mut brdf.representation else { panic!("not direct") };
        // The facets take the horizons of ripples.
        let subset: Vec<usize> = (0..direct.sum.facet_count()).map(|k| k % horizons.facets()).collect();
        *direct = Direct::new(direct.sum.clone(), Visibility::HorizonMap(horizons.subset(&subset)).into());
        assert_eq!(assert_same_table(&format!("a mix, coloured {colored}"), &gpu, &brdf, [false; 2]), columns);
    }
}

#[test]
fn gpu_and_cpu_draw_the_same_subset_for_each_half_vector() {
    let Some(gpu) = open_gpu() else { return };
    let two = format!("[{}, {}]", LOBES[4], LOBES[0]);
    let three = format!("[{}, {}, {}]", LOBES[1], LOBES[2], LOBES[3]);
    let mut ripples = open(RIPPLES, &two, "direct");
    ripples.scene.quality.facets = Some(2000);
    let black = "[{ kind = \"lambertian\", albedo = 0.0 }, { kind = \"lambertian\", albedo = 0.3 }]";
    let each = |k| k;
    // For three lobes the CPU draws one subset; the GPU draws one for the first two lobes and one for the third.
    for (what, brdf, mirrors, is_same) in [
        ("ripples", effective(&ripples), [false; 2], true),
        ("mirrored ripples", effective(&ripples), [true, false], true),
        ("in colours", scattered_with_normals([&two, &two], true, each), [false; 2], true),
        ("a black lobe", scattered_with_normals([black, LOBES[4]], false, each), [false; 2], true),
        ("three lobes beside one", scattered_with_normals([&three, LOBES[4]], false, each), [false; 2], false),
    ] {
        let Representation::Direct(direct) = &brdf.representation else { panic!("{what}: not direct") };
        let table = |facets| {
            let nodes = Nodes { mirrors, facets, ..Nodes::all(GRID) };
            (nodes, ShadingTable::build(direct, nodes, &Cancel::default()).unwrap().unwrap())
        };
        let ((nodes, subset), (_, all)) = (table(Some(300)), table(None));
        let mut shading = GpuShading::new(&gpu).unwrap();
        let material = tabulated_at(&gpu, &mut shading, &brdf, (nodes, Interpolation::Cubic), false).unwrap();
        let [values, _] = computed(&gpu, &material);
        let numbers = |table: &ShadingTable| bytemuck::cast_slice::<_, f32>(table.values()).to_vec();
        let (cpu, all) = (numbers(&subset), numbers(&all));
        let relative_difference = |a: &[f32], b: &[f32]| {
            let square = |values: &mut dyn Iterator<Item = f32>| values.map(|v| f64::from(v * v)).sum::<f64>().sqrt();
            square(&mut a.iter().zip(b).map(|(a, b)| a - b)) / square(&mut b.iter().copied())
        };
        let [from_cpu, cpu_from_all, from_all] =
            [relative_difference(&values, &cpu), relative_difference(&cpu, &all), relative_difference(&values, &all)];
        eprintln!(
            "{what}: {from_cpu:.1e} from the subset of the CPU, {from_all:.3} from all facets; the CPU {cpu_from_all:.3}"
        );
        assert!(cpu_from_all > 0.01 && from_all < 1.25 * cpu_from_all, "{what}");
        // If rounding decides, a neighbour is drawn.
        assert!(!is_same || from_cpu < 0.1 * cpu_from_all, "{what}: {from_cpu}");
        assert_eq!(computed(&gpu, &material)[0], values, "{what}: computed twice");
    }
}

#[test]
fn nodes_that_are_mirror_images_are_copied_as_on_the_cpu() {
    let Some(gpu) = open_gpu() else { return };
    let brdf = effective(&open(RIPPLES, LOBES[1], "direct"));
    for mirrors in [[true, false], [false, true], [true, true]] {
        assert_same_table(&format!("ripples, mirrors {mirrors:?}"), &gpu, &brdf, mirrors);
    }
}

#[test]
fn a_table_computed_on_the_gpu_shades_like_the_same_table_uploaded() {
    let Some(gpu) = open_gpu() else { return };
    let TestScene { mesh, occluder, lights, camera } = TestScene::of("cup");
    let view = CameraView::new(&camera, &mesh, [64, 64]).unwrap();
    let points = ShadingPoints::new(&mesh, &view, 1);
    let visible = occluder.as_ref().map(|o| o.visible_lights(&mesh, &points, &lights, view.eye, None)).unwrap();
    let mut shading = GpuShading::new(&gpu).unwrap();
    let two = format!("[{}, {}]", LOBES[0], LOBES[2]);
    for (brdf, interpolation) in [
        (scattered([LOBES[4], LOBES[0]], true), Interpolation::Cubic),
        (scattered([LOBES[4], LOBES[0]], true), Interpolation::Linear),
        (scattered_in_clusters([&two, LOBES[4]], true), Interpolation::Cubic),
    ] {
        let Representation::Direct(direct) = &brdf.representation else { panic!("not direct") };
        let table = ShadingTable::build(direct, Nodes::all(GRID), &Cancel::default()).unwrap().unwrap();
        let uploaded = EffectiveBrdf { representation: Representation::Table(table.read(interpolation)), ..brdf };
        let materials = [
            shading.material(&gpu, &uploaded, true).unwrap(),
            tabulated(&gpu, &mut shading, &brdf, (GRID, [false; 2], interpolation), true).unwrap(),
        ];
        computed(&gpu, &materials[1]);
        let [a, b] = materials
            .each_ref()
            .map(|material| radiance(&gpu, &shading, material, &points, &lights, Some(&visible), view.eye));
        let (_, worst, _) = distances(&a, &b);
        eprintln!("{interpolation:?}: shading within {worst:.1e}");
        assert!(worst < SHADING_TOLERANCE, "{interpolation:?}: {worst}");
    }
}

#[test]
fn sums_that_the_gpu_cannot_tabulate_are_refused_with_the_reason() {
    let Some(gpu) = open_gpu() else { return };
    let mut shading = GpuShading::new(&gpu).unwrap();
    let mut refused = |brdf: &EffectiveBrdf| match tabulated(
        &gpu,
        &mut shading,
        brdf,
        (GRID, [false; 2], Interpolation::Cubic),
        false,
    ) {
        Err(GpuError::Unsupported(reason)) => reason,
        other => panic!("{other:?}"),
    };
    let many = format!("[{}]", [LOBES[0]; 11].join(", "));
    assert!(refused(&scattered([&many, LOBES[0]], true)).contains("too many parts"));
    let white = crate::gpu::shading::tests::White::default();
    let material = Material { brdf: Brdf { terms: vec![Term::Measured(Arc::new(white))] }, color: Vec3::ONE };
    // Nine normals are summed. One normal is a cluster area, and the query evaluates the measured BRDF.
    for tilt in [0.1, 0.0] {
        let mut facets = Facets::default();
        for k in 0..9 {
            facets.positions.push(Vec3::ZERO);
            facets.normals.push(from_angles(tilt * k as f32, 1.0));
            facets.areas.push(1.0);
            facets.colors.push(Vec3::ONE);
            facets.slots.push(0);
        }
        let sum = FacetSum::new(&facets, &[0], std::slice::from_ref(&material));
        let representation =
            Representation::Direct(Direct::new(sum.into(), Visibility::Unblocked { facets: 9 }.into()));
        assert!(refused(&EffectiveBrdf { representation, base_area: 1.0 }).contains("measured"));
    }
}

#[test]
fn a_dispatch_has_a_thread_for_each_value_or_is_refused() {
    assert!(GRID.nodes() > 16 * 64, "the table of these tests takes more than the first row of workgroups");
    for (threads, expected) in [(0, [16, 0]), (1, [16, 1]), (1024, [16, 1]), (1025, [16, 2])] {
        assert_eq!(super::workgroups(threads), Ok(expected));
    }
    assert!(matches!(super::workgroups(1 << 32), Err(GpuError::Unsupported(_))));
}

#[test]
fn a_black_tile_has_a_table_without_columns_and_shades_black() {
    let Some(gpu) = open_gpu() else { return };
    let TestScene { mesh, lights, camera, .. } = TestScene::of("sphere");
    let view = CameraView::new(&camera, &mesh, [16, 16]).unwrap();
    let points = ShadingPoints::new(&mesh, &view, 1);
    let brdf = scattered(["{ kind = \"lambertian\", albedo = 0.0 }"; 2], false);
    let mut shading = GpuShading::new(&gpu).unwrap();
    let material = tabulated(&gpu, &mut shading, &brdf, (GRID, [false; 2], Interpolation::Cubic), false).unwrap();
    computed(&gpu, &material);
    let radiance = radiance(&gpu, &shading, &material, &points, &lights, None, view.eye);
    assert!(!radiance.is_empty() && radiance.iter().all(|&radiance| radiance == Vec3::ZERO));
}

/// Prints times of tables of 18,432 nodes and of 110,592, with the facets of `draft` and `standard`.
#[test]
#[ignore = "a measurement: cargo bench --bench measure -- gpu-table"]
fn the_table_of_a_height_field_is_timed() {
    let Some(gpu) = open_gpu() else { return };
    let mut shading = GpuShading::new(&gpu).unwrap();
    for (facets, [rings, azimuths, phi_d, theta_d]) in [(2048, [16, 24, 6, 8]), (6144, [24, 48, 8, 12])] {
        let mut loaded = open(RIPPLES, LOBES[4], "direct");
        loaded.scene.quality.facets = Some(facets);
        let brdf = effective(&loaded);
        let Representation::Direct(direct) = &brdf.representation else { panic!("not direct") };
        let grid = HemispherePairGrid { rings, azimuths, phi_d, theta_d };
        // The first run compiles.
        for _ in 0..2 {
            let start = std::time::Instant::now();
            let table = ShadingTable::build(direct, Nodes::all(grid), &Cancel::default()).unwrap().unwrap();
            let on_cpu = start.elapsed();
            let start = std::time::Instant::now();
            let material =
                tabulated(&gpu, &mut shading, &brdf, (grid, [false; 2], Interpolation::Cubic), false).unwrap();
            let set_up = start.elapsed();
            let start = std::time::Instant::now();
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            for part in material.parts(u64::MAX) {
                material.prepare(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()), part);
            }
            gpu.queue.submit([encoder.finish()]);
            let submitted = start.elapsed();
            gpu.wait("computing a table").unwrap();
            let (computed, facets, nodes, bytes) =
                (start.elapsed(), direct.sum.facet_count(), grid.nodes(), table.bytes());
            println!(
                "{nodes} nodes of {facets} facets, {bytes} bytes: CPU {on_cpu:.1?}; {}: uploaded in {set_up:.1?}, \
                 submitted in {submitted:.1?}, computed in {computed:.1?}",
                gpu.description()
            );
        }
    }
}
