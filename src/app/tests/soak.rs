//! Many random edits: no crash, no growth of memory, and the same picture as from nothing; and two editors at once.

use std::path::Path;
use std::time::Instant;

use crate::pipeline::Pipeline;
use crate::scene::{Geometry, OBJECT_KINDS, Scene, TermSpec};
use glam::{Vec2, Vec3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{editor, harness, quick, settle};
use crate::app::actions::Action;
use crate::app::document::{Recovered, RecoveryFile, Settings};
use crate::app::paint::Tool;
use crate::app::worker::{TableChoice, What};

/// Changes something.
fn edit(scene: &mut Scene, random: &mut impl Rng) {
    match random.random_range(0..9u32) {
        0 => {
            let kinds = ["grooves", "pyramids", "rods", "weave", "flat"];
            scene.tile.geometry = Geometry::with_defaults(kinds[random.random_range(0..kinds.len())]).unwrap();
            if let Geometry::Rods(rods) = &mut scene.tile.geometry {
                rods.count = 9;
            }
        }
        1 | 2 => drop(scene.nudge_geometry()),
        3 => drop(scene.nudge_brdf()),
        4 => scene.materials[0].color = Vec3::new(random.random(), random.random(), random.random()),
        5 => {
            let kinds = TermSpec::kinds();
            let kind = kinds[random.random_range(0..5usize)].kind;
            let text = format!("kind = \"{kind}\"");
            scene.materials[0].brdf = Some(toml::from_str(&text).unwrap());
        }
        6 => scene.light.rotation_deg = random.random_range(-180.0..180.0),
        7 => scene.camera.get_or_insert_default().azimuth_deg = random.random_range(-180.0..180.0),
        _ => scene.object.kind = OBJECT_KINDS[random.random_range(0..3usize)].to_owned(),
    }
}

/// Steps between two comparisons with the same scene from nothing.
const CHECK: usize = 200;

/// The picture at rest is of what the document says, to the bit.
fn compare_with_nothing_kept(harness: &mut egui_kittest::Harness<'static, Option<super::Editor>>) {
    settle(harness);
    let editor = editor(harness);
    let afresh = Pipeline::new().effective(&editor.document.loaded()).unwrap().brdf;
    let made = editor.object.made.as_ref().unwrap();
    for pair in crate::metrics::mirror_biased_pairs(64, 7) {
        assert_eq!(made.brdf.as_ref().unwrap().eval(pair.i, pair.o), afresh.eval(pair.i, pair.o));
    }
}

/// `edits` of them, and on for as many minutes as `BISCALE_SOAK_MINUTES` says.
fn soak(edits: usize, seed: u64) {
    let minutes: f64 = std::env::var("BISCALE_SOAK_MINUTES").ok().and_then(|text| text.parse().ok()).unwrap_or(0.0);
    let _alone = super::alone();
    let start = Instant::now();
    let goes_on = |step: usize| step < edits || edits > 100 && start.elapsed().as_secs_f64() < 60.0 * minutes;
    let folder = tempfile::tempdir().unwrap();
    let (saved, table) = (folder.path().join("a.toml"), folder.path().join("t.csv"));
    let (mut steps, mut undos, mut opens, mut exports) = (0, 0, 0, 0);
    let mut harness = harness(quick());
    let ctx = harness.ctx.clone();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut held = Vec::new();
    while goes_on(steps) {
        steps += 1;
        match random.random_range(0..14u32) {
            0 => {
                editor(&mut harness).action(&ctx, Action::Undo);
                undos += 1;
            }
            1 => editor(&mut harness).action(&ctx, Action::Redo),
            2 => {
                let editor = editor(&mut harness);
                editor.tile.set_painting(true);
                editor.tile.brush.tool = Tool::ALL[random.random_range(0..Tool::ALL.len())];
                let at = Vec2::new(random.random(), random.random());
                editor.draw(&[at, at + 0.2]);
                editor.tile.set_painting(false);
            }
            3 => editor(&mut harness).save(&saved),
            4 if saved.exists() => {
                editor(&mut harness).open(&saved.to_string_lossy());
                opens += 1;
            }
            5 if editor(&mut harness).exporting.is_none() => {
                editor(&mut harness)
                    .export(table.clone(), What::Table(TableChoice { theta: 2, phi: 4, ..TableChoice::default() }));
                exports += 1;
            }
            _ => {
                let mut scene = (**editor(&mut harness).document.scene()).clone();
                edit(&mut scene, &mut random);
                editor(&mut harness).document.edit(scene);
            }
        }
        harness.step();
        // What is on disk is whole at any time.
        if let Ok(text) = std::fs::read_to_string(&table) {
            assert_eq!(text.lines().filter(|line| !line.starts_with('#')).count(), 1 + 64, "{text}");
        }
        if let Ok(text) = std::fs::read_to_string(&saved) {
            crate::scene::parse(&text).unwrap();
        }
        if steps % CHECK == 0 {
            compare_with_nothing_kept(&mut harness);
            held.extend(memory());
        }
    }
    compare_with_nothing_kept(&mut harness);
    if held.len() >= 8 {
        let most = |part: &[u64]| part.iter().copied().fold(0, u64::max);
        let quarter = held.len() / 4;
        let (early, late) = (most(&held[quarter..2 * quarter]), most(&held[3 * quarter..]));
        eprintln!(
            "{steps} steps, {undos} undos, {opens} opens, {exports} exports in {:.0} s, {} times the same as from nothing; \
             resident: {} MB in the second quarter at most, {} MB in the last",
            start.elapsed().as_secs_f64(),
            held.len() + 1,
            early >> 20,
            late >> 20
        );
        // All families have been met by the first quarter; a leak goes on.
        assert!(late < early + early / 4 + (32 << 20), "{held:?}");
    }
    let texts = editor(&mut harness).messages.texts().join("; ");
    assert!(!texts.contains("fault"), "{texts}");
}

/// Bytes that this process holds in memory, where the system says so.
fn memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    let pages: u64 = text.split_whitespace().nth(1)?.parse().ok()?;
    Some(pages * 4096)
}

