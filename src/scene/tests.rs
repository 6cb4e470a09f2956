//! Tests of scene files: defaults, errors, round trips.

use glam::Vec3;
use proptest::prelude::*;
use toml::{Table, Value};

use super::check::{PathStep, check_table};
use super::*;

pub(super) const GROOVES: &str = "[tile]\ngeometry = { kind = \"grooves\" }\n";

/// A scene with a material for each part.
pub(super) const TWO_COLOURS: &str = "[tile]\ngeometry = { kind = \"grooves\" }\n\
    [[material]]\nname = \"default\"\nbrdf = { kind = \"cook_torrance\", roughness = 0.2, f0 = 0.9 }\n\
    [[material]]\nname = \"sides\"\ncolor = [1, 1, 0]\n";

fn error(source: &str) -> String {
    parse(source).unwrap_err().to_string()
}

pub(super) fn set(source: &str, overrides: &[&str]) -> Result<Scene> {
    let overrides: Vec<String> = overrides.iter().map(|text| (*text).to_owned()).collect();
    load_with_overrides(source, &overrides)
}

#[test]
fn only_the_tile_is_required_and_the_rest_has_the_documented_defaults() {
    let scene = parse(GROOVES).unwrap();
    assert_eq!(scene, Scene::of(Geometry::Grooves(Grooves::default())));
    assert_eq!(
        (scene.object.kind.as_str(), scene.light.environment.as_str(), scene.light.count),
        ("sphere", "studio", 32)
    );
    assert_eq!(scene.quality.preset, "standard");
    assert!(error("").contains("tile"));
    assert!(error("[tile]\n").contains("tile.geometry"));
}

#[test]
fn integers_stand_for_floats_and_scalars_for_colours() {
    let text = "version = 1\n[tile]\nsize = [1, 2]\ngeometry = { kind = \"grooves\", depth = 1 }\n\
        [[material]]\nname = \"default\"\ncolor = 1\nbrdf = [{ kind = \"lambertian\", albedo = 0.25 }, { kind = \"ggx\", roughness = 1, f0 = [1, 0, 0.5] }]\n";
    let scene = parse(text).unwrap();
    assert_eq!(scene.tile.size, glam::Vec2::new(1.0, 2.0));
    assert_eq!(scene.materials[0].color, Vec3::ONE);
    let expected = [
        TermSpec::Lambertian { albedo: Vec3::splat(0.25) },
        TermSpec::Ggx { roughness: 1.0, f0: Vec3::new(1.0, 0.0, 0.5) },
    ];
    assert_eq!(scene.materials[0].brdf.as_ref().unwrap().terms(), expected);
}

#[test]
fn a_scene_with_every_table_loads() {
    let text = r#"
[tile]
size = [1.0, 1.0]
geometry = { kind = "mesh", path = "tile.obj" }
[[material]]
name = "default"
brdf = { kind = "cook_torrance", roughness = 0.2, f0 = [0.9, 0.6, 0.3] }
color = [1.0, 1.0, 1.0]
[object]
kind = "sphere"
[light]
environment = "studio"
count = 32
directional = [{ direction = [0, 1, 0], irradiance = 3 }]
[camera]
[quality]
preset = "standard"
"#;
    let scene = parse(text).unwrap();
    assert_eq!(scene.light.directional[0].irradiance, Vec3::splat(3.0));
    assert_eq!(scene.camera, Some(Camera::default()));
}

