//! Documents without a window: history, saving, recovery.

use std::path::Path;

use crate::scene::{Geometry, Pixels};
use glam::{UVec2, Vec2, Vec3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::quick;
use crate::app::document::{Document, EditorSettings, RecoveredDocument, RecoveryFile};
use crate::app::paint::{Brush, Stroke, Tool, heights_of};

/// Paints a stroke with a tool.
fn stroke(document: &mut Document, tool: Tool) {
    if document.painted().heights.is_none() {
        let heights = heights_of(&document.loaded()).unwrap();
        document.paint_heights("Begin to paint", heights, None);
    }
    let mut stroke = Stroke::begin(document.painted());
    let brush = Brush { tool, radius: 0.1, ..Brush::default() };
    for k in 0..10 {
        stroke.move_to(&brush, Vec2::splat(0.2 + 0.05 * k as f32), 1.0);
        document.show_stroke(stroke.images());
    }
    document.end_stroke("Paint", &stroke.before);
}

#[test]
fn undo_to_the_start_and_redo_to_the_end_give_the_same_scenes() {
    let mut document = quick();
    let mut states = vec![(document.scene().clone(), document.painted().clone())];
    for kind in ["pyramids", "rods", "weave", "flat", "grooves"] {
        let mut scene = (**document.scene()).clone();
        scene.tile.geometry = Geometry::with_defaults(kind).unwrap();
        document.edit(scene);
        document.rest();
        states.push((document.scene().clone(), document.painted().clone()));
    }
    stroke(&mut document, Tool::Raise);
    stroke(&mut document, Tool::Noise);
    document.paint_colors("Colours", Some(Pixels { size: UVec2::splat(4), values: vec![Vec3::X; 16] }));
    let end = (document.scene().clone(), document.painted().clone());
    let mut steps = 0;
    while document.undo().is_some() {
        steps += 1;
    }
    assert_eq!((document.scene(), document.painted()), (&states[0].0, &states[0].1));
    assert!(!document.is_dirty());
    for _ in 0..steps {
        document.redo().unwrap();
    }
    assert_eq!((document.scene(), document.painted()), (&end.0, &end.1));
    assert!(document.redo().is_none() && document.is_dirty());
}

#[test]
fn edits_of_one_control_are_one_entry_until_the_pointer_is_released() {
    let mut document = quick();
    for depth in [0.3, 0.4, 0.5] {
        let mut scene = (**document.scene()).clone();
        if let Geometry::Grooves(grooves) = &mut scene.tile.geometry {
            grooves.depth = depth;
        }
        document.edit(scene);
    }
    assert_eq!((document.history().len(), document.undo_name()), (1, Some("Depth")));
    document.rest();
    let mut scene = (**document.scene()).clone();
    scene.materials[0].color = Vec3::X;
    document.edit(scene);
    assert_eq!((document.history().len(), document.undo_name()), (2, Some("Color of \"default\"")));
    document.undo();
    document.undo();
    assert_eq!(**document.scene(), **quick().scene());
}

#[test]
fn history_drops_the_oldest_entries_and_stays_within_its_memory() {
    let mut document = quick();
    let noise = |seed: usize| (0..512 * 512).map(|k| ((k * 31 + seed) % 97) as f32 / 97.0).collect();
    for seed in 0..100 {
        document.paint_heights("Noise", Pixels { size: UVec2::splat(512), values: noise(seed) }, None);
    }
    assert!(document.history().bytes() <= 64 << 20);
    assert!((20..100).contains(&document.history().len()), "{}", document.history().len());
    while document.undo().is_some() {}
    assert!(document.is_dirty(), "the first state was dropped");
}

#[test]
fn a_saved_and_reopened_document_is_equal_with_its_painted_images() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("relief.toml");
    let mut document = quick();
    stroke(&mut document, Tool::Raise);
    document
        .paint_colors("Colours", Some(Pixels { size: UVec2::new(3, 2), values: vec![Vec3::new(0.1, 0.7, 1.0); 6] }));
    document.save_as(&path).unwrap();
    assert!(!document.is_dirty() && !document.changed_on_disk());
    assert!(folder.path().join("relief_heights.exr").is_file());
    let version = document.version();
    document.save_as(&path).unwrap();
    assert_eq!(document.version(), version, "the same scene keeps its image and its measurements");
    let opened = Document::open(path.to_str().unwrap()).unwrap();
    assert_eq!(opened.scene(), document.scene());
    let mesh = |document: &Document| {
        let loaded = document.loaded();
        crate::geometry::build_painted(&loaded.scene.tile, &loaded.base_dir, &loaded.painted).unwrap()
    };
    let (ours, theirs) = (mesh(&document), mesh(&opened));
    assert_eq!(ours.positions, theirs.positions);
    assert_eq!(
        ours.color.at(Vec3::splat(0.5), Vec3::Z, ours.size),
        theirs.color.at(Vec3::splat(0.5), Vec3::Z, theirs.size)
    );
    std::fs::write(&path, "# someone else\n").unwrap();
    assert!(document.changed_on_disk());
}