#[test]
fn sixty_random_edits_end_in_the_image_of_the_same_scene_computed_afresh() {
    soak(60, 1);
}

#[test]
#[ignore = "minutes: 2,000 edits; asked for by name in release"]
fn two_thousand_random_edits_neither_crash_nor_grow() {
    soak(2000, 2);
}

/// What an editor writes into the folder that all share, again and again: settings of its own kind, and its recovery.
/// `other_ended` tells whether the other program is gone: only then is its recovery to be found.
fn keep_writing(folder: &Path, kind: &str, rounds: usize, mut other_ended: impl FnMut() -> bool) {
    let ours = Settings { recent: vec![Path::new(kind).join("a.toml"); 10], ..Settings::default() };
    let recovery = RecoveryFile::new(folder);
    let document = quick();
    for _ in 0..rounds {
        ours.save(Some(folder));
        recovery.prepare(&document).unwrap().write().unwrap();
        // Whoever wrote last: never half of both, nor the defaults that a broken file would give.
        let recent = Settings::load(Some(folder)).recent;
        assert!(recent.len() == 10 && recent.iter().all(|path| *path == recent[0]), "{recent:?}");
        assert!(Recovered::find(folder).is_empty() || other_ended(), "both live");
    }
    // As one that crashes: its recovery stays.
    std::mem::forget(recovery);
}

const SHARED: &str = "BISCALE_TEST_SHARED_FOLDER";

#[test]
fn an_editor_that_is_told_of_a_shared_folder_writes_to_it() {
    if let Some(folder) = std::env::var_os(SHARED) {
        keep_writing(Path::new(&folder), "theirs", 200, || false);
    }
}

#[test]
fn two_programs_that_share_the_folder_of_the_editor_leave_its_files_whole() {
    let folder = tempfile::tempdir().unwrap();
    let mut other = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "app::tests::soak::an_editor_that_is_told_of_a_shared_folder_writes_to_it"])
        .env(SHARED, folder.path())
        .stdout(std::process::Stdio::null())
        .spawn()
        .unwrap();
    keep_writing(folder.path(), "ours", 200, || other.try_wait().unwrap().is_some());
    assert!(other.wait().unwrap().success());
    // The other is gone: what it left is found, ours (which lives) is not.
    let left = Recovered::find(folder.path());
    if cfg!(target_os = "linux") {
        assert_eq!(left.len(), 1);
    }
    assert_eq!(left[0].restore().unwrap().scene(), quick().scene());
    let names = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name());
    let parts: Vec<_> = names.filter(|name| name.to_string_lossy().ends_with(".part")).collect();
    assert!(parts.is_empty(), "{parts:?}");
}