#[test]
fn unknown_keys_are_named_in_full_with_line_and_suggestion_at_every_level() {
    for (text, parts) in [
        ("tiel = 1\n[tile]\ngeometry = { kind = \"flat\" }", ["line 1", "tiel", "did you mean `tile`?"]),
        ("[tile]\nsise = [1, 1]\ngeometry = { kind = \"flat\" }", ["line 2", "tile.sise", "`size`"]),
        ("[tile]\n\n[tile.geometry]\nkind = \"grooves\"\ndpeth = 1", ["line 5", "tile.geometry.dpeth", "`depth`"]),
        (
            "[tile]\ngeometry = { kind = \"flat\" }\n[[material]]\nname = \"a\"\nbrdf = { kind = \"ward\", rougness = 0.2 }",
            ["line 5", "material.a.brdf.rougness", "`roughness`"],
        ),
        (
            "[tile]\ngeometry = { kind = \"flat\" }\n[[material]]\nname = \"a\"\nbrdf = [{ kind = \"lambertian\", f0 = 0.2 }]",
            ["line 5", "material.a.brdf.0.f0", "albedo"],
        ),
        (
            "[tile]\ngeometry = { kind = \"flat\" }\n[light]\ndirectional = [{ direction = [0,1,0], irradiance = 1, colour = 1 }]",
            ["line 4", "light.directional.0.colour", "irradiance"],
        ),
        // A key of the enclosing table.
        (
            "[tile.geometry]\nkind = \"heightfield\"\ncolor_path = \"colors.png\"",
            ["line 3", "tile.geometry.color_path", "`color_path` belongs one table up, in `[tile]`"],
        ),
        ("[tile]\ngeometry = { kind = \"flat\", slot_path = \"m.png\" }", ["line 2", "slot_path", "in `[tile]`"]),
        ("[tile]\ngeometry = { kind = \"grroves\" }", ["line 2", "tile.geometry.kind", "did you mean `grooves`?"]),
        ("[tile]\ngeometry = { depth = 1 }", ["line 2", "tile.geometry.kind", "one of grooves"]),
        (
            "[tile]\ngeometry = { kind = \"flat\" }\n[quality]\npreset = \"standart\"",
            ["line 4", "quality.preset", "`standard`"],
        ),
    ] {
        let message = error(text);
        for part in parts {
            assert!(message.contains(part), "{text:?}\n  {message}\n  lacks {part}");
        }
    }
}

#[test]
fn values_out_of_range_or_of_the_wrong_type_name_field_found_and_expected() {
    for (value, found, expected) in [
        ("nan", "nan", "from 0 to 1000"),
        ("inf", "inf", "from 0 to 1000"),
        ("-1", "found -1", "from 0 to 1000"),
        ("1e9", "1000000000", "from 0 to 1000"),
        ("\"deep\"", "\"deep\"", "a number"),
        ("[1]", "a list", "a number"),
        ("true", "true", "a number"),
    ] {
        let message = error(&format!("[tile.geometry]\nkind = \"grooves\"\ndepth = {value}\n"));
        for part in ["line 3", "tile.geometry.depth", found, expected] {
            assert!(message.contains(part), "{value}: {message} lacks {part}");
        }
    }
    assert!(error("version = 2\n[tile]\ngeometry = { kind = \"flat\" }").contains("version"));
    assert!(error("[tile]\nsize = [0, 1]\ngeometry = { kind = \"flat\" }").contains("tile.size.0"));
    assert!(error("[tile]\nsize = 1\ngeometry = { kind = \"flat\" }").contains("a list of 2 numbers"));
    assert!(error("[tile]\ngeometry = { kind = \"grooves\", count = 2.5 }").contains("a whole number"));
    assert!(error("[tile\n").contains("line 1"));
    assert!(error("[tile]\ngeometry = 3").contains("tile.geometry"));
    assert!(error("tile = [1]").contains("tile"));
}

#[test]
fn fields_that_belong_together_are_checked_together() {
    let with = |text: &str| error(&format!("{GROOVES}{text}"));
    assert!(with("[object]\nkind = \"mesh\"").contains("object.path"));
    assert!(
        with("[light]\ndirectional = [{ direction = 0, irradiance = 1 }]").contains("light.directional.0.direction")
    );
    assert!(with("[light]\ndirectional = [{ direction = [0, 0, 0], irradiance = 1 }]").contains("without length"));
    assert!(with("[[material]]\nname = \"a\"").contains("a BRDF"));
    let twice = "[[material]]\nname = \"a\"\nbrdf = { kind = \"ggx\" }\n".repeat(2);
    assert!(with(&twice).contains("a second time"));
    assert!(error("[tile]\ngeometry = { kind = \"mesh\" }").contains("an OBJ file"));
    assert!(error("[tile]\ngeometry = { kind = \"heightfield\" }").contains("`path`"));
    assert!(error("[tile]\ngeometry = { kind = \"heightfield\", values = [[1], [1, 2]] }").contains("one length"));
    assert!(error("[tile]\ngeometry = { kind = \"weave\", pattern = [[1], [1, 0]] }").contains("one length"));
    assert!(error("[tile]\ngeometry = { kind = \"weave\", pattern = [[2]] }").contains("pattern.0.0"));
    assert!(error("[tile]\ngeometry = { kind = \"weave\", pattern = \"twil\" }").contains("`twill`"));
}

