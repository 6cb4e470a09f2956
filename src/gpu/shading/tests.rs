//! Tests that GPU and CPU shade alike, for each representation of the effective BRDF and each kind of visibility.

use std::path::Path;
use std::sync::Arc;

use glam::Vec3;

use super::{GpuLight, GpuMaterial, GpuShading, ShadingParams};
use crate::base::Cancel;
use crate::brdf::{Brdf, LobeAngles, Material, Measured, MeasuredReport, Term};
use crate::effective::shading_table::columns::Weight;
use crate::effective::{
    Direct, EffectiveBrdf, FacetSum, Interpolation, Nodes, Reflectance, Representation, ShadingTable,
};
use crate::gpu::render::gbuffer::GpuPoint;
use crate::gpu::{Gpu, GpuError, GpuRenderer, render_gpu};
use crate::math::directions::{HemispherePairGrid, from_angles};
use crate::pipeline::Pipeline;
use crate::render::image::shading;
use crate::render::image::shading::ImageBackground;
use crate::render::image::shading_points::ShadingPoints;
use crate::render::lighting::lights;
use crate::render::render;
use crate::render::shadow::{LightVisibility, Occluder};
use crate::render::{CameraView, DirectionalLight, Image, ObjectMesh, RenderInput, object};
use crate::scene;
use crate::scene::LoadedScene;
use crate::visibility::Visibility;

/// Largest difference in shading of the same points, relative to the radiance of the point plus the mean. Both sides
/// use single precision, and lobes multiply the rounding of half vectors by up to 1/roughness². The tests print the
/// differences.
pub(crate) const SHADING_TOLERANCE: f32 = 5e-5;
/// Largest difference of 99 % of the pixels of an image. The normals of the G-buffers differ by up to 1e-3 in 99 % of
/// the samples (`render/tests.rs`), which lobes of width 0.2 magnify to a percent. The other pixels are at edges, where
/// the GPU may show the neighbouring triangle.
const PIXEL_TOLERANCE: f32 = 0.02;
/// Largest difference of the means of two images.
const MEAN_TOLERANCE: f32 = 2e-3;

pub(crate) fn open_gpu() -> Option<Gpu> {
    Gpu::open().map_err(|error| eprintln!("SKIPPED: {error}")).ok()
}

pub(crate) const GROOVES: &str = "{ kind = \"grooves\" }";
pub(crate) const PYRAMIDS: &str = "{ kind = \"pyramids\" }";
pub(crate) const RODS: &str = "{ kind = \"rods\" }";
pub(crate) const FLAT: &str = "{ kind = \"flat\" }";

pub(crate) fn open(geometry: &str, brdf: &str, method: &str) -> LoadedScene {
    let text = format!(
        "[tile]\ngeometry = {geometry}\n[[material]]\nname = \"default\"\nbrdf = {brdf}\ncolor = [0.9, 0.7, 0.5]\n\
         [quality]\npreset = \"draft\"\nbackend = \"cpu\"\nmethod = \"{method}\"\nfacets = 300\n[effects]\ninterreflection = \"off\"\n"
    );
    LoadedScene {
        scene: scene::parse(&text).unwrap(),
        base_dir: ".".into(),
        name: String::new(),
        painted: scene::Painted::default(),
    }
}

pub(crate) fn effective(loaded: &LoadedScene) -> EffectiveBrdf {
    Pipeline::new().effective(loaded).unwrap().brdf.as_ref().clone()
}

/// An object, its occluder and ten lights.
pub(crate) struct TestScene {
    pub(crate) mesh: ObjectMesh,
    pub(crate) occluder: Option<Occluder>,
    pub(crate) lights: Vec<DirectionalLight>,
    pub(crate) camera: scene::Camera,
}

impl TestScene {
    pub(crate) fn of(kind: &str) -> Self {
        let mesh = object::build(&scene::Object { kind: kind.to_owned(), path: None }, Path::new(".")).unwrap();
        let lights = lights::build(&scene::Light { count: 10, ..scene::Light::default() }, Path::new(".")).unwrap();
        let occluder = Occluder::if_needed(&mesh);
        Self { mesh, occluder, lights: lights.directional, camera: scene::Camera::default() }
    }

