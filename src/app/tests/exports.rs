//! Exports through their dialogs.

use crate::export::tile::TileOptions;
use eframe::egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use super::{editor, harness, quick, settle};
use crate::app::actions::Action;
use crate::app::dialogs::{Dialog, FileDialog, Purpose};
use crate::app::document::Document;
use crate::app::editor::Editor;
use crate::app::worker::{ExportKind, TableChoice};

#[test]
fn the_export_dialog_offers_formats_and_a_choice_changes_the_ending() {
    let mut harness = harness(quick());
    harness.key_press_modifiers(Modifiers::COMMAND, Key::E);
    harness.run_steps(3);
    harness.get_by_label("Format").click();
    harness.run_steps(2);
    let mitsuba = harness.get_all_by_label_contains("RGL tensor (.bsdf)").last().unwrap();
    mitsuba.click();
    harness.run_steps(2);
    let Some(Dialog::Files(files)) = &editor(&mut harness).dialog else { panic!("no dialog") };
    assert_eq!(files.typed, "quick.bsdf");
}

#[test]
fn an_export_uses_the_chosen_size_shows_its_progress_and_can_be_cancelled() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.bsdf");
    let mut harness = harness(quick());
    settle(&mut harness);
    editor(&mut harness).dialog = Some(Dialog::Table { path: path.clone(), choice: TableChoice::default() });
    harness.run_steps(3);
    harness.get_by_label_contains("Small: 9 x 24").click();
    harness.run_steps(2);
    harness.get_by_label("Export").click();
    harness.run_steps(2);
    assert!(editor(&mut harness).exporting.is_some() && harness.query_by_label("Cancel").is_some());
    harness.get_by_label("Cancel").click();
    harness.run_steps(2);
    assert!(editor(&mut harness).exporting.is_none());
    let mut choice = TableChoice { theta: 2, phi: 4, ..TableChoice::default() };
    choice.rgl = Some([3, 4, 4, 4]);
    editor(&mut harness).export(path.clone(), ExportKind::Table(choice));
    let start = std::time::Instant::now();
    while !path.exists() {
        harness.step();
        assert!(start.elapsed().as_secs() < 60, "{:?}", editor(&mut harness).messages.texts());
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    // Three elevations and five azimuths (the first repeated) of 4 x 4 samples are far below the small size.
    assert!(std::fs::metadata(&path).unwrap().len() < 20_000);
}

#[test]
fn a_large_solid_is_cancelled_while_it_is_computed_and_the_next_export_runs() {
    let folder = tempfile::tempdir().unwrap();
    let [large, small] = ["large.stl", "small.obj"].map(|name| folder.path().join(name));
    std::fs::write(&large, "old").unwrap();
    let mut harness = harness(quick());
    settle(&mut harness);
    let options = TileOptions { samples: glam::UVec2::splat(2048), ..TileOptions::default() };
    editor(&mut harness).export(large.clone(), ExportKind::Tile(options));
    let start = std::time::Instant::now();
    while editor(&mut harness).exporting.is_none_or(|(part, _)| part == 0.0) {
        harness.step();
        assert!(start.elapsed().as_secs() < 60, "no progress");
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    harness.get_by_label("Cancel").click();
    harness.run_steps(2);
    assert!(editor(&mut harness).exporting.is_none());
    editor(&mut harness).export(small, ExportKind::Tile(TileOptions::default()));
    while editor(&mut harness).exporting.is_some() {
        harness.step();
        assert!(start.elapsed().as_secs() < 60, "not exported");
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    // Exports run one after the other, so the first has ended, too.
    assert!(editor(&mut harness).messages.texts().join("; ").contains("small.obj"));
    assert_eq!(std::fs::read(&large).unwrap(), b"old");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "no partial file remains");
}

/// Runs the interface until the export has ended, and returns all messages.
fn messages_after_export(harness: &mut Harness<'static, Option<Editor>>) -> String {
    let start = std::time::Instant::now();
    harness.run_steps(2);
    while editor(harness).exporting.is_some() {
        harness.step();
        assert!(start.elapsed().as_secs() < 60, "{:?}", editor(harness).messages.texts());
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    editor(harness).messages.texts().join("; ")
}

#[test]
fn every_format_of_the_tile_and_of_fits_is_exported_from_its_dialog() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = harness(quick());
    settle(&mut harness);
    let ctx = harness.ctx.clone();
    for ending in ["obj", "stl", "png", "svg", "pdf", "gltf", "mtlx"] {
        let path = folder.path().join(format!("a.{ending}"));
        let purpose = if ending.len() > 3 { Purpose::ExportTable } else { Purpose::ExportTile };
        editor(&mut harness).use_file(&ctx, purpose, path.clone());
        harness.run_steps(2);
        harness.get_by_label("Export").click();
        let texts = messages_after_export(&mut harness);
        assert!(texts.contains("Wrote") && std::fs::metadata(&path).unwrap().len() > 100, "{ending}: {texts}");
    }
}

#[test]
fn the_material_and_the_image_of_a_slab_are_exported_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("pane.toml");
    let slab = "[slab]\neta = 1.5\n[slab.top]\nkind = \"smooth\"\n[slab.bottom]\nkind = \"ggx\"\nroughness = 0.1\n";
    let text = format!("[tile]\ngeometry = {{ kind = \"flat\" }}\n{slab}[quality]\npreset = \"draft\"\n");
    std::fs::write(&scene, text).unwrap();
    let mut harness = harness(Document::open(&scene.to_string_lossy()).unwrap());
    let ctx = harness.ctx.clone();
    editor(&mut harness).execute(&ctx, Action::ExportTable);
    let Some(Dialog::Files(files)) = &editor(&mut harness).dialog else { panic!("no dialog") };
    assert_eq!(files.purpose, Purpose::ExportSlab);
    editor(&mut harness).dialog = None;
    for name in ["a.npz", "a.xml", "a_mitsuba.xml", "a.gltf", "a.mtlx", "a.png"] {
        let path = folder.path().join(name);
        let purpose = if name == "a.png" { Purpose::ExportImage } else { Purpose::ExportSlab };
        editor(&mut harness).use_file(&ctx, purpose, path.clone());
        match &mut editor(&mut harness).dialog {
            Some(Dialog::Table { choice, .. }) => *choice = TableChoice { theta: 3, phi: 4, ..*choice },
            Some(Dialog::Image { width, height, .. }) => (*width, *height) = (32, 32),
            _ => {}
        }
        harness.run_steps(2);
        harness.get_by_label("Export").click();
        let texts = messages_after_export(&mut harness);
        assert!(texts.contains(name) && std::fs::metadata(&path).unwrap().len() > 100, "{name}: {texts}");
    }
    editor(&mut harness).use_file(&ctx, Purpose::ExportSlab, folder.path().join("a.csv"));
    let texts = editor(&mut harness).messages.texts().join("; ");
    assert!(texts.contains("a name that ends in .npz"), "{texts}");
}