#[test]
fn a_slot_has_its_own_material_or_the_default_or_is_an_error() {
    let scene = parse(GROOVES).unwrap();
    let grey = scene.material_for_slot("bottom").unwrap();
    assert_eq!((grey.index, grey.brdf.terms()), (None, &[TermSpec::Lambertian { albedo: Vec3::splat(0.5) }][..]));

    let bottom = "[[material]]\nname = \"bottom\"\ncolor = [0, 1, 0]\n";
    let default = "[[material]]\nname = \"default\"\nbrdf = { kind = \"ward\", roughness = 0.3, specular = 1 }\n";
    let scene = parse(&format!("{GROOVES}{bottom}{default}")).unwrap();
    let found = scene.material_for_slot("bottom").unwrap();
    assert_eq!((found.index, found.color, found.brdf.terms()[0].kind()), (Some(0), Vec3::Y, "ward"));
    assert_eq!(scene.material_for_slot("sides").unwrap().index, Some(1));

    let scene = parse(&format!("{GROOVES}{bottom}brdf = {{ kind = \"ggx\" }}\n")).unwrap();
    let message = scene.material_for_slot("botom").unwrap_err().to_string();
    assert!(message.contains("`botom` or `default`") && message.contains("call it `botom`"), "{message}");
}

#[test]
fn an_unused_material_whose_name_resembles_that_of_a_slot_is_misspelt() {
    let slots = ["bottom", "sides"].map(str::to_owned);
    let named = |names: &[&str]| {
        let of = |name: &&str| format!("[[material]]\nname = \"{name}\"\nbrdf = {{ kind = \"lambertian\" }}\n");
        let materials: String = names.iter().map(of).collect();
        let scene = parse(&format!("{GROOVES}{materials}")).unwrap();
        let found = scene.misspelt_materials(&slots);
        found.into_iter().map(|(name, slot)| format!("{name}/{slot}")).collect::<Vec<_>>()
    };
    assert_eq!(named(&["default", "side"]), ["side/sides"]);
    assert_eq!(named(&["default", "Bottom", "sides"]), ["Bottom/bottom"]);
    assert!(named(&["default", "side", "sides", "bottom"]).is_empty(), "all slots have materials");
    assert!(named(&["default", "paint_1", "gold", "silver", "silk"]).is_empty());
}

#[test]
fn unknown_scenes_suggest_the_nearest_shipped_name() {
    let message = open("defualt", &[]).unwrap_err().to_string();
    assert!(message.contains("did you mean `default`?"), "{message}");
    assert_eq!(open(".", &[]).unwrap_err().exit_code(), 2);
    let loaded = open("default", &[]).unwrap();
    assert_eq!(loaded.name, "default");
}

#[test]
fn a_loaded_scene_stores_its_folder_and_errors_name_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let scene = parse(TWO_COLOURS).unwrap();
    std::fs::write(&path, scene.to_toml().unwrap()).unwrap();
    let loaded = open(path.to_str().unwrap(), &[]).unwrap();
    assert_eq!((&loaded.scene, loaded.base_dir.as_path(), loaded.name.as_str()), (&scene, folder.path(), "a"));
    std::fs::write(&path, "[tile]\nx = 1").unwrap();
    assert!(load(&path, &[]).unwrap_err().to_string().contains("a.toml: line 2, tile.x"));
    std::fs::write(&path, [0xff, 0xfe, 0x00]).unwrap();
    assert!(load(&path, &[]).unwrap_err().to_string().contains("a.toml"));
}

#[test]
fn scenes_changed_in_memory_are_checked_against_the_same_ranges() {
    let mut scene = parse(TWO_COLOURS).unwrap();
    scene.validate().unwrap();
    scene.tile.geometry = Geometry::Grooves(Grooves { depth: f32::NAN, ..Grooves::default() });
    let message = scene.validate().unwrap_err().to_string();
    assert!(message.contains("tile.geometry.depth") && message.contains("nan"), "{message}");
}

