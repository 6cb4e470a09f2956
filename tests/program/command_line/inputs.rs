//! Inputs and outputs are checked before anything is computed, an output replaces no input, and a result that is not
//! finite is not written.

use std::io::Cursor;

use serde_json::Value;

use super::folder::{CommandLine, FLAT, GROOVES, PAIRS};

/// A 1 x 1 Radiance image whose texel is the largest number of the format, 1.7e38.
const BRIGHTEST_HDR: &[u8] = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n\xff\xff\xff\xff";

/// Returns an OpenEXR image of one colour.
fn exr(value: f32) -> Vec<u8> {
    use exr::prelude::{Image, SpecificChannels, Vec2, WritableImage};
    let channels = SpecificChannels::rgb(|_: Vec2<usize>| (value, value, value));
    let mut bytes = Cursor::new(Vec::new());
    Image::from_channels((2, 2), channels).write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

fn with_colors(scene: &str, image: &str) -> String {
    scene.replacen("[tile]\n", &format!("[tile]\ncolor_path = \"{image}\"\n"), 1)
}

#[test]
fn a_colour_image_above_the_limit_of_colours_is_refused_with_its_pixel() {
    let folder = CommandLine::new();
    folder.write("pairs.csv", PAIRS);
    std::fs::create_dir(folder.path("sub")).unwrap();
    folder.write("sub/sky.hdr", BRIGHTEST_HDR);
    folder.write("sub/scene.toml", with_colors(FLAT, "sky.hdr"));
    for arguments in [
        &["eval", "sub/scene.toml", "--pairs", "pairs.csv", "-o", "out.csv"][..],
        &["export", "sub/scene.toml", "-o", "out.npz"],
        &["render", "sub/scene.toml", "-o", "out.png", "--size", "8x8"],
    ] {
        folder.assert_refused(arguments, &["sub/sky.hdr: pixel (0, 0): found [1.", "e38", "expected", "0 to 1000"]);
    }
    // The limit itself is a legal colour.
    folder.write("sub/sky.exr", exr(1000.0));
    folder.write("sub/scene.toml", with_colors(FLAT, "sky.exr"));
    folder.text(&["eval", "sub/scene.toml", "--pairs", "pairs.csv", "-o", "out.csv"]);
}

#[test]
fn an_image_that_is_not_finite_exits_with_1_and_is_not_written() {
    let folder = CommandLine::new();
    folder.write("image.exr", exr(1000.0));
    folder.write("sky.exr", exr(5e17));
    // Each export multiplies the BRDF by the largest colour and the largest texel.
    let scene =
        |brdf: &str| with_colors(FLAT, "image.exr").replace("brdf = ", &format!("color = 1000\nbrdf = {brdf} #"));
    folder.write("first.toml", scene("{ kind = \"lambertian\", albedo = 1000 }"));
    folder.write("second.toml", scene("{ kind = \"npz\", path = \"first.npz\" }"));
    let light = "[light]\nenvironment = \"sky.exr\"\nintensity = 1e6\ncount = 16\n[quality]\nbackend = \"cpu\"\n";
    folder.write("third.toml", scene("{ kind = \"npz\", path = \"second.npz\" }") + light);
    for [scene, table] in [["first.toml", "first.npz"], ["second.toml", "second.npz"]] {
        folder.text(&["export", scene, "-o", table, "--resolution", "4x4", "--quality", "draft", "--quiet"]);
    }
    let before = folder.files();
    for (command, file) in [("render", "t.png"), ("render", "t.exr"), ("fit", "t.exr")] {
        let output = folder.run(&[command, "third.toml", "-o", file, "--size", "8x8", "--quality", "draft"]);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{file}: {message}");
        assert!(message.contains("values that are not finite"), "{file}: {message}");
        assert!(output.stdout.is_empty() && folder.files() == before, "{file}");
    }
}

#[test]
fn materials_under_a_colour_image_above_1_are_not_said_to_conserve_energy() {
    let folder = CommandLine::new();
    folder.write("pairs.csv", PAIRS);
    folder.write("image.exr", exr(4.0));
    let grey = FLAT.replace("[0.2, 0.5, 0.8]", "0.5");
    folder.write("scene.toml", with_colors(&grey, "image.exr"));
    for quality in ["draft", "reference"] {
        let output = folder.run(&["eval", "scene.toml", "--pairs", "pairs.csv", "-o", "out.csv", "--quality", quality]);
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{message}");
        assert!(!message.contains("conserve energy: use"), "{quality}: {message}");
        let expected = "times the light that it receives under the brightest texel of the colour image";
        assert!(message.contains(expected), "{quality}: {message}");
    }
    // Under an image of 1, the same material conserves energy.
    folder.write("image.exr", exr(1.0));
    let plan = folder.json(&["plan", "scene.toml", "--json"]);
    assert_eq!(plan["health"]["surface"]["largest_color_weight"], 1.0);
    assert_eq!(plan["health"]["warnings"], Value::Array(Vec::new()));
}

/// A scene whose result has a warning, so that standard error shows whether the result was computed.
fn warned() -> String {
    GROOVES.replace("brdf =", "color = 5\nbrdf =")
}

#[test]
fn outputs_that_cannot_be_written_are_refused_before_anything_is_computed() {
    let folder = CommandLine::new();
    folder.write("scene.toml", warned());
    folder.write("pairs.csv", PAIRS);
    std::fs::create_dir(folder.path("taken")).unwrap();
    std::fs::create_dir(folder.path("taken.bsdf.txt")).unwrap();
    let before = folder.files();
    let refused = |arguments: &[&str], parts: &[&str]| {
        for target in [&[][..], &["--target-db", "30"], &["--budget-ms", "50"]] {
            let arguments = [arguments, target].concat();
            folder.assert_refused(&arguments, parts);
            let message = folder.run(&arguments).stderr;
            let message = String::from_utf8_lossy(&message);
            assert!(!message.contains("warning") && !message.contains("asked"), "{arguments:?}: {message}");
        }
        assert_eq!(folder.files(), before, "{arguments:?}");
    };
    let long = format!("{}.csv", "x".repeat(300));
    for place in ["none/out.csv", "taken", "pairs.csv/out.csv", "out.csv/", &long] {
        refused(&["eval", "scene.toml", "--pairs", "pairs.csv", "-o", place], &["output: found", "expected"]);
    }
    refused(&["render", "scene.toml", "-o", "a.bmp"], &["a.bmp: output: found the ending .bmp", ".png or .exr"]);
    refused(&["render", "scene.toml", "-o", "none/a.png"], &["none/a.png", "no folder `none`"]);
    refused(&["export", "scene.toml", "-o", "a.bmp"], &["a.bmp", ".npz"]);
    refused(&["export", "scene.toml", "-o", "none/a.npz"], &["none/a.npz", "no folder `none`"]);
    refused(&["export", "scene.toml", "-o", "taken.bsdf"], &["taken.bsdf.txt", "a folder"]);
    refused(&["export", "scene.toml", "-o", "a.npz", "--resolution", "5000x8"], &["resolution.theta_i", "5000"]);
    refused(&["fit", "scene.toml", "-o", "a.gltf", "-o", "a.bmp"], &["a.bmp", ".mtlx"]);
    refused(&["fit", "scene.toml", "-o", "a.gltf", "-o", "none/a.json"], &["none/a.json", "no folder `none`"]);
    refused(&["tile", "scene.toml", "-o", "a.bmp"], &["a.bmp", ".stl"]);
    refused(&["tile", "scene.toml", "-o", "none/a.obj"], &["none/a.obj", "no folder `none`"]);
}

#[test]
fn inputs_that_cannot_be_opened_are_refused_before_anything_is_computed() {
    let folder = CommandLine::new();
    folder.write("scene.toml", warned());
    folder.write("no_sky.toml", warned().replace("\"sun\"", "\"none.hdr\""));
    folder.write("no_object.toml", warned().replace("\"sphere\"", "\"mesh\"\npath = \"none.obj\""));
    folder.write(
        "no_brdf.toml",
        FLAT.replace("\"lambertian\", albedo = [0.2, 0.5, 0.8]", "\"merl\", path = \"none.binary\""),
    );
    folder.write("pairs.csv", PAIRS);
    let refused = |arguments: &[&str], file: &str| {
        for target in [&[][..], &["--target-db", "30"]] {
            let arguments = [arguments, target].concat();
            folder.assert_refused(&arguments, &[file]);
            let message = folder.run(&arguments).stderr;
            let message = String::from_utf8_lossy(&message);
            assert!(!message.contains("warning") && !message.contains("asked"), "{arguments:?}: {message}");
        }
    };
    refused(&["eval", "scene.toml", "--pairs", "none.csv", "-o", "out.csv"], "none.csv");
    for (scene, file) in [("no_sky.toml", "none.hdr"), ("no_object.toml", "none.obj"), ("no_brdf.toml", "none.binary")]
    {
        refused(&["render", scene, "-o", "out.png"], file);
        refused(&["fit", scene, "-o", "out.png"], file);
        refused(&["plan", scene], file);
        refused(&["profile", scene, "--edit", "camera"], file);
        // The files of the second scene are read before the first scene is measured.
        folder.assert_refused(&["report", "scene.toml", scene, "-o", "report", "--minutes", "0"], &[file]);
        assert_eq!(std::fs::read_dir(folder.path("report")).unwrap().count(), 0, "{scene}");
    }
}

#[test]
fn an_output_that_is_an_input_is_refused_and_the_input_stays() {
    let folder = CommandLine::new();
    let texels = image::RgbImage::from_pixel(2, 2, image::Rgb([255; 3]));
    let mut png = Cursor::new(Vec::new());
    texels.write_to(&mut png, image::ImageFormat::Png).unwrap();
    let png = png.into_inner();
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
    folder.write("pairs.csv", PAIRS);
    folder.write("color.png", &png);
    folder.write("slot.png", image_of_zeros());
    folder.write("tile.obj", square);
    folder.write("object.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    folder.write("sky.exr", exr(1.0));
    let scene = "[tile]\ncolor_path = \"color.png\"\nslot_path = \"slot.png\"\ngeometry = { kind = \"mesh\", path = \
                 \"tile.obj\" }\n[object]\nkind = \"mesh\"\npath = \"object.obj\"\n[light]\nenvironment = \
                 \"sky.exr\"\n[quality]\npreset = \"draft\"\nbackend = \"cpu\"\n";
    for name in ["scene.toml", "scene.csv", "scene.json", "table.bsdf.txt"] {
        folder.write(name, scene);
    }
    folder.write("measured.toml", "[tile]\ngeometry = { kind = \"flat\" }\n[[material]]\nname = \"default\"\nbrdf = { kind = \"npz\", path = \"material.npz\" }\n");
    folder.text(&["export", "scene.toml", "-o", "material.npz", "--resolution", "8x16", "--quiet"]);
    folder.write("heights.toml", "[tile]\ngeometry = { kind = \"heightfield\", path = \"color.png\" }\n");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("pairs.csv", folder.path("symbolic.csv")).unwrap();
        std::fs::hard_link(folder.path("pairs.csv"), folder.path("hard.csv")).unwrap();
        std::os::unix::fs::symlink(".", folder.path("here")).unwrap();
    }
    let contents = || -> Vec<(String, Vec<u8>)> {
        let names = folder.files().into_iter().filter(|name| folder.path(name).is_file());
        names.map(|name| (name.clone(), std::fs::read(folder.path(&name)).unwrap())).collect()
    };
    let before = contents();
    let refused = |arguments: &[&str], input: &str| {
        folder.assert_refused(arguments, &["an input (", input]);
        assert!(contents() == before, "{arguments:?} changed a file");
    };
    let eval = |scene: &str, output: &str, input: &str| {
        refused(&["eval", scene, "--pairs", "pairs.csv", "-o", output], input);
    };
    eval("scene.toml", "pairs.csv", "pairs.csv");
    eval("scene.toml", "./pairs.csv", "pairs.csv");
    eval("scene.csv", "scene.csv", "scene.csv");
    #[cfg(unix)]
    for output in ["symbolic.csv", "hard.csv", "here/pairs.csv"] {
        eval("scene.toml", output, "pairs.csv");
    }
    #[cfg(unix)]
    refused(&["eval", "scene.toml", "--pairs", "symbolic.csv", "-o", "pairs.csv"], "symbolic.csv");
    for image in ["color.png", "slot.png", "sky.exr"] {
        refused(&["render", "scene.toml", "-o", image], image);
        refused(&["fit", "scene.toml", "-o", image], image);
    }
    refused(&["render", "heights.toml", "-o", "color.png"], "color.png");
    refused(&["export", "measured.toml", "-o", "material.npz"], "material.npz");
    // The note beside the table is an output as well.
    refused(&["export", "table.bsdf.txt", "-o", "table.bsdf"], "table.bsdf.txt");
    refused(&["fit", "scene.json", "-o", "scene.json"], "scene.json");
    for mesh in ["tile.obj", "object.obj"] {
        refused(&["tile", "scene.toml", "-o", mesh], mesh);
    }
    refused(&["tile", "default", "--set", "tile.color_path=color.png", "-o", "color.png"], "color.png");
    std::fs::create_dir(folder.path("report")).unwrap();
    folder.write("report/report.csv", scene.replace(" \"tile.obj", " \"../tile.obj"));
    folder.assert_refused(&["report", "report/report.csv", "-o", "report"], &["an input ("]);
    assert!(std::fs::read_to_string(folder.path("report/report.csv")).unwrap().contains("[tile]"));
}

fn image_of_zeros() -> Vec<u8> {
    let mut png = Cursor::new(Vec::new());
    image::GrayImage::new(2, 2).write_to(&mut png, image::ImageFormat::Png).unwrap();
    png.into_inner()
}

#[test]
fn pairs_with_a_byte_order_mark_are_read() {
    let folder = CommandLine::new();
    folder.write("flat.toml", FLAT);
    folder.write("plain.csv", PAIRS);
    folder.write("marked.csv", format!("\u{feff}{PAIRS}"));
    let [plain, marked] = ["plain.csv", "marked.csv"]
        .map(|pairs| folder.text(&["eval", "flat.toml", "--pairs", pairs, "-o", "-", "--quiet"]));
    assert_eq!(plain, marked);
}

#[test]
fn a_scale_out_of_range_is_refused_with_its_range() {
    let folder = CommandLine::new();
    let tile = |option: &str, value: &str, parts: &[&str]| {
        folder.assert_refused(&["tile", "default", "-o", "a.stl", option, value], parts);
    };
    tile("--scale", "1e7", &["found 10000000", "a number above 0 and at most 1000000"]);
    tile("--base", "1e5", &["found 100000,", "a number above 0 and at most 10000"]);
}

#[test]
fn a_path_of_5000_characters_is_shown_in_part() {
    let folder = CommandLine::new();
    folder.write("flat.toml", FLAT);
    folder.write("pairs.csv", PAIRS);
    let long = "folder/".repeat(714);
    folder.write("image.toml", with_colors(FLAT, &format!("{long}image.png")));
    let set = format!("tile.color_path={long}image.png");
    let in_folder = |name: &str| format!("{long}{name}");
    for (arguments, name) in [
        (vec!["plan".to_owned(), in_folder("scene.toml")], "folder/"),
        (
            ["eval", "flat.toml", "--pairs", &in_folder("pairs.csv"), "-o", "out.csv"].map(str::to_owned).to_vec(),
            "pairs.csv",
        ),
        (
            ["eval", "flat.toml", "--pairs", "pairs.csv", "-o", &in_folder("out.csv")].map(str::to_owned).to_vec(),
            "out.csv",
        ),
        (["plan", "image.toml"].map(str::to_owned).to_vec(), "image.png"),
        (["plan", "flat.toml", "--set", &set].map(str::to_owned).to_vec(), "image.png"),
        (
            ["plan", "flat.toml", "--set", &set.replace("color_path", "color_paht")].map(str::to_owned).to_vec(),
            "image.png",
        ),
    ] {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        folder.assert_refused(&arguments, &[name]);
        let message = folder.run(&arguments).stderr;
        assert!(message.len() < 1000, "{} bytes: {}", message.len(), String::from_utf8_lossy(&message));
    }
}

#[test]
fn images_and_meshes_are_named_by_the_path_that_leads_to_them() {
    let folder = CommandLine::new();
    std::fs::create_dir(folder.path("sub")).unwrap();
    folder.write("pairs.csv", PAIRS);
    folder.write("sub/text.png", "not an image");
    folder.write("sub/empty.obj", "");
    folder.write("sub/nan.exr", exr(f32::NAN));
    for (tile, file) in [
        ("color_path = \"text.png\"\ngeometry = { kind = \"flat\" }", "sub/text.png"),
        ("color_path = \"nan.exr\"\ngeometry = { kind = \"flat\" }", "sub/nan.exr"),
        ("slot_path = \"text.png\"\ngeometry = { kind = \"flat\" }", "sub/text.png"),
        ("geometry = { kind = \"heightfield\", path = \"text.png\" }", "sub/text.png"),
        ("geometry = { kind = \"mesh\", path = \"empty.obj\" }", "sub/empty.obj"),
    ] {
        folder.write("sub/scene.toml", format!("[tile]\n{tile}\n"));
        folder.assert_refused(&["eval", "sub/scene.toml", "--pairs", "pairs.csv", "-o", "out.csv"], &[file]);
    }
}

/// Drivers print this message when they look for a Wayland display; without a Vulkan driver, the test sees none.
#[test]
#[cfg(target_os = "linux")]
fn a_render_without_a_desktop_prints_no_message_of_a_driver() {
    let folder = CommandLine::new();
    folder.write("grooves.toml", GROOVES);
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_biscale"))
        .args(["render", "grooves.toml", "-o", "image.png", "--size", "8x8"])
        .env("BISCALE_CACHE", "off")
        .env_remove("XDG_RUNTIME_DIR")
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("DISPLAY")
        .current_dir(folder.path(""))
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !message.contains("XDG_RUNTIME_DIR"), "{message}");
}