#[test]
fn files_of_a_scene_are_found_after_it_is_saved_in_another_folder() {
    let (old, new) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    std::fs::write(old.path().join("tile.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    std::fs::write(old.path().join("a.toml"), "[tile]\ngeometry = { kind = \"mesh\", path = \"tile.obj\" }\n").unwrap();
    let mut document = Document::open(old.path().join("a.toml").to_str().unwrap()).unwrap();
    document.save_as(&new.path().join("b.toml")).unwrap();
    let opened = Document::open(new.path().join("b.toml").to_str().unwrap()).unwrap();
    let loaded = opened.loaded();
    crate::geometry::build(&loaded.scene.tile, &loaded.base_dir).unwrap();
    for name in ["behind.png", "values.png"] {
        image::GrayImage::new(2, 2).save(old.path().join(name)).unwrap();
    }
    let text = "[tile]\ngeometry = { kind = \"flat\" }\n[slab]\nbottom = { kind = \"tile\", scene = \"a.toml\" }\n\
                [background]\nkind = \"image\"\npath = \"behind.png\"\n[[color_map.layer]]\n\
                driver = { kind = \"texture\", path = \"values.png\" }\nstops = [[0.0, 0.0], [1.0, 1.0]]\n";
    std::fs::write(old.path().join("slab.toml"), text).unwrap();
    let mut document = Document::open(old.path().join("slab.toml").to_str().unwrap()).unwrap();
    document.save_as(&new.path().join("slab.toml")).unwrap();
    let files = Document::open(new.path().join("slab.toml").to_str().unwrap()).unwrap().loaded().files();
    assert!(files.len() == 3 && files.iter().all(|file| file.exists()), "{files:?}");
}

#[test]
fn choosing_another_image_drops_the_painted_one_and_undo_restores_it() {
    let mut document = quick();
    stroke(&mut document, Tool::Raise);
    let painted = document.painted().clone();
    let mut scene = (**document.scene()).clone();
    if let Geometry::Heightfield(field) = &mut scene.tile.geometry {
        field.path = Some("asset:ripples.png".into());
    }
    document.edit(scene);
    assert!(document.painted().heights.is_none());
    document.undo();
    assert_eq!(*document.painted(), painted);
}

#[test]
fn a_path_that_cannot_be_written_is_an_error_and_leaves_the_document_unchanged() {
    let mut document = quick();
    stroke(&mut document, Tool::Lower);
    let before = (document.scene().clone(), document.painted().clone());
    let error = document.save_as(Path::new("/nonexistent/folder/a.toml")).unwrap_err();
    assert!(error.to_string().contains("nonexistent"), "{error}");
    assert_eq!((document.scene(), document.painted()), (&before.0, &before.1));
    assert!(document.is_dirty());
}

#[test]
fn a_recovery_file_of_a_crash_is_found_and_restored_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = quick();
    stroke(&mut document, Tool::Raise);
    let recovery = RecoveryFile::new(folder.path());
    recovery.prepare(&document).unwrap().write().unwrap();
    assert!(RecoveredDocument::find(folder.path()).is_empty(), "this process is running");
    // Renamed as if an ended process had written it.
    for file in std::fs::read_dir(folder.path()).unwrap().flatten() {
        let name = file.file_name().into_string().unwrap();
        let other = name.replace(&std::process::id().to_string(), "4194399");
        std::fs::rename(file.path(), folder.path().join(other)).unwrap();
    }
    let found = RecoveredDocument::find(folder.path());
    assert_eq!(found.len(), 1);
    let restored = found[0].restore().unwrap();
    assert_eq!((restored.scene(), restored.painted()), (document.scene(), document.painted()));
    assert!(restored.is_dirty());
    found[0].discard();
    assert!(RecoveredDocument::find(folder.path()).is_empty());
}

#[path = "../../../tests/program/fuzz/mutate.rs"]
mod mutate;

/// Restores mutated recovery files, and checks that each gives a valid scene or an error. Returns the counts of both.
fn mutated_recoveries(seed: u64, done: impl Fn(usize) -> bool) -> [usize; 2] {
    let folder = tempfile::tempdir().unwrap();
    let document = quick();
    // Removes its file when it is dropped.
    let recovery = RecoveryFile::new(folder.path());
    recovery.prepare(&document).unwrap().write().unwrap();
    let own_file = folder.path().join(format!("recovery-{}.toml", std::process::id()));
    let whole = std::fs::read(own_file).unwrap();
    let other = folder.path().join("recovery-4194399.toml");
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut counts = [0; 2];
    while !done(counts[0] + counts[1]) {
        std::fs::write(&other, mutate::mutated(&whole, &whole, true, &mut random)).unwrap();
        let restored = RecoveredDocument::find(folder.path()).first().map(RecoveredDocument::restore);
        let accepted = matches!(&restored, Some(Ok(_)));
        if let Some(Ok(document)) = restored {
            document.scene().validate().unwrap();
        }
        counts[usize::from(!accepted)] += 1;
    }
    counts
}

#[test]
fn mutated_recovery_files_are_restored_or_refused_never_a_panic() {
    let [accepted, refused] = mutated_recoveries(1, |count| count >= 300);
    assert!(accepted > 0 && refused > 0, "{accepted} {refused}");
}

#[test]
#[ignore = "half a minute; BISCALE_FUZZ_SECONDS=300 for five"]
fn mutated_recovery_files_for_as_long_as_asked() {
    let seconds = std::env::var("BISCALE_FUZZ_SECONDS").ok().and_then(|text| text.parse().ok()).unwrap_or(30.0);
    let start = std::time::Instant::now();
    let [accepted, refused] = mutated_recoveries(77, |_| start.elapsed().as_secs_f64() >= seconds);
    println!("recovery       {:>9} executions in {seconds:>4} s, {accepted:>8} accepted, no crash", accepted + refused);
}

#[test]
fn settings_are_stored_and_damaged_ones_give_the_defaults() {
    let folder = tempfile::tempdir().unwrap();
    let mut settings = EditorSettings { dark: false, zoom: 1.5, ..EditorSettings::default() };
    settings.add_recent(Path::new("/a.toml"));
    settings.add_recent(Path::new("/b.toml"));
    settings.add_recent(Path::new("/a.toml"));
    settings.save(Some(folder.path()));
    assert_eq!(EditorSettings::load(Some(folder.path())), settings);
    assert_eq!(settings.recent, [Path::new("/a.toml"), Path::new("/b.toml")]);
    std::fs::write(folder.path().join("editor.toml"), "zoom = \"huge\"").unwrap();
    assert_eq!(EditorSettings::load(Some(folder.path())), EditorSettings::default());
}
