//! Output of the subcommands.

use serde_json::Value;

use super::folder::{CommandLine, FLAT, GROOVES};

#[test]
fn materials_lists_at_least_sixteen_names_with_descriptions() {
    let folder = CommandLine::new();
    let text = folder.text(&["materials"]);
    assert!(text.lines().count() >= 16, "{text}");
    let listed = folder.json(&["materials", "--json"]);
    let listed = listed.as_array().unwrap();
    assert_eq!(listed.len(), text.lines().count());
    for row in listed {
        assert!(!row["description"].as_str().unwrap().is_empty(), "{row}");
    }
    let names: Vec<&str> = listed.iter().map(|row| row["name"].as_str().unwrap()).collect();
    for table in ["plate", "teapot", "pillow", "cup", "skirt"] {
        assert!(names.contains(&format!("table4_{table}").as_str()), "the scene of Table 4's {table} is missing");
    }
}

#[test]
fn plan_json_has_its_documented_keys_and_a_reason_for_every_effect() {
    let folder = CommandLine::new();
    folder.write("grooves.toml", GROOVES);
    let plan = folder.json(&["plan", "grooves.toml", "--json", "--quiet"]);
    let effects = plan["effects"].as_array().unwrap();
    assert!(effects.len() >= 5);
    for effect in effects {
        assert!(effect["name"].is_string() && effect["on"].is_boolean(), "{effect}");
        assert!(effect["reason"].as_str().unwrap().len() > 5, "{effect}");
        assert!(effect["predicted_ms"].as_f64().unwrap() >= 0.0);
        assert!(effect["measured_ms"].is_null() || effect["measured_ms"].as_f64().unwrap() >= 0.0);
    }
    let find = |plan: &Value, name: &str| {
        plan["effects"].as_array().unwrap().iter().find(|e| e["name"] == name).unwrap()["on"] == true
    };
    assert!(find(&plan, "visibility"));
    folder.write("flat.toml", FLAT);
    let flat = folder.json(&["plan", "flat.toml", "--json", "--quiet"]);
    assert!(!find(&flat, "visibility"), "a flat tile blocks nothing");
}

#[test]
fn render_writes_images_of_the_requested_size() {
    let folder = CommandLine::new();
    folder.write("scene.toml", GROOVES);
    for file in ["image.png", "image.exr"] {
        folder.text(&[
            "render",
            "scene.toml",
            "-o",
            file,
            "--size",
            "48x32",
            "--samples",
            "1",
            "--backend",
            "cpu",
            "--quiet",
        ]);
    }
    let image = image::open(folder.path("image.png")).unwrap().to_rgb8();
    assert_eq!(image.dimensions(), (48, 32));
    let distinct: std::collections::BTreeSet<[u8; 3]> = image.pixels().map(|pixel| pixel.0).collect();
    assert!(distinct.len() > 20, "the image of a sphere has {} colours", distinct.len());
    let exr = exr::prelude::read_first_rgba_layer_from_file(
        folder.path("image.exr"),
        |size, _| (size, Vec::<f32>::new()),
        |(_, values), _, (r, g, b, _): (f32, f32, f32, f32)| values.extend([r, g, b]),
    )
    .unwrap();
    let (size, values) = exr.layer_data.channel_data.pixels;
    assert_eq!((size.width(), size.height()), (48, 32));
    assert!(values.iter().all(|value| value.is_finite() && *value >= 0.0));
}

#[test]
fn basis_has_one_row_per_material_with_the_columns_of_table_3() {
    let folder = CommandLine::new();
    folder.write("scene.toml", GROOVES);
    let table = folder.json(&["basis", "scene.toml", "--json", "--quality", "draft"]);
    let table = table.as_array().unwrap();
    assert_eq!(table.len(), 1);
    let row = &table[0];
    assert_eq!(row["material"], "default");
    for column in ["rows", "columns", "rank"] {
        assert!(row[column].as_u64().unwrap() > 0, "{column}: {row}");
    }
    for column in ["full_mb", "kept_mb", "seconds"] {
        assert!(row[column].as_f64().unwrap() > 0.0, "{column}: {row}");
    }
    assert!(row["kept_mb"].as_f64().unwrap() < row["full_mb"].as_f64().unwrap());
}

#[test]
fn profile_lists_the_stages_downstream_of_the_edit_and_no_others() {
    let folder = CommandLine::new();
    folder.write("scene.toml", GROOVES);
    let stages = |edit: &[&str]| -> Vec<String> {
        let mut arguments = vec!["profile", "scene.toml", "--json", "--repeat", "1", "--quiet"];
        arguments.extend(edit);
        let report = folder.json(&arguments);
        assert!(report["total_ms"].as_f64().unwrap() >= 0.0);
        assert!(report["stages"].as_object().unwrap().values().all(|ms| ms.as_f64().unwrap() >= 0.0));
        report["stages"].as_object().unwrap().keys().cloned().collect()
    };
    assert_eq!(stages(&[]), ["facets", "geometry", "materials", "product", "visibility"]);
    assert_eq!(stages(&["--edit", "geometry"]), ["facets", "geometry", "product", "visibility"]);
    assert_eq!(stages(&["--edit", "brdf"]), ["materials", "product"]);
    assert_eq!(stages(&["--edit", "color"]), ["materials", "product"]);
    assert_eq!(stages(&["--edit", "camera"]), ["g_buffer", "shading", "shadows"]);
}
