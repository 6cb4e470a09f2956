//! Filtered colour maps from outside: every header, method and output, and errors for bad queries.

use super::folder::{CommandLine, rows};

const MAPPED: &str = "[tile]\ngeometry = { kind = \"pyramids\", height = 0.1 }\n[quality]\npreset = \"draft\"\n[color_map]\n\
    [[color_map.layer]]\nname = \"snow\"\ndriver = { kind = \"height\" }\nstops = [[-1, [0.2, 0.1, 0.1]], [1, [0.9, 0.9, 1]]]\nweight = 0.4\n\
    [[color_map.layer]]\nname = \"sides\"\ndriver = { kind = \"slope\" }\nstops = [[0, 0], [0, 0.5]]\nweight = 0.3\n\
    [[color_map.layer]]\nname = \"spots\"\ndriver = { kind = \"noise\", cells = 4 }\nstops = [[-0.5, 0.1], [0.5, 0.8]]\nweight = 0.3\n";

const QUERIES: [(&str, &str, &str, &str); 5] = [
    ("mean,deviation", "snow", "0.2,0.5\n-1,0\n3,1e6\n", "mean,deviation,r,g,b"),
    ("a", "snow", "0\n0.5\n1e7\n", "a,mean,deviation,r,g,b"),
    ("theta_o,phi_o", "sides", "0,0\n1.2,3\n1.5707963,0\n", "theta_o,phi_o,mean_x,mean_y,cov_xx,cov_xy,cov_yy,r,g,b"),
    (
        "theta_i,phi_i,theta_o,phi_o",
        "",
        "0.3,0,0.6,1\n1.4,0,1.4,0\n",
        "theta_i,phi_i,theta_o,phi_o,lambda_i,lambda_o,v_bar,r,g,b,f_r,f_g,f_b",
    ),
    (
        "u,v,width_u,width_v,angle",
        "spots",
        "0.1,0.2,0.05,0.4,0.5\n7,-3,1e6,1e-6,0\n0,0,0,0,0\n",
        "u,v,width_u,width_v,angle,mean,deviation,r,g,b",
    ),
];

#[test]
fn every_header_and_method_gives_finite_colours_between_those_of_the_stops() {
    let folder = CommandLine::new();
    folder.write("scene.toml", MAPPED);
    for (header, layer, lines, expected) in QUERIES {
        folder.write("q.csv", format!("{header}\n{lines}"));
        for method in ["filtered", "naive", "truth"] {
            let mut arguments =
                vec!["filter", "scene.toml", "--queries", "q.csv", "-o", "-", "--method", method, "--quiet"];
            if !layer.is_empty() {
                arguments.extend(["--layer", layer]);
            }
            let text = folder.text(&arguments);
            let found = text.lines().next().unwrap();
            let errors = if method == "truth" && header.starts_with('u') { ",se_r,se_g,se_b" } else { "" };
            assert_eq!(found, format!("{expected}{errors}"), "{method}");
            let at = found.split(',').position(|name| name == "r").unwrap();
            for row in rows(&text) {
                assert!(row[at..at + 3].iter().all(|value| (0.0..=1.0).contains(value)), "{method}: {row:?}");
            }
        }
    }
}

#[test]
fn the_core_values_of_filter_are_those_of_eval() {
    let folder = CommandLine::new();
    folder.write("scene.toml", MAPPED);
    folder.write("q.csv", "theta_i,phi_i,theta_o,phi_o\n0.3,0,0.6,1\n1.2,0.5,1.1,2\n");
    let filtered = rows(&folder.text(&["filter", "scene.toml", "--queries", "q.csv", "-o", "-", "--quiet"]));
    let values = rows(&folder.text(&["eval", "scene.toml", "--pairs", "q.csv", "-o", "-", "--quiet"]));
    for (filtered, value) in filtered.iter().zip(&values) {
        assert_eq!(filtered[10..13], value[4..7]);
    }
}