#[test]
fn edits_change_the_first_numeric_parameter_by_five_percent() {
    let mut scene = parse(TWO_COLOURS).unwrap();
    assert_eq!(scene.nudge_geometry().as_deref(), Some("tile.geometry.depth"));
    let Geometry::Grooves(grooves) = &scene.tile.geometry else { panic!() };
    assert!((grooves.depth / Grooves::default().depth - 1.05).abs() < 1e-6);
    assert_eq!(scene.nudge_brdf().as_deref(), Some("material.default.brdf.roughness"));
    assert!(
        matches!(scene.materials[0].brdf.as_ref().unwrap().terms()[0], TermSpec::CookTorrance { roughness, .. } if (roughness - 0.21).abs() < 1e-6)
    );
    assert_eq!(scene.nudge_color().as_deref(), Some("material.default.color"));
    scene.validate().unwrap();
    let mut measured = set(TWO_COLOURS, &["material.default.brdf.path=x.binary"]).unwrap();
    assert_eq!(measured.nudge_brdf(), None);
    for kind in Geometry::kinds() {
        let mut scene = Scene::of(Geometry::with_defaults(kind.kind).unwrap());
        let before = scene.clone();
        assert_eq!(scene.nudge_geometry().is_some(), kind.kind != "mesh", "{}", kind.kind);
        assert_eq!(scene == before, kind.kind == "mesh");
    }
}

#[test]
fn every_number_of_the_catalogue_has_a_default_in_its_range_and_a_doc() {
    for kind in Geometry::kinds().into_iter().chain(TermSpec::kinds()) {
        for field in kind.fields {
            assert!(!field.doc.is_empty() && !field.label().is_empty(), "{}.{}", kind.kind, field.key);
            match (field.shape, field.default) {
                (FieldShape::Number { min, max, soft_max }, default) => {
                    assert!(min < soft_max && soft_max <= max, "{}.{}", kind.kind, field.key);
                    assert!(
                        default.is_none_or(|value| (min..=soft_max).contains(&value)),
                        "{}.{}",
                        kind.kind,
                        field.key
                    );
                }
                (FieldShape::Integer { min, max }, Some(value)) => {
                    assert!((min as f64..=max as f64).contains(&value))
                }
                _ => {}
            }
        }
    }
}

#[test]
fn the_catalogue_lists_exactly_the_keys_that_serde_takes() {
    for kind in Geometry::kinds() {
        let geometry = Geometry::with_defaults(kind.kind).unwrap();
        assert_eq!(geometry.kind(), kind.kind);
        let table = Table::try_from(&geometry).unwrap();
        assert!(table.keys().all(|key| key == "kind" || kind.fields.iter().any(|field| field.key == key)));
    }
    for kind in TermSpec::kinds() {
        let mut table = Table::from_iter([("kind".to_owned(), Value::String(kind.kind.to_owned()))]);
        for field in kind.fields.iter().filter(|field| field.required) {
            table.insert(field.key.to_owned(), Value::String("file".to_owned()));
        }
        let term: TermSpec = table.try_into().unwrap();
        let written = Table::try_from(&term).unwrap();
        assert_eq!(written.len(), kind.fields.len() + 1);
        for field in &kind.fields {
            let value = written[field.key].as_float().map(|value| value as f32);
            assert_eq!(value, field.default.map(|value| value as f32), "{}.{}", kind.kind, field.key);
        }
    }
}