#[test]
fn a_scene_is_saved_under_its_own_ending_and_in_a_folder_that_exists() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = harness(quick());
    editor(&mut harness).dialog = Some(Dialog::Files(FileDialog::new(Purpose::SaveScene, folder.path(), "")));
    harness.run_steps(3);
    let missing = folder.path().join("missing");
    let complaints = [
        ("relief.png", Some("Found relief.png, expected a name that ends in .toml.".to_owned())),
        ("missing/relief.toml", Some(format!("{}: the folder does not exist.", missing.display()))),
        ("relief", None),
    ];
    for (name, complaint) in complaints {
        if let Some(Dialog::Files(files)) = &mut editor(&mut harness).dialog {
            files.typed = name.to_owned();
        }
        harness.get_by_label("Save").click();
        harness.run_steps(3);
        assert_eq!(folder.path().join("relief.toml").exists(), complaint.is_none());
        assert!(complaint.is_none_or(|text| harness.query_by_label(&text).is_some()), "{name}");
    }
    assert!(!folder.path().join("relief.png").exists());
}

#[test]
fn a_table_that_is_too_large_is_refused_before_any_work() {
    let mut harness = harness(quick());
    let choice = TableChoice { theta: 180, phi: 720, ..TableChoice::default() };
    editor(&mut harness).dialog = Some(Dialog::Table { path: "large.npz".into(), choice });
    harness.run_steps(3);
    assert!(harness.query_by_label_contains("at most").is_some());
    harness.key_press(Key::Enter);
    harness.run_steps(2);
    assert!(editor(&mut harness).dialog.is_some() && editor(&mut harness).exporting.is_none());
}

#[test]
fn an_export_does_not_replace_the_scene_or_a_file_that_it_names() {
    let folder = tempfile::tempdir().unwrap();
    let [scene, heights] = ["scene.toml", "heights.png"].map(|name| folder.path().join(name));
    let text = "[tile]\ngeometry = { kind = \"heightfield\", path = \"heights.png\" }\n[quality]\npreset = \"draft\"\n";
    std::fs::write(&scene, text).unwrap();
    image::GrayImage::from_fn(4, 4, |x, _| image::Luma([x as u8 * 60])).save(&heights).unwrap();
    let before = std::fs::read(&heights).unwrap();
    let mut harness = harness(Document::new(crate::scene::open(&scene.to_string_lossy(), &[]).unwrap(), Some(scene)));
    settle(&mut harness);
    editor(&mut harness).export(heights.clone(), ExportKind::Image { size: [16, 16] });
    let start = std::time::Instant::now();
    while editor(&mut harness).exporting.is_some() {
        harness.step();
        assert!(start.elapsed().as_secs() < 60, "not ended");
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    let texts = editor(&mut harness).messages.texts().join("; ");
    assert!(texts.contains("Not exported") && texts.contains("heights.png"), "{texts}");
    assert_eq!(std::fs::read(&heights).unwrap(), before);
}