    pub(crate) fn input<'a>(
        &'a self,
        brdf: &'a EffectiveBrdf,
        side: usize,
        background: &'a ImageBackground,
    ) -> RenderInput<'a> {
        RenderInput {
            mesh: &self.mesh,
            occluder: self.occluder.as_ref(),
            shadow_cache: None,
            lights: &self.lights,
            camera: &self.camera,
            reflectance: brdf,
            size: [side; 2],
            samples_per_side: 1,
            tolerance: 0.0,
            background,
        }
    }
}

/// Asserts that GPU and CPU agree on an object: in shading of the points of one G-buffer, and in images of 64 x 64
/// pixels.
fn assert_same(what: &str, gpu: &Gpu, kind: &str, brdf: &EffectiveBrdf) {
    assert_same_shading(what, gpu, kind, brdf);
    let (test_scene, background) = (TestScene::of(kind), ImageBackground::Uniform(Vec3::ZERO));
    let input = test_scene.input(brdf, 64, &background);
    let images = [render(&input).unwrap().image, render_gpu(gpu, &input, brdf).unwrap().image];
    assert_same_image(what, &images);
}

fn assert_same_shading(what: &str, gpu: &Gpu, kind: &str, brdf: &EffectiveBrdf) {
    let TestScene { mesh, occluder, lights, camera } = TestScene::of(kind);
    let view = CameraView::new(&camera, &mesh, [64, 64]).unwrap();
    let points = ShadingPoints::new(&mesh, &view, 1);
    let visible = occluder.as_ref().map(|o| o.visible_lights(&mesh, &points, &lights, view.eye, None));
    let mut shading = GpuShading::new(gpu).unwrap();
    let material = shading.material(gpu, brdf, visible.is_some()).unwrap();
    let cpu = shading::radiance(&points, &lights, visible.as_ref(), &view, brdf, 0.0);
    let gpu_radiance = radiance(gpu, &shading, &material, &points, &lights, visible.as_ref(), view.eye);
    let (_, worst, _) = distances(&cpu, &gpu_radiance);
    eprint!("{what}: shading within {worst:.1e}; ");
    assert!(worst < SHADING_TOLERANCE, "{what}: shading of the same points differs by {worst}");
}

/// Returns the radiance that the GPU computes for points of the CPU, in slices of eight lights.
pub(crate) fn radiance(
    gpu: &Gpu,
    shading: &GpuShading,
    material: &GpuMaterial,
    points: &ShadingPoints,
    lights: &[DirectionalLight],
    visible: Option<&LightVisibility>,
    eye: Vec3,
) -> Vec<Vec3> {
    use wgpu::BufferUsages as Usage;
    let slices = lights.len().div_ceil(8);
    let params = ShadingParams {
        eye,
        point_count: points.len() as u32,
        light_count: lights.len() as u32,
        words_per_point: LightVisibility::words_of(lights.len()) as u32,
        slice: 8,
        min_area: material.min_area(),
    };
    let point = |k: usize| GpuPoint {
        position: points.positions[k],
        normal: points.normals[k],
        tangent: points.tangents[k],
        weight: 1.0,
        ..GpuPoint::default()
    };
    let point_rows: Vec<GpuPoint> = (0..points.len()).map(point).collect();
    let lights: Vec<GpuLight> = lights.iter().map(GpuLight::from).collect();
    let words = visible.map_or(Vec::new(), |visible| visible.words.clone());
    let rows = gpu.buffer("radiance", (16 * points.len() * slices) as u64, Usage::STORAGE | Usage::COPY_SRC).unwrap();
    let bound = [
        &gpu.upload("parameters", &[params], Usage::UNIFORM).unwrap(),
        &gpu.upload("points", &point_rows, Usage::STORAGE).unwrap(),
        &gpu.upload("lights", &lights, Usage::STORAGE).unwrap(),
        &gpu.upload("bits", &words, Usage::STORAGE).unwrap(),
        &rows,
        &gpu.buffer("scales", 4 * points.len() as u64, Usage::STORAGE).unwrap(),
    ];
    let group = shading.points(gpu, bound).unwrap();
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    for part in material.parts(u64::MAX) {
        material.prepare(&mut pass, part);
    }
    material.shade(&mut pass, 0..material.passes(), &group, [points.len() as u32, slices as u32]);
    drop(pass);
    gpu.queue.submit([encoder.finish()]);
    let rows: Vec<[f32; 4]> = gpu.read(&rows).unwrap();
    let sum = |k: usize| (0..slices).map(|slice| Vec3::from_slice(&rows[slice * points.len() + k])).sum();
    (0..points.len()).map(sum).collect()
}

