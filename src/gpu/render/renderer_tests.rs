//! Whole pictures on the device: in bands, given up, and of tiles whose visibility and product it makes.

use glam::Vec3;

use crate::base::Cancel;
use crate::effective::{Black, GpuVisibilityInput, Representation, ShadingTable};
use crate::gpu::GpuRenderer;
use crate::gpu::shading::tests::{
    FLAT, LOBES, PYRAMIDS, RODS, TestScene, assert_same_image, effective, open, open_gpu,
};
use crate::pipeline::Pipeline;
use crate::render::image::shading::Background;
use crate::render::image::tone_map::ToneMap;
use crate::render::render;
use crate::render::{Image, RenderInput, RenderScene};
use crate::scene;

#[test]
fn a_tile_whose_visibility_and_product_the_device_makes_gives_the_cpu_s_image() {
    let Some(gpu) = open_gpu() else { return };
    for (geometry, brdf, kind, sight, tabulated) in [
        (
            "{ kind = \"heightfield\", path = \"asset:ripples.png\", height_scale = 0.2 }",
            LOBES[4],
            "cup",
            "marched",
            true,
        ),
        ("{ kind = \"weave\", pattern = \"plain\" }", LOBES[0], "sphere", "sliced", true),
        ("{ kind = \"weave\", pattern = \"plain\" }", LOBES[4], "sphere", "drawn", true),
        (RODS, LOBES[4], "sphere", "sliced", true),
        (PYRAMIDS, LOBES[4], "cup", "sliced", false),
        (FLAT, LOBES[2], "sphere", "held", false),
    ] {
        let mut loaded = open(geometry, brdf, "direct");
        if geometry == PYRAMIDS {
            loaded.scene.quality.facets = Some(700);
        }
        loaded.scene.effects.picture_table = if tabulated { scene::Switch::On } else { scene::Switch::Off };
        if sight == "drawn" {
            // Else only a graphics processor draws maps.
            let quality = &mut loaded.scene.quality;
            (quality.visibility, quality.backend) = (Some("maps".to_owned()), "gpu".to_owned());
            (quality.azimuths, quality.rings) = (Some(10), Some(5));
        }
        let outcome = Pipeline::new().effective(&loaded).unwrap();
        if geometry == PYRAMIDS {
            // Of few normals it places as many as serve, not all that are asked for.
            loaded.scene.quality.facets = Some(5000);
        }
        let unseen = Pipeline::new().unseen(&loaded).unwrap().unwrap();
        let found = match &unseen.sum.sight {
            GpuVisibilityInput::Seen(_) => "held",
            GpuVisibilityInput::Heights(_) => "marched",
            GpuVisibilityInput::OcclusionIntervals(_) => "sliced",
            GpuVisibilityInput::Maps(_) => "drawn",
        };
        assert_eq!(found, sight, "{geometry}");
        let (studio, background) = (TestScene::of(kind), Background::Uniform(Vec3::ZERO));
        let shading_brdf = match tabulated {
            true => {
                let Representation::Direct(direct) = &outcome.brdf.form else { panic!("{geometry}: not direct") };
                let table =
                    ShadingTable::build(direct, unseen.sum.nodes.unwrap(), &Cancel::default()).unwrap().unwrap();
                outcome.brdf.with_direct_form(Representation::Table(table.read(unseen.sum.interpolation)))
            }
            false => outcome.brdf.as_ref().clone(),
        };
        let input = studio.input(&shading_brdf, 64, &background);
        let mut renderer = GpuRenderer::new(&gpu, input.mesh, input.occluder).unwrap();
        renderer.set_tile(&gpu, &unseen.sum).unwrap();
        // One submission, as on a graphics processor. The first picture makes what the second only reads.
        renderer.by_stage = false;
        let first = renderer.render(&gpu, &input, &Cancel::default()).unwrap().image;
        let again = renderer.render(&gpu, &input, &Cancel::default()).unwrap().image;
        assert_eq!(first, again, "{geometry}");
        // In many submissions it is the same to the bit.
        renderer.at_once = 1 << 20;
        renderer.set_tile(&gpu, &unseen.sum).unwrap();
        let in_parts = renderer.render(&gpu, &input, &Cancel::default()).unwrap().image;
        assert_eq!(first, in_parts, "{geometry}");
        assert_same_image(geometry, &[render(&input).unwrap().image, first]);
    }
    // A bottom so narrow that 700 facets leave it too few of its own: more of them serve.
    let narrow = "{ kind = \"grooves\", profile = \"rectangular\", bottom_width = 0.01 }";
    let mut narrow = open(narrow, LOBES[0], "direct");
    narrow.scene.quality.facets = Some(6144);
    let narrow = Pipeline::new().unseen(&narrow).unwrap().expect("a device serves");
    assert!(narrow.sum.sum.facet_count() <= 2800, "{}", narrow.sum.sum.facet_count());
    let mut glowing = open(RODS, LOBES[0], "direct");
    glowing.scene.effects.interreflection = scene::Switch::On;
    assert!(Pipeline::new().unseen(&glowing).unwrap().is_none(), "light between facets is the CPU's");
    let mut binned =
        open("{ kind = \"heightfield\", path = \"asset:ripples.png\", height_scale = 0.2 }", LOBES[0], "direct");
    (binned.scene.quality.facets, binned.scene.quality.normal_bins) = (Some(2000), Some(64));
    assert!(Pipeline::new().unseen(&binned).unwrap().is_none(), "of many normals that facets share the CPU picks");
}

