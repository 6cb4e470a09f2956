//! Tests of GPU images: in bands, cancelled, and of tiles whose visibility and facet sum the GPU computes.

use glam::Vec3;

use crate::base::Cancel;
use crate::effective::{Black, EffectiveBrdf, GpuVisibilityInput, Representation, ShadingTable};
use crate::gpu::shading::tests::{
    FLAT, LOBES, PYRAMIDS, RODS, TestScene, assert_same_image, effective, open, open_gpu,
};
use crate::gpu::{GpuRenderer, render_gpu};
use crate::pipeline::Pipeline;
use crate::render::image::shading::ImageBackground;
use crate::render::image::tone_map::ToneMap;
use crate::render::render;
use crate::render::{Image, RenderInput, RenderScene};
use crate::scene;

#[test]
fn a_tile_that_the_gpu_computes_from_its_facets_has_the_same_image_as_on_the_cpu() {
    let Some(gpu) = open_gpu() else { return };
    for (geometry, brdf, kind, expected, tabulated) in [
        (
            "{ kind = \"heightfield\", path = \"asset:ripples.png\", height_scale = 0.2 }",
            LOBES[4],
            "cup",
            "heights",
            true,
        ),
        ("{ kind = \"weave\", pattern = \"plain\" }", LOBES[0], "sphere", "intervals", true),
        ("{ kind = \"weave\", pattern = \"plain\" }", LOBES[4], "sphere", "maps", true),
        (RODS, LOBES[4], "sphere", "intervals", true),
        (PYRAMIDS, LOBES[4], "cup", "intervals", false),
        (FLAT, LOBES[2], "sphere", "computed", false),
    ] {
        let mut loaded = open(geometry, brdf, "direct");
        if geometry == PYRAMIDS {
            loaded.scene.quality.facets = Some(700);
        }
        loaded.scene.effects.picture_table = if tabulated { scene::Switch::On } else { scene::Switch::Off };
        if expected == "maps" {
            // Software Vulkan draws maps only if a GPU is asked for.
            let quality = &mut loaded.scene.quality;
            (quality.visibility, quality.backend) = (Some("maps".to_owned()), "gpu".to_owned());
            (quality.azimuths, quality.rings) = (Some(10), Some(5));
        }
        let outcome = Pipeline::new().effective(&loaded).unwrap();
        if geometry == PYRAMIDS {
            // A tile with few distinct normals takes as many facets as it needs, not all requested ones.
            loaded.scene.quality.facets = Some(5000);
        }
        let tile = Pipeline::new().gpu_tile(&loaded).unwrap().unwrap();
        let found = match &tile.input.visibility_input {
            GpuVisibilityInput::Computed(_) => "computed",
            GpuVisibilityInput::Heights(_) => "heights",
            GpuVisibilityInput::OcclusionIntervals(_) => "intervals",
            GpuVisibilityInput::Maps(_) => "maps",
        };
        assert_eq!(found, expected, "{geometry}");
        let (test_scene, background) = (TestScene::of(kind), ImageBackground::Uniform(Vec3::ZERO));
        let shading_brdf = match tabulated {
            true => {
                let Representation::Direct(direct) = &outcome.brdf.representation else {
                    panic!("{geometry}: not direct")
                };
                let table =
                    ShadingTable::build(direct, tile.input.nodes.unwrap(), &Cancel::default()).unwrap().unwrap();
                outcome.brdf.with_direct_representation(Representation::Table(table.read(tile.input.interpolation)))
            }
            false => outcome.brdf.as_ref().clone(),
        };
        let input = test_scene.input(&shading_brdf, 64, &background);
        let mut renderer = GpuRenderer::new(&gpu, input.mesh, input.occluder).unwrap();
        renderer.set_tile(&gpu, &tile.input).unwrap();
        // One submission, as on a real GPU. The first image computes the inputs that the second only reads.
        renderer.by_stage = false;
        let first = renderer.render(&gpu, &input, &Cancel::default()).unwrap().image;
        let again = renderer.render(&gpu, &input, &Cancel::default()).unwrap().image;
        assert_eq!(first, again, "{geometry}");
        // Many submissions give the same bits.
        renderer.max_work = 1 << 20;
        renderer.set_tile(&gpu, &tile.input).unwrap();
        let in_parts = renderer.render(&gpu, &input, &Cancel::default()).unwrap().image;
        assert_eq!(first, in_parts, "{geometry}");
        assert_same_image(geometry, &[render(&input).unwrap().image, first]);
    }
    // A bottom so narrow that 700 facets leave it too few of its own, so that more facets are used.
    let narrow = "{ kind = \"grooves\", profile = \"rectangular\", bottom_width = 0.01 }";
    let mut narrow = open(narrow, LOBES[0], "direct");
    narrow.scene.quality.facets = Some(6144);
    let narrow = Pipeline::new().gpu_tile(&narrow).unwrap().expect("a tile for the GPU");
    assert!(narrow.input.sum.facet_count() <= 2800, "{}", narrow.input.sum.facet_count());
    let mut interreflecting = open(RODS, LOBES[0], "direct");
    interreflecting.scene.effects.interreflection = scene::Switch::On;
    assert!(Pipeline::new().gpu_tile(&interreflecting).unwrap().is_none(), "the CPU computes interreflection");
    let mut binned =
        open("{ kind = \"heightfield\", path = \"asset:ripples.png\", height_scale = 0.2 }", LOBES[0], "direct");
    (binned.scene.quality.facets, binned.scene.quality.normal_bins) = (Some(2000), Some(64));
    assert!(Pipeline::new().gpu_tile(&binned).unwrap().is_none(), "the CPU samples facets of normal bins");
}

