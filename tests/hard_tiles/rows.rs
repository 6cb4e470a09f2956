//! The hard tiles.

use glam::Vec3;

use super::closed_forms::{Grooves, Holes};
use super::{File, HardTile, Truth, images, meshes};

const WHITE: &str = r#"{ kind = "lambertian", albedo = 1.0 }"#;
const MATTE: &str = r#"{ kind = "lambertian", albedo = 0.3 }"#;
const DARK: &str = r#"{ kind = "lambertian", albedo = 0.02 }"#;
const BLACK: &str = r#"{ kind = "lambertian", albedo = 0 }"#;
const GLOSSY: &str = r#"{ kind = "cook_torrance", roughness = 0.2, f0 = [0.9, 0.8, 0.6] }"#;
const MIRROR: &str = r#"{ kind = "cook_torrance", roughness = 0.08, f0 = 0.95 }"#;

const FLAT: &str = r#"geometry = { kind = "flat" }"#;
const V_GROOVES: &str = r#"geometry = { kind = "grooves", profile = "v", count = 4, side_angle_deg = 40 }"#;
const PYRAMIDS: &str = r#"geometry = { kind = "pyramids", height = 0.2 }"#;
const RODS: &str = r#"geometry = { kind = "rods", count = 60, radius = 0.03, length = 0.2 }"#;
const WEAVE: &str = r#"geometry = { kind = "weave" }"#;
const HAMMERED: &str = r#"geometry = { kind = "heightfield", path = "asset:hammered.png", height_scale = 0.08 }"#;

type Materials<'a> = &'a [(&'static str, &'static str)];

/// A tile without closed form and without files.
fn plain(name: &'static str, tile: &str, materials: Materials<'_>) -> HardTile {
    let tile = tile.to_owned();
    HardTile { name, tile, materials: materials.to_vec(), files: Vec::new(), truth: Truth::RayCast }
}

/// A tile with an image of colours over one material.
fn colored(name: &'static str, tile: &str, brdf: &'static str, image: File) -> HardTile {
    let truth = if tile == FLAT { Truth::Level(vec![("default", image.mean_color())]) } else { Truth::RayCast };
    let tile = format!("color_path = \"colors.exr\"\n{tile}");
    HardTile { name, tile, materials: vec![("default", brdf)], files: vec![("colors.exr", image)], truth }
}

/// A tile with mirrors painted on a dark surface.
fn spotted(name: &'static str, tile: &str, image: File) -> HardTile {
    let share = image.painted_share();
    let weights = vec![("default", Vec3::splat(1.0 - share)), ("paint_1", Vec3::splat(share))];
    let truth = if tile == FLAT { Truth::Level(weights) } else { Truth::RayCast };
    let tile = format!("slot_path = \"slots.png\"\n{tile}");
    let materials = vec![("default", DARK), ("paint_1", MIRROR)];
    HardTile { name, tile, materials, files: vec![("slots.png", image)], truth }
}

/// A level tile with stripes that have a small share of the area.
fn striped(name: &'static str, count: usize, share: f32, stripe: &'static str, ground: &'static str) -> HardTile {
    let tile = format!("geometry = {{ kind = \"flat\", pattern = \"stripes\", count = {count}, ratio = {share} }}");
    let truth = Truth::Level(vec![("first", Vec3::splat(share)), ("second", Vec3::splat(1.0 - share))]);
    HardTile { truth, ..plain(name, &tile, &[("first", stripe), ("second", ground)]) }
}

/// Rectangular grooves with bottoms of nine tenths of the pitch. `depth` is in pitches.
fn grooves(name: &'static str, depth: f64, turned: bool, [bottom, sides]: [&'static str; 2]) -> HardTile {
    // Turned by 45°, four grooves across the tile become three along either side.
    let (rotation_deg, pitch) = if turned { (45.0, 1.0 / (3.0 * 2.0_f64.sqrt())) } else { (0.0, 0.25) };
    let form = Grooves { depth: depth * pitch, pitch, width: 0.9 * pitch, azimuth_deg: rotation_deg };
    let tile = format!(
        "geometry = {{ kind = \"grooves\", profile = \"rectangular\", count = 4, bottom_width = 0.9, depth = {}, \
         rotation_deg = {rotation_deg} }}",
        form.depth
    );
    HardTile { truth: Truth::Grooves(form), ..plain(name, &tile, &[("bottom", bottom), ("sides", sides)]) }
}