#[test]
fn a_image_in_many_bands_and_submissions_is_the_same_to_the_bit() {
    let Some(gpu) = open_gpu() else { return };
    let brdf = effective(&open(PYRAMIDS, LOBES[4], "direct"));
    let studio = TestScene::of("cup");
    let input = RenderInput { samples_per_side: 2, ..studio.input(&brdf, 50, &Background::Wall) };
    let mut renderer = GpuRenderer::wearing(&gpu, input.mesh, input.occluder, &brdf).unwrap();
    let bands = |renderer: &GpuRenderer| renderer.room.as_ref().unwrap().bands.len();
    let whole = renderer.render(&gpu, &input, &Cancel::default()).unwrap();
    assert_eq!(bands(&renderer), 1);
    // Three rows at a time, the last two by themselves.
    renderer.at_once = renderer.at_once / bands(&renderer) as u64 / 1000;
    let cut = renderer.render(&gpu, &input, &Cancel::default()).unwrap();
    assert!(bands(&renderer) > 10, "{}", bands(&renderer));
    assert_eq!((&cut.image, cut.points), (&whole.image, whole.points));
    // As on a graphics processor: all stages of some bands together.
    renderer.by_stage = !renderer.by_stage;
    let together = renderer.render(&gpu, &input, &Cancel::default()).unwrap();
    assert_eq!((&together.image, together.points), (&whole.image, whole.points));
    // Silhouettes may lie on the other side of a sample.
    let points = render(&input).unwrap().points;
    assert!(cut.points.abs_diff(points) * 100 < points, "{} and the CPU's {points}", cut.points);
}

#[test]
fn a_image_that_nobody_waits_for_is_given_up_and_the_next_one_is_whole() {
    let Some(gpu) = open_gpu() else { return };
    let brdf = effective(&open(RODS, LOBES[4], "direct"));
    let studio = TestScene::of("cup");
    let input = studio.input(&brdf, 96, &Background::Wall);
    let mut renderer = GpuRenderer::wearing(&gpu, input.mesh, input.occluder, &brdf).unwrap();
    let before = renderer.render(&gpu, &input, &Cancel::default()).unwrap().image;
    let cancel = Cancel::default();
    cancel.set();
    assert!(matches!(renderer.render(&gpu, &input, &cancel), Err(crate::base::Error::Cancelled)));
    // Set while the device is at work: given up or, where it was quicker, done.
    let cancel = Cancel::default();
    let later = cancel.clone();
    let setter = std::thread::spawn(move || {
        std::thread::sleep(std::time::Duration::from_millis(20));
        later.set();
    });
    let given_up = renderer.render(&gpu, &input, &cancel);
    setter.join().unwrap();
    assert!(matches!(&given_up, Err(crate::base::Error::Cancelled) | Ok(_)), "{given_up:?}");
    assert_eq!(renderer.render(&gpu, &input, &Cancel::default()).unwrap().image.pixels, before.pixels);
}

/// What the editor shows first on a graphics processor, beside what the CPU refines it to.
#[test]
#[ignore = "takes a minute on software Vulkan"]
fn images_of_the_papers_five_scenes_made_from_the_tile_itself_are_the_cpu_s() {
    let Some(gpu) = open_gpu() else { return };
    let background = Background::Uniform(Vec3::ZERO);
    for name in ["table4_plate", "table4_teapot", "table4_pillow", "table4_cup", "table4_skirt"] {
        let loaded = scene::open(name, &[]).unwrap();
        let outcome = Pipeline::new().effective(&loaded).unwrap();
        let reads = outcome.shading_brdf(&Cancel::default()).unwrap().brdf;
        let unseen = Pipeline::new().unseen(&loaded).unwrap().unwrap();
        let stage = RenderScene::new(&loaded).unwrap();
        let cpu = render(&stage.input(&*reads, [160, 160], 1, &background)).unwrap().image;
        let mut renderer = GpuRenderer::new(&gpu, &stage.mesh, stage.occluder.as_ref()).unwrap();
        renderer.set_tile(&gpu, &unseen.sum).unwrap();
        let input = stage.input(&Black, [160, 160], 1, &background);
        let device = renderer.render(&gpu, &input, &Cancel::default()).unwrap().image;
        let tones = ToneMap::new(&stage.camera).unwrap();
        let shown = |image: &Image| -> Vec<u8> { image.to_srgb(&tones) };
        let (a, b) = (shown(&cpu), shown(&device));
        let squares = a.iter().zip(&b).map(|(a, b)| (f64::from(a.abs_diff(*b)) / 255.0).powi(2)).sum::<f64>();
        let db = -10.0 * (squares / a.len() as f64).log10();
        eprintln!("{name}: {db:.1} dB from the CPU's");
        assert!(db > 44.0, "{name}: {db:.1} dB");
    }
}