#[test]
fn bad_queries_and_outputs_exit_with_2_name_what_was_expected_and_write_nothing() {
    let folder = CommandLine::new();
    folder.write("scene.toml", MAPPED);
    let cases = [
        ("mean,dev\n0,0\n", "--layer=snow", "one of the headers mean,deviation; a;"),
        ("", "--layer=snow", "found an empty file"),
        ("mean,deviation,mean\n0,1,2\n", "--layer=snow", "the column `mean` twice"),
        ("mean,deviation\n0,-1\n", "--layer=snow", "a number that is not negative"),
        ("a\n-0.1\n", "--layer=snow", "`-0.1` for a"),
        ("a\nnan\n", "--layer=snow", "`nan` for a"),
        ("mean,deviation\n0\n", "--layer=snow", "found 1 values, expected 2 values"),
        ("mean,deviation\n0,1\n", "--layer=sno", "found `sno`"),
        ("mean,deviation\n0,1\n", "--quiet", "found 3 layers of any driver"),
        ("theta_o,phi_o\n0,1\n", "--layer=snow", "a layer of slope or steepness"),
        ("u,v,width_u,width_v,angle\n0,0,1,1,0\n", "--layer=sides", "a layer of texture or noise"),
    ];
    for (queries, option, part) in cases {
        folder.write("q.csv", queries);
        folder.assert_refused(&["filter", "scene.toml", "--queries", "q.csv", "-o", "out.csv", option], &[part]);
    }
    folder.assert_refused(&["filter", "scene.toml", "--table", "t.txt", "--layer", "snow"], &[".exr or .npz"]);
    assert_eq!(folder.files(), ["q.csv", "scene.toml"]);
}

#[test]
fn textures_that_are_missing_or_unreadable_are_named_and_nothing_is_written() {
    let folder = CommandLine::new();
    folder.write("broken.png", b"not an image");
    folder.write("q.csv", "mean,deviation\n0,1\n");
    for (path, part) in [("missing.png", "missing.png"), ("broken.png", "broken.png")] {
        folder.write(
            "scene.toml",
            format!(
                "[tile]\ngeometry = {{ kind = \"flat\" }}\n[color_map]\n[[color_map.layer]]\n\
                 driver = {{ kind = \"texture\", path = \"{path}\" }}\nstops = [[0, 0], [1, 1]]\n"
            ),
        );
        folder.assert_refused(&["filter", "scene.toml", "--queries", "q.csv", "-o", "out.csv"], &[part]);
    }
    assert_eq!(folder.files(), ["broken.png", "q.csv", "scene.toml"]);
}

#[test]
fn tables_and_comparisons_are_written_and_state_their_errors() {
    let folder = CommandLine::new();
    folder.write("scene.toml", MAPPED);
    for name in ["t.npz", "t.exr"] {
        let report = folder.json(&["filter", "scene.toml", "--table", name, "--layer", "snow", "--json"]);
        assert!(report["table"]["rms"].as_f64().unwrap() < 0.002, "{report}");
    }
    let report = folder.json(&["filter", "scene.toml", "--side-by-side", "s.png", "--layer", "spots", "--json"]);
    let rms = |k: usize| report["side_by_side"][k]["rms"].as_f64().unwrap();
    assert!(rms(2) < 0.5 * rms(0) && rms(1) == 0.0, "{report}");
    assert_eq!(folder.files(), ["s.png", "scene.toml", "t.exr", "t.npz"]);
}

#[test]
fn a_texture_with_a_texel_that_is_no_number_is_refused_with_the_file_and_the_texel() {
    let folder = CommandLine::new();
    let value = |x: usize, y: usize| if (x, y) == (2, 1) { f32::NAN } else { 0.5 };
    exr::prelude::write_rgb_file(folder.path("holes.exr"), 4, 3, |x, y| (value(x, y), 0.5, 0.5)).unwrap();
    folder.write("q.csv", "u,v,width_u,width_v,angle\n0,0,0.1,0.1,0\n");
    folder.write(
        "scene.toml",
        "[tile]\ngeometry = { kind = \"flat\" }\n[color_map]\n[[color_map.layer]]\n\
         driver = { kind = \"texture\", path = \"holes.exr\" }\nstops = [[0, 0], [1, 1]]\n",
    );
    for arguments in
        [vec!["filter", "scene.toml", "--queries", "q.csv", "-o", "out"], vec!["render", "scene.toml", "-o", "out.png"]]
    {
        folder.assert_refused(&arguments, &["holes.exr", "NaN", "pixel"]);
    }
    assert_eq!(folder.files(), ["holes.exr", "q.csv", "scene.toml"]);
}