#[test]
fn an_image_in_many_bands_and_submissions_has_the_same_bits() {
    let Some(gpu) = open_gpu() else { return };
    let brdf = effective(&open(PYRAMIDS, LOBES[4], "direct"));
    let test_scene = TestScene::of("cup");
    let input = RenderInput { samples_per_side: 2, ..test_scene.input(&brdf, 50, &ImageBackground::Wall) };
    let mut renderer = GpuRenderer::with_material(&gpu, input.mesh, input.occluder, &brdf).unwrap();
    let bands = |renderer: &GpuRenderer| renderer.buffers.as_ref().unwrap().bands.len();
    let whole = renderer.render(&gpu, &input, &Cancel::default()).unwrap();
    assert_eq!(bands(&renderer), 1);
    // Three rows at a time, the last two by themselves.
    renderer.max_work = 1 << 19;
    let cut = renderer.render(&gpu, &input, &Cancel::default()).unwrap();
    assert!(bands(&renderer) > 10, "{}", bands(&renderer));
    assert_eq!((&cut.image, cut.points), (&whole.image, whole.points));
    // As on a real GPU: all stages of some bands in one submission.
    renderer.by_stage = !renderer.by_stage;
    let together = renderer.render(&gpu, &input, &Cancel::default()).unwrap();
    assert_eq!((&together.image, together.points), (&whole.image, whole.points));
    // A silhouette may lie on the other side of a sample.
    let points = render(&input).unwrap().points;
    assert!(cut.points.abs_diff(points) * 100 < points, "{} and the CPU's {points}", cut.points);
}

#[test]
fn points_and_shadows_are_computed_again_only_if_the_view_or_the_lights_change() {
    let Some(gpu) = open_gpu() else { return };
    let [first, second] = [LOBES[4], LOBES[0]].map(|lobe| effective(&open(PYRAMIDS, lobe, "direct")));
    let mut test_scene = TestScene::of("cup");
    let mut renderer =
        GpuRenderer::with_material(&gpu, &test_scene.mesh, test_scene.occluder.as_ref(), &first).unwrap();
    // Several bands, each with its own points.
    renderer.max_work = 1 << 20;
    let mut rendered = |test_scene: &TestScene, brdf: &EffectiveBrdf| {
        let input = test_scene.input(brdf, 50, &ImageBackground::Wall);
        renderer.set_brdf(&gpu, brdf).unwrap();
        let rendered = renderer.render(&gpu, &input, &Cancel::default()).unwrap();
        assert_eq!(rendered.image, render_gpu(&gpu, &input, brdf).unwrap().image);
        assert!(renderer.buffers.as_ref().unwrap().bands.len() > 2);
        rendered.times.gbuffer_ms + rendered.times.shadows_ms > 0.0
    };
    assert!(rendered(&test_scene, &first));
    assert!(!rendered(&test_scene, &second), "another material");
    test_scene.lights.iter_mut().for_each(|light| light.irradiance *= 2.0);
    assert!(!rendered(&test_scene, &second), "brighter lights");
    test_scene.camera.azimuth_deg += 40.0;
    assert!(rendered(&test_scene, &second), "another view");
    test_scene.lights[3].direction = Vec3::X;
    assert!(rendered(&test_scene, &first), "another light");
}