/// A tile whose mesh is a file.
fn mesh(name: &'static str, text: String, materials: Materials<'_>) -> HardTile {
    let files = vec![("tile.obj", File::Mesh(text))];
    HardTile { files, ..plain(name, r#"geometry = { kind = "mesh", path = "tile.obj" }"#, materials) }
}

/// A black sheet with holes above a white floor.
fn sheet(name: &'static str, holes: Holes, underside: bool) -> HardTile {
    let tile = mesh(name, meshes::sheet(&holes, underside), &[("floor", WHITE), ("sheet", BLACK)]);
    HardTile { truth: Truth::Holes(holes), ..tile }
}

/// Returns all hard tiles.
pub fn all() -> Vec<HardTile> {
    let white = |side: usize, seed: u64| images::texels(side, Vec3::ZERO, &[Vec3::ONE; 40], seed);
    let rgb: Vec<Vec3> = (0..60).map(|k| [Vec3::X, Vec3::Y, Vec3::Z][k % 3]).collect();
    let mut stripe = vec![Vec3::ZERO; 2048];
    stripe[700] = Vec3::ONE;
    let rods = |parameters: &str| format!("geometry = {{ kind = \"rods\", {parameters} }}");
    vec![
        // Rare colours.
        colored("40 white texels", FLAT, WHITE, white(512, 1)),
        colored("40 white texels elsewhere", FLAT, WHITE, white(512, 2)),
        colored("40 glossy texels", FLAT, GLOSSY, white(512, 3)),
        colored("one white texel", FLAT, WHITE, images::texels(1024, Vec3::ZERO, &[Vec3::ONE], 4)),
        colored("16 texels of 200", FLAT, WHITE, images::texels(512, Vec3::splat(0.02), &[Vec3::splat(200.0); 16], 5)),
        colored("60 coloured texels", FLAT, WHITE, images::texels(256, Vec3::ZERO, &rgb, 6)),
        colored("40 black texels", FLAT, WHITE, images::texels(512, Vec3::ONE, &[Vec3::ZERO; 40], 7)),
        colored("white texels on V-grooves", V_GROOVES, WHITE, white(512, 8)),
        colored("white texels on V-grooves elsewhere", V_GROOVES, WHITE, white(512, 9)),
        colored("glossy texels on V-grooves", V_GROOVES, GLOSSY, white(512, 10)),
        colored("white texels on hammered relief", HAMMERED, WHITE, white(512, 11)),
        colored("white line on V-grooves", V_GROOVES, WHITE, File::Colors(2048, stripe)),
        // Rare slots.
        spotted("mirrors on rods", RODS, images::discs(256, 12, 3.0, 1)),
        spotted("mirrors on hammered relief", HAMMERED, images::discs(256, 12, 3.0, 2)),
        spotted("mirrors, level", FLAT, images::discs(256, 12, 2.0, 3)),
        spotted("mirrors on a weave", WEAVE, images::discs(256, 12, 3.0, 4)),
        spotted("mirrors on pyramids", PYRAMIDS, images::discs(512, 40, 3.0, 5)),
        // Thin stripes.
        striped("white stripe", 1, 0.0003, WHITE, BLACK),
        // A power of two, so that the stripes' edges are exact in `f32`.
        striped("64 white stripes", 64, 1.0 / 4096.0, WHITE, BLACK),
        striped("mirror stripes", 3, 0.001, MIRROR, MATTE),
        striped("black stripe", 1, 0.0003, BLACK, WHITE),
        // Grooves and fins.
        grooves("grooves of 1 pitch", 1.0, false, [WHITE, BLACK]),
        grooves("grooves of 4 pitches", 4.0, false, [WHITE, BLACK]),
        grooves("grooves of 10 pitches", 10.0, false, [WHITE, BLACK]),
        grooves("grooves of 40 pitches", 40.0, false, [WHITE, BLACK]),
        grooves("grooves of 10 pitches, turned", 10.0, true, [WHITE, BLACK]),
        grooves("grooves of 4 pitches, glossy", 4.0, false, [GLOSSY, BLACK]),
        grooves("deep fins", 4.0, false, [BLACK, WHITE]),
        grooves("deep glossy fins", 10.0, true, [MATTE, GLOSSY]),
        // Holes.
        sheet("one hole of 2.25 %", Holes { height: 0.3, side: 0.15, pitch: 1.0 }, false),
        sheet("16 holes of 0.25 %", Holes { height: 0.1, side: 0.0125, pitch: 0.25 }, false),
        sheet("closed sheet with holes", Holes { height: 0.5, side: 0.1, pitch: 1.0 / 3.0 }, true),
        // Hairs, needles and pillars.
        plain(
            "glossy hairs",
            &rods("count = 300, radius = 0.003, length = 0.3"),
            &[("rods", GLOSSY), ("floor", BLACK)],
        ),
        plain(
            "leaning hairs",
            &rods("count = 60, radius = 0.006, length = 0.3, lean_deg = 40"),
            &[("rods", WHITE), ("floor", BLACK)],
        ),
        plain(
            "needles",
            &rods("count = 100, radius = 0.01, length = 1.5, taper = 1, spread_deg = 3"),
            &[("rods", WHITE), ("floor", MATTE)],
        ),
        plain("pillars of two samples", &images::pillars(32, 4, 1.5, 1), &[("default", WHITE)]),
        // Flakes, two scales, black among bright, noise.
        mesh("mirror flakes", meshes::flakes(18, 0.15, 20.0, 1), &[("floor", DARK), ("flakes", MIRROR)]),
        plain("two scales of relief", &images::two_scales(64, 1), &[("default", GLOSSY)]),
        plain("black rods on white", RODS, &[("rods", BLACK), ("floor", WHITE)]),
        plain("noise of 12 x 12", &images::noise(12, 0.08, 1), &[("default", WHITE)]),
    ]
}