/// A strategy for values that the catalogue allows, with the ends of ranges.
pub(crate) fn value_of(shape: FieldShape) -> BoxedStrategy<Value> {
    let number = |min: f64, max: f64| {
        let inside = (0.0..=1.0).prop_map(move |t| (min + t * (max - min)) as f32);
        let inside = inside.prop_map(move |x| f64::from(x.clamp(min as f32, max as f32)));
        prop_oneof![1 => Just(f64::from(min as f32)), 1 => Just(f64::from(max as f32)), 6 => inside]
    };
    match shape {
        FieldShape::Number { min, soft_max, .. } => number(min, soft_max).prop_map(Value::Float).boxed(),
        FieldShape::Integer { min, max } => (min..=max.min(min.saturating_add(64))).prop_map(Value::Integer).boxed(),
        FieldShape::Color { max } => proptest::collection::vec(number(0.0, max.min(2.0)).prop_map(Value::Float), 3)
            .prop_map(Value::Array)
            .boxed(),
        FieldShape::Vector { length, min, max } => {
            proptest::collection::vec(number(min.max(0.1), max.min(4.0)).prop_map(Value::Float), length)
                .prop_map(Value::Array)
                .boxed()
        }
        FieldShape::Choice(names) => {
            proptest::sample::select(names).prop_map(|name| Value::String(name.to_owned())).boxed()
        }
        FieldShape::Bool => any::<bool>().prop_map(Value::Boolean).boxed(),
        FieldShape::Stops { .. } => {
            let stop = (number(-3.0, 3.0), number(0.0, 1.0)).prop_map(|(value, grey)| (value, grey));
            let sorted = |mut stops: Vec<(f64, f64)>| {
                stops.sort_by(|a, b| a.0.total_cmp(&b.0));
                let entry = |(value, grey)| Value::Array(vec![Value::Float(value), Value::Float(grey)]);
                Value::Array(stops.into_iter().map(entry).collect())
            };
            proptest::collection::vec(stop, 1..5).prop_map(sorted).boxed()
        }
        FieldShape::Text | FieldShape::Path => "[a-z ./\\\\\"é]{1,9}".prop_map(Value::String).boxed(),
        FieldShape::AnyOf(shapes) => value_of(shapes[0]),
        FieldShape::Table(fields) => table_of(fields()).prop_map(Value::Table).boxed(),
        FieldShape::Tagged(kinds) => proptest::sample::select(kinds())
            .prop_flat_map(|kind| {
                let tag = Value::String(kind.kind.to_owned());
                table_of(kind.fields).prop_map(move |mut table| {
                    table.insert("kind".to_owned(), tag.clone());
                    Value::Table(table)
                })
            })
            .boxed(),
        FieldShape::List { of, min, max } => {
            proptest::collection::vec(value_of(*of), min..=max.min(min + 3)).prop_map(Value::Array).boxed()
        }
    }
}

fn table_of(fields: Vec<Field>) -> BoxedStrategy<Table> {
    let entries: Vec<_> = fields
        .into_iter()
        .map(|field| {
            let present = if field.required { Just(true).boxed() } else { any::<bool>().boxed() };
            (present, value_of(field.shape))
                .prop_map(move |(present, value)| present.then(|| (field.key.to_owned(), value)))
        })
        .collect();
    entries.prop_map(|entries| entries.into_iter().flatten().collect()).boxed()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn scenes_go_through_toml_and_back_exactly(table in table_of(Scene::fields())) {
        prop_assert_eq!(check_table(&table, &Scene::fields(), &mut Vec::<PathStep>::new()), Ok(()));
        let scene: Scene = table.try_into().map_err(|error: toml::de::Error| TestCaseError::fail(error.to_string()))?;
        let text = scene.to_toml().map_err(|error| TestCaseError::fail(error.to_string()))?;
        let back: Scene = toml::from_str(&text).map_err(|error| TestCaseError::fail(format!("{error}\n{text}")))?;
        prop_assert_eq!(&back, &scene);
        // A broken relation between fields is an error, not a panic.
        let _ = parse(&text);
    }

    #[test]
    fn no_text_and_no_override_makes_the_loader_panic(text in ".{0,60}", key in "[a-z.0-9*]{0,20}", value in ".{0,12}") {
        let _ = parse(&text);
        let _ = load_with_overrides(TWO_COLOURS, &[format!("{key}={value}")]);
        let _ = load_with_overrides(TWO_COLOURS, &[text]);
    }
}

/// A scene with one colour map layer of these keys.
fn color_map_scene(geometry: &str, map: &str, layer: &str) -> String {
    format!("[tile]\ngeometry = {{ kind = \"{geometry}\" }}\n[color_map]\n{map}\n[[color_map.layer]]\n{layer}\n")
}