/// Returns differences relative to a value plus the mean: the largest of 99 % of the values, the largest of all, and
/// that of the means.
pub(crate) fn distances(cpu: &[Vec3], gpu: &[Vec3]) -> (f32, f32, f32) {
    let mean = |values: &[Vec3]| values.iter().sum::<Vec3>() / values.len() as f32;
    let level = mean(cpu).max_element();
    assert!(level > 1e-4 && gpu.iter().all(|value| value.is_finite()), "{level}");
    let mut all: Vec<f32> =
        cpu.iter().zip(gpu).map(|(a, b)| (*a - *b).abs().max_element() / (level + a.max_element())).collect();
    all.sort_by(f32::total_cmp);
    (all[all.len() * 99 / 100], all[all.len() - 1], (mean(cpu) - mean(gpu)).abs().max_element() / level)
}

pub(crate) fn assert_same_image(what: &str, [cpu, gpu]: &[Image; 2]) {
    let (most, worst, means) = distances(&cpu.pixels, &gpu.pixels);
    eprintln!("{what}: 99 % of the pixels within {most:.1e}, largest {worst:.1e}, means {means:.1e}");
    assert!(most < PIXEL_TOLERANCE && means < MEAN_TOLERANCE, "{what}: 99 % within {most}, means {means}");
}

pub(crate) const LOBES: [&str; 5] = [
    "{ kind = \"lambertian\", albedo = [0.8, 0.5, 0.2] }",
    "{ kind = \"blinn_phong\", exponent = 60.0, specular = [0.5, 0.4, 0.3] }",
    "{ kind = \"cook_torrance\", roughness = 0.25, f0 = [0.9, 0.6, 0.3] }",
    "{ kind = \"ward\", roughness = 0.2, specular = [0.3, 0.4, 0.5] }",
    "{ kind = \"ggx\", roughness = 0.2, f0 = [0.04, 0.05, 0.06] }",
];

#[test]
fn a_table_with_bounced_light_gives_the_same_image() {
    let Some(gpu) = open_gpu() else { return };
    let ripples = "{ kind = \"heightfield\", path = \"asset:ripples.png\", height_scale = 0.3 }";
    let mut loaded = open(ripples, LOBES[2], "direct");
    loaded.scene.effects.interreflection = scene::Switch::On;
    loaded.scene.effects.picture_table = scene::Switch::On;
    let outcome = Pipeline::new().effective(&loaded).unwrap();
    let table = outcome.shading_brdf(&Cancel::default()).unwrap().brdf;
    assert!(matches!(table.representation, Representation::Table(_)), "one table holds all light");
    let mut bounced = [Vec3::ZERO];
    table.eval_bounced(&[Vec3::Z], Vec3::Z, &mut bounced);
    assert!(bounced[0].min_element() > 0.0);
    assert_same("bounced light", &gpu, "sphere", &table);
}