#[test]
fn a_cancelled_image_is_an_error_and_the_next_image_is_complete() {
    let Some(gpu) = open_gpu() else { return };
    let brdf = effective(&open(RODS, LOBES[4], "direct"));
    let test_scene = TestScene::of("cup");
    let input = test_scene.input(&brdf, 96, &ImageBackground::Wall);
    let mut renderer = GpuRenderer::with_material(&gpu, input.mesh, input.occluder, &brdf).unwrap();
    let before = renderer.render(&gpu, &input, &Cancel::default()).unwrap().image;
    let cancel = Cancel::default();
    cancel.set();
    assert!(matches!(renderer.render(&gpu, &input, &cancel), Err(crate::base::Error::Cancelled)));
    // Cancelled while the GPU works: an error, or an image if the GPU was faster.
    let cancel = Cancel::default();
    let later = cancel.clone();
    let setter = std::thread::spawn(move || {
        std::thread::sleep(std::time::Duration::from_millis(20));
        later.set();
    });
    let cancelled = renderer.render(&gpu, &input, &cancel);
    setter.join().unwrap();
    assert!(matches!(&cancelled, Err(crate::base::Error::Cancelled) | Ok(_)), "{cancelled:?}");
    assert_eq!(renderer.render(&gpu, &input, &Cancel::default()).unwrap().image.pixels, before.pixels);
}

/// Compares the first image of the editor on a real GPU with the refined image of the CPU.
#[test]
#[ignore = "takes a minute on software Vulkan"]
fn images_of_the_papers_five_scenes_that_the_gpu_computes_from_the_tile_match_the_cpu() {
    let Some(gpu) = open_gpu() else { return };
    let background = ImageBackground::Uniform(Vec3::ZERO);
    for name in ["table4_plate", "table4_teapot", "table4_pillow", "table4_cup", "table4_skirt"] {
        let loaded = scene::open(name, &[]).unwrap().without_interreflection();
        let outcome = Pipeline::new().effective(&loaded).unwrap();
        let reads = outcome.shading_brdf(&Cancel::default()).unwrap().brdf;
        let tile = Pipeline::new().gpu_tile(&loaded).unwrap().unwrap();
        let render_scene = RenderScene::new(&loaded).unwrap();
        let cpu = render(&render_scene.input(&*reads, [160, 160], 1, &background)).unwrap().image;
        let mut renderer = GpuRenderer::new(&gpu, render_scene.mesh(), render_scene.occluder()).unwrap();
        renderer.set_tile(&gpu, &tile.input).unwrap();
        let input = render_scene.input(&Black, [160, 160], 1, &background);
        let gpu_image = renderer.render(&gpu, &input, &Cancel::default()).unwrap().image;
        let tones = ToneMap::new(&render_scene.camera).unwrap();
        let shown = |image: &Image| -> Vec<u8> { image.to_srgb(&tones) };
        let (a, b) = (shown(&cpu), shown(&gpu_image));
        let squares = a.iter().zip(&b).map(|(a, b)| (f64::from(a.abs_diff(*b)) / 255.0).powi(2)).sum::<f64>();
        let db = -10.0 * (squares / a.len() as f64).log10();
        eprintln!("{name}: {db:.1} dB PSNR against the CPU");
        assert!(db > 44.0, "{name}: {db:.1} dB");
    }
}
