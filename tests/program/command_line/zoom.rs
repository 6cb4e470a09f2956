//! Zooms from outside: frames, the table of means, and errors for scenes and numbers that cannot be zoomed.

use super::folder::{CommandLine, rows};

const MAPPED: &str = "[tile]\ngeometry = { kind = \"heightfield\", path = \"asset:hammered.png\", height_scale = 0.1 }\n\
    [quality]\npreset = \"draft\"\n[color_map]\n[[color_map.layer]]\ndriver = { kind = \"height\" }\n\
    stops = [[-0.5, [0.6, 0.3, 0.1]], [-0.5, [0.1, 0.1, 0.6]], [1, [0.95, 0.95, 0.9]]]\n\
    [object]\nkind = \"sphere\"\n[light]\ncount = 2\n";

#[test]
fn a_zoom_writes_frames_and_a_table_of_means_that_change_slowly() {
    let folder = CommandLine::new();
    folder.write("scene.toml", MAPPED);
    let zoom = ["render", "scene.toml", "--zoom", "0.25:32:8", "-o", "zoom", "--size", "40x40", "--quiet"];
    folder.text(&zoom);
    let table = std::fs::read_to_string(folder.path("zoom/zoom.csv")).unwrap();
    assert_eq!(table.lines().next(), Some("pixels_per_tile,r,g,b,change"));
    let rows = rows(&table);
    assert_eq!(rows.len(), 8);
    for (k, row) in rows.iter().enumerate() {
        assert!((row[0] / (0.25 * 2_f64.powi(k as i32)) - 1.0).abs() < 1e-6, "{row:?}");
        let first = &rows[0];
        for channel in 1..4 {
            assert!((row[channel] / first[channel] - 1.0).abs() < 0.12, "{row:?} {first:?}");
        }
        assert!(folder.path(&format!("zoom/{k:04}.png")).exists());
    }
    // The same zoom has the same bytes.
    let first = std::fs::read(folder.path("zoom/0007.png")).unwrap();
    folder.text(&zoom);
    assert_eq!(std::fs::read(folder.path("zoom/0007.png")).unwrap(), first);
}

#[test]
fn a_zoom_shows_tiles_with_overhangs_and_analytic_surfaces() {
    let folder = CommandLine::new();
    let map = |tile: &str| {
        format!(
            "[tile]\ngeometry = {{ kind = \"{tile}\" }}\n[quality]\npreset = \"draft\"\n[light]\ncount = 2\n[color_map]\n\
             [[color_map.layer]]\ndriver = {{ kind = \"height\" }}\nstops = [[0, 0.2], [1, 1]]\n"
        )
    };
    let surface = "[color_map.surface]\nheight = 0.1\nslope_covariance = [0.12, 0.0, 0.12]\n";
    folder.write("weave.toml", map("weave"));
    folder.write("surface.toml", format!("{}{surface}", map("flat")));
    for name in ["weave", "surface"] {
        let scene = format!("{name}.toml");
        folder.text(&["render", &scene, "--zoom", "1:16:3", "-o", name, "--size", "24x24", "--quiet"]);
        let rows = rows(&std::fs::read_to_string(folder.path(&format!("{name}/zoom.csv"))).unwrap());
        assert_eq!(rows.len(), 3);
        for row in &rows {
            assert!(row[1] > 0.0 && (row[1] / rows[0][1] - 1.0).abs() < 0.12, "{name}: {row:?}");
        }
    }
}

#[test]
fn zooms_that_are_impossible_exit_with_2_and_write_nothing() {
    let folder = CommandLine::new();
    folder.write("scene.toml", MAPPED);
    folder.write("plain.toml", "[tile]\ngeometry = { kind = \"pyramids\" }\n");
    let cases = [
        ("plain.toml", "1:2:3", "color_map"),
        ("scene.toml", "1:2", "FROM:TO:FRAMES"),
        ("scene.toml", "0:2:3", "FROM:TO:FRAMES"),
        ("scene.toml", "1:nan:3", "FROM:TO:FRAMES"),
        ("scene.toml", "1:2:0", "FROM:TO:FRAMES"),
        ("scene.toml", "1:1000000:3", "pixels per tile"),
        ("scene.toml", "1e-9:1:3", "pixels per tile"),
    ];
    for (scene, zoom, part) in cases {
        let zoom = format!("--zoom={zoom}");
        folder.assert_refused(&["render", scene, &zoom, "-o", "out", "--size", "40x40"], &[part]);
    }
    assert_eq!(folder.files(), ["plain.toml", "scene.toml"]);
}