#[test]
fn bounced_light_beside_each_representation_gives_the_same_image() {
    let Some(gpu) = open_gpu() else { return };
    for (geometry, kind, lobe, method) in [
        (GROOVES, "cup", LOBES[4], "direct"),
        (PYRAMIDS, "sphere", LOBES[0], "direct"),
        (RODS, "sphere", LOBES[2], "direct"),
        (PYRAMIDS, "cup", LOBES[0], "low_rank"),
        (RODS, "sphere", LOBES[0], "table"),
    ] {
        let mut loaded = open(geometry, lobe, if method == "table" { "direct" } else { method });
        loaded.scene.effects.interreflection = scene::Switch::On;
        let mut brdf = effective(&loaded);
        if let (Representation::Direct(direct), "table") = (brdf.direct_representation(), method) {
            let nodes = Nodes::all(HemispherePairGrid { rings: 6, azimuths: 12, phi_d: 8, theta_d: 8 });
            let table = ShadingTable::build(direct, nodes, &Cancel::default()).unwrap().unwrap();
            brdf = brdf.with_direct_representation(Representation::Table(table));
        }
        let is_tested = match brdf.direct_representation() {
            Representation::Direct(_) => method == "direct",
            Representation::LowRank(_) => method == "low_rank",
            Representation::Table(_) => method == "table",
            _ => false,
        };
        assert!(is_tested && matches!(brdf.representation, Representation::Interreflecting(..)), "{geometry} {method}");
        let [i, o] = [(0.6, 1.0), (0.7, 2.8)].map(|(theta, phi)| from_angles(theta, phi));
        let mut bounced = [Vec3::ZERO];
        brdf.eval_bounced(&[i], o, &mut bounced);
        assert!(bounced[0].y > 0.01 * brdf.eval(i, o).y, "{geometry}: {} of {}", bounced[0], brdf.eval(i, o));
        assert_same(&format!("{geometry} {method}"), &gpu, kind, &brdf);
    }
}

#[test]
fn direct_sums_give_the_same_image_for_every_lobe_and_visibility() {
    let Some(gpu) = open_gpu() else { return };
    let mut tested = [false; 4];
    let [lambertian, phong, beckmann, _, ggx] = LOBES;
    for (geometry, kind, lobes) in [
        (FLAT, "sphere", vec![lambertian, beckmann]),
        (PYRAMIDS, "sphere", LOBES.to_vec()),
        (GROOVES, "cup", vec![phong, ggx]),
        (RODS, "sphere", LOBES.to_vec()),
    ] {
        for brdf in lobes {
            let effective_brdf = effective(&open(geometry, brdf, "direct"));
            let Representation::Direct(direct) = &effective_brdf.representation else {
                panic!("{geometry} {brdf}: not direct")
            };
            if let Visibility::OcclusionIntervals(slices) = direct.visibility.as_ref() {
                let maps = Visibility::Maps(slices.maps(12));
                let representation = Representation::Direct(Direct::new(direct.sum.clone(), Arc::new(maps)));
                tested[3] = true;
                assert_same(
                    &format!("{geometry} {brdf}, maps"),
                    &gpu,
                    kind,
                    &EffectiveBrdf { representation, ..effective_brdf },
                );
            }
            tested[match direct.visibility.as_ref() {
                Visibility::Unblocked { .. } => 0,
                Visibility::HorizonMap(_) => 1,
                Visibility::OcclusionIntervals(_) => 2,
                Visibility::Maps(_) => 3,
            }] = true;
            assert_same(&format!("{geometry} {brdf}"), &gpu, kind, &effective_brdf);
        }
    }
    assert_eq!(tested, [true; 4], "kinds of visibility tested");
}

#[test]
fn factors_give_the_same_image_for_tables_and_lobes() {
    let Some(gpu) = open_gpu() else { return };
    let sum = format!("[{}, {}]", LOBES[0], LOBES[4]);
    for (geometry, brdf) in [(GROOVES, LOBES[0]), (PYRAMIDS, LOBES[2]), (RODS, sum.as_str())] {
        let effective_brdf = effective(&open(geometry, brdf, "low_rank"));
        assert!(matches!(effective_brdf.representation, Representation::LowRank(_)), "{geometry} {brdf}");
        assert_same(&format!("{geometry} {brdf}"), &gpu, "cup", &effective_brdf);
    }
}