#[test]
fn errors_of_colour_maps_name_the_key_what_was_found_and_what_was_expected() {
    let stops = "stops = [[0, 0], [1, [1, 1, 1]]]";
    let height = format!("driver = {{ kind = \"height\" }}\n{stops}");
    let noise = |keys: &str| format!("driver = {{ kind = \"noise\", {keys} }}\n{stops}");
    let sum = |terms: &str| format!("driver = {{ kind = \"sum\", terms = [{terms}] }}\n{stops}");
    let of_stops = |stops: &str| format!("driver = {{ kind = \"height\" }}\nstops = {stops}");
    let surface = |covariance: &str| format!("surface = {{ slope_covariance = {covariance} }}");
    let cases = [
        ("pyramids", "", of_stops("[[1, 0], [0, 1]]"), "layer.0.stops.1: found the value 0 after 1"),
        ("pyramids", "", of_stops("[[nan, 0]]"), "stops.0: found nan"),
        ("pyramids", "", of_stops("[[0, [1, -1, 0]]]"), "stops.0.1: found -1"),
        ("pyramids", "", of_stops("[[0, [1, 1]]]"), "expected a number or a triple"),
        ("pyramids", "", of_stops("[]"), "found 0 stops"),
        ("pyramids", "", of_stops("[[0]]"), "expected a stop [value, [r, g, b]]"),
        ("pyramids", "", format!("driver = {{ kind = \"heigth\" }}\n{stops}"), "did you mean `height`?"),
        ("pyramids", "", format!("driver = {{ kind = \"height\", nois = 1 }}\n{stops}"), "did you mean `noise`?"),
        ("pyramids", "", format!("{height}\ncolour = 1"), "unknown key `colour`"),
        ("pyramids", "combin = \"sum\"", height.clone(), "did you mean `combine`?"),
        ("pyramids", "taps = 5", height.clone(), "taps: found 5, expected 1, 4 or 16"),
        ("flat", "", height.clone(), "found `height` on a flat tile, expected a tile with relief"),
        ("pyramids", &surface("[0.1, 0.2, 0.1]"), height.clone(), "positive semi-definite"),
        ("pyramids", &surface("[-0.1, 0, 0.1]"), height.clone(), "positive semi-definite"),
        ("pyramids", "", noise("cells = 100, octaves = 3"), "at most 128 cells in the finest octave"),
        ("pyramids", "", format!("driver = {{ kind = \"texture\" }}\n{stops}"), "driver.path: found nothing"),
        ("pyramids", "", sum(""), "found 0 entries"),
        ("pyramids", "", sum("{ driver = { kind = \"steepness\" }, weight = 1 }"), "unknown kind \"steepness\""),
        (
            "pyramids",
            "combine = \"product\"",
            format!("{height}\n[[color_map.layer]]\n{}", sum("{ driver = { kind = \"height\" }, weight = 1 }")),
            "which depend on each other",
        ),
    ];
    for (geometry, map, layer, part) in cases {
        let error = parse(&color_map_scene(geometry, map, &layer)).unwrap_err();
        assert!(error.to_string().contains(part), "{layer}\n{map}\n{error}, not {part}");
        assert_eq!(error.exit_code(), 2);
    }
    let none = parse("[tile]\ngeometry = { kind = \"flat\" }\n[color_map]\ntaps = 4\n").unwrap_err();
    assert!(none.to_string().contains("no layers"), "{none}");
}

#[test]
fn a_colour_map_with_every_key_is_read_and_written_back_and_an_analytic_surface_needs_no_relief() {
    let layer = "name = \"snow\"\ndriver = { kind = \"height\", noise = 0.1 }\nunit = \"value\"\nstops = [[-1.2, 0.5], [-1.2, [0, 1, 0]]]\n\
        weight = { driver = { kind = \"slope\", azimuth_deg = 30 }, stops = [[0, 0], [1, 1]] }";
    let map = "combine = \"sum\"\ndistribution = \"smith\"\ngaussianize = \"on\"\ntaps = 16\ntable = \"table\"\n\
        surface = { height = 0.2, slope_mean = [0.1, 0], slope_covariance = [0.1, 0.02, 0.2] }";
    let scene = parse(&color_map_scene("flat", map, layer)).unwrap();
    assert_eq!(parse(&scene.to_toml().unwrap()).unwrap(), scene);
    let map = scene.color_map.unwrap();
    assert_eq!((map.layer[0].stops.len(), map.taps, map.layer[0].factor()), (2, 16, 1.0));
}