#[test]
fn facets_of_different_colours_and_an_exchanged_brdf_give_the_same_image() {
    let Some(gpu) = open_gpu() else { return };
    // Every facet has its own colour.
    let mut facets = crate::geometry::Facets::default();
    for k in 0..300 {
        let (theta, phi) = (0.9 * (k as f32 * 0.618).fract(), 2.4 * k as f32);
        facets.positions.push(Vec3::ZERO);
        facets.normals.push(crate::math::directions::from_angles(theta, phi));
        facets.areas.push(1.0 / 300.0);
        facets.colors.push(Vec3::new(0.2, 0.9, 0.5) * (0.5 + 0.5 * phi.sin()));
        facets.slots.push(0);
    }
    let material = |brdf: &str| {
        let loaded = open(FLAT, brdf, "direct");
        Pipeline::new().materials(&loaded).unwrap().materials
    };
    let form = |brdf: &str| EffectiveBrdf {
        representation: Representation::Direct(Direct::new(
            FacetSum::new(&facets, &[0], &material(brdf)).into(),
            Visibility::Unblocked { facets: 300 }.into(),
        )),
        base_area: 1.0,
    };
    let (first, second) = (form(LOBES[4]), form(&format!("[{}, {}]", LOBES[0], LOBES[2])));
    let Representation::Direct(direct) = &first.representation else { panic!("not direct") };
    assert!(direct.sum.colors_vary());
    assert_same("coloured facets, ggx", &gpu, "sphere", &first);

    let mesh = object::build(&scene::Object { kind: "sphere".to_owned(), path: None }, Path::new(".")).unwrap();
    let light = DirectionalLight { direction: Vec3::new(0.6, 0.48, 0.64), irradiance: Vec3::new(1.0, 2.0, 3.0) };
    let mut renderer = GpuRenderer::with_material(&gpu, &mesh, None, &first).unwrap();
    renderer.set_brdf(&gpu, &second).unwrap();
    let input = RenderInput {
        mesh: &mesh,
        occluder: None,
        shadow_cache: None,
        lights: &[light; 9],
        camera: &scene::Camera::default(),
        reflectance: &second,
        size: [64, 64],
        samples_per_side: 2,
        tolerance: 0.0,
        background: &ImageBackground::Wall,
    };
    let gpu_radiance = renderer.render(&gpu, &input, &Cancel::default()).unwrap().image;
    let images = [render(&input).unwrap().image, gpu_radiance];
    assert_same_image("coloured facets, lambertian and cook_torrance after ggx", &images);
    let none = RenderInput { lights: &[], ..input };
    let unlit = renderer.render(&gpu, &none, &Cancel::default()).unwrap().image;
    assert_same_image("no lights", &[render(&none).unwrap().image, unlit]);

    // Six columns are two groups of four.
    let Representation::Direct(direct) = &second.representation else { panic!("not direct") };
    let table = ShadingTable::build(direct, Nodes::all(GRID), &Cancel::default()).unwrap().unwrap();
    assert_eq!(table.vec4s_per_node(), 2);
    assert_same(
        "a table of coloured facets",
        &gpu,
        "cup",
        &EffectiveBrdf { representation: Representation::Table(table), base_area: 1.0 },
    );
}

const GRID: HemispherePairGrid = HemispherePairGrid { rings: 9, azimuths: 12, phi_d: 8, theta_d: 7 };

#[test]
fn tables_shade_the_same_points_alike_with_cubic_and_linear_interpolation() {
    let Some(gpu) = open_gpu() else { return };
    for (geometry, brdf, interpolation) in [
        (GROOVES, LOBES[4], Interpolation::Cubic),
        (PYRAMIDS, LOBES[1], Interpolation::Linear),
        (RODS, LOBES[0], Interpolation::Cubic),
    ] {
        let exact = effective(&open(geometry, brdf, "direct"));
        let Representation::Direct(direct) = &exact.representation else { panic!("{geometry} {brdf}: not direct") };
        let whole = |lights: &[Vec3], o: Vec3, out: &mut [glam::DVec3]| direct.sums(lights, o, |k, sum| out[k] = sum);
        for (what, table) in [
            ("its columns", ShadingTable::build(direct, Nodes::all(GRID), &Cancel::default()).unwrap().unwrap()),
            ("its colours", ShadingTable::resample(whole, Nodes::all(GRID), &Cancel::default()).unwrap()),
        ] {
            let representation = Representation::Table(table.read(interpolation));
            // A table this coarse is too bright at the rim, where the two G-buffers differ, so only shading is
            // compared.
            let what = format!("a table of {geometry} {brdf}, {what}");
            assert_same_shading(&what, &gpu, "sphere", &EffectiveBrdf { representation, base_area: exact.base_area });
        }
    }
}

#[test]
fn tables_of_cluster_areas_shade_like_the_cpu() {
    let Some(gpu) = open_gpu() else { return };
    let all = format!("[{}]", LOBES.join(", "));
    let cases = LOBES.map(|lobe| (PYRAMIDS, lobe)).into_iter().chain([(GROOVES, all.as_str())]);
    for (geometry, brdf) in cases {
        let exact = effective(&open(geometry, brdf, "direct"));
        let Representation::Direct(direct) = &exact.representation else { panic!("{geometry} {brdf}: not direct") };
        let table = ShadingTable::build(direct, Nodes::all(GRID), &Cancel::default()).unwrap().unwrap();
        assert!(table.weights().iter().all(Weight::is_lobe), "{geometry}");
        let table = EffectiveBrdf { representation: Representation::Table(table), base_area: exact.base_area };
        assert_same_shading(&format!("areas of {geometry} {brdf}"), &gpu, "cup", &table);
    }
}

#[derive(Debug, Default)]
pub(crate) struct White(MeasuredReport);

impl Measured for White {
    fn f_r(&self, _: &LobeAngles) -> Vec3 {
        Vec3::ONE
    }
    fn name(&self) -> &str {
        "white"
    }
    fn content(&self) -> crate::cache::Key {
        crate::cache::Key::of_numbers::<u8>(&[])
    }
    fn report(&self) -> &MeasuredReport {
        &self.0
    }
}

#[test]
fn a_measured_brdf_summed_over_facets_is_refused_with_the_reason() {
    let Some(gpu) = open_gpu() else { return };
    // Enough facets of one normal for a normal cluster.
    let facets = crate::geometry::Facets {
        positions: vec![Vec3::ZERO; 8],
        normals: vec![Vec3::Z; 8],
        areas: vec![1.0; 8],
        colors: vec![Vec3::ONE; 8],
        slots: vec![0; 8],
        ..Default::default()
    };
    let material =
        |color| Material { brdf: Brdf { terms: vec![Term::Measured(std::sync::Arc::new(White::default()))] }, color };
    let form = |color| EffectiveBrdf {
        representation: Representation::Direct(Direct::new(
            FacetSum::new(&facets, &[0], &[material(color)]).into(),
            Visibility::Unblocked { facets: 8 }.into(),
        )),
        base_area: 1.0,
    };
    let mut shading = GpuShading::new(&gpu).unwrap();
    let refused = shading.material(&gpu, &form(Vec3::ONE), false).map(drop);
    let is_refused = |refused: &_| matches!(refused, Err(GpuError::Unsupported(reason)) if reason.contains("measured"));
    assert!(is_refused(&refused), "{refused:?}");
    let Representation::Direct(direct) = form(Vec3::ONE).representation else { panic!("not direct") };
    let table = ShadingTable::build(&direct, Nodes::all(GRID), &Cancel::default()).unwrap().unwrap();
    assert!(table.weights().iter().all(Weight::is_lobe), "areas");
    let table = EffectiveBrdf { representation: Representation::Table(table), base_area: 1.0 };
    let refused = shading.material(&gpu, &table, false).map(drop);
    assert!(is_refused(&refused), "{refused:?}");
    // A black material is never evaluated.
    shading.material(&gpu, &form(Vec3::ZERO), false).map(drop).unwrap();
}
