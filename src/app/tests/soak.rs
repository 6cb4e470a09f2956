//! Many random edits without a crash or a memory leak, compared with a fresh pipeline; and two editors at once.

use std::path::Path;
use std::time::Instant;

use crate::pipeline::Pipeline;
use crate::scene::{Geometry, OBJECT_KINDS, Scene, TermSpec};
use glam::{Vec2, Vec3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{editor, harness, quick, settle};
use crate::app::actions::Action;
use crate::app::document::{EditorSettings, RecoveredDocument, RecoveryFile};
use crate::app::paint::Tool;
use crate::app::worker::{ExportKind, TableChoice};

/// Makes a random edit.
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

/// Steps between two comparisons with a fresh pipeline.
const COMPARISON_STEPS: usize = 200;

/// Checks that the BRDF of the displayed image equals that of a fresh pipeline, bit for bit.
fn compare_with_fresh_pipeline(harness: &mut egui_kittest::Harness<'static, Option<super::Editor>>) {
    settle(harness);
    let editor = editor(harness);
    let fresh = Pipeline::new().effective(&editor.document.loaded()).unwrap().brdf;
    let preview = editor.object.preview.as_ref().unwrap();
    for pair in crate::metrics::mirror_biased_pairs(64, 7) {
        assert_eq!(preview.brdf.as_ref().unwrap().eval(pair.i, pair.o), fresh.eval(pair.i, pair.o));
    }
}

/// Makes at least `edits` random edits. The long test continues for `BISCALE_SOAK_MINUTES` minutes.
fn soak(edits: usize, seed: u64) {
    let minutes: f64 = std::env::var("BISCALE_SOAK_MINUTES").ok().and_then(|text| text.parse().ok()).unwrap_or(0.0);
    let _alone = super::alone();
    let start = Instant::now();
    let continues = |step: usize| step < edits || edits > 100 && start.elapsed().as_secs_f64() < 60.0 * minutes;
    let folder = tempfile::tempdir().unwrap();
    let (saved, table) = (folder.path().join("a.toml"), folder.path().join("t.csv"));
    let (mut steps, mut undos, mut opens, mut exports) = (0, 0, 0, 0);
    let mut harness = harness(quick());
    let ctx = harness.ctx.clone();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut resident = Vec::new();
    while continues(steps) {
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
                editor(&mut harness).export(
                    table.clone(),
                    ExportKind::Table(TableChoice { theta: 2, phi: 4, ..TableChoice::default() }),
                );
                exports += 1;
            }
            _ => {
                let mut scene = (**editor(&mut harness).document.scene()).clone();
                edit(&mut scene, &mut random);
                editor(&mut harness).document.edit(scene);
            }
        }
        harness.step();
        // Files on disk are complete at any time.
        if let Ok(text) = std::fs::read_to_string(&table) {
            assert_eq!(text.lines().filter(|line| !line.starts_with('#')).count(), 1 + 64, "{text}");
        }
        if let Ok(text) = std::fs::read_to_string(&saved) {
            crate::scene::parse(&text).unwrap();
        }
        if steps % COMPARISON_STEPS == 0 {
            compare_with_fresh_pipeline(&mut harness);
            // The memory depends on the scene, so it is compared at the same one.
            editor(&mut harness).document.edit((**quick().scene()).clone());
            settle(&mut harness);
            resident.extend(resident_bytes());
        }
    }
    compare_with_fresh_pipeline(&mut harness);
    if resident.len() >= 8 {
        let max = |part: &[u64]| part.iter().copied().fold(0, u64::max);
        let quarter = resident.len() / 4;
        let (early, late) = (max(&resident[2 * quarter..3 * quarter]), max(&resident[3 * quarter..]));
        eprintln!(
            "{steps} steps, {undos} undos, {opens} opens, {exports} exports in {:.0} s, {} comparisons equal; \
             resident: at most {} MB in the third quarter, {} MB in the last",
            start.elapsed().as_secs_f64(),
            resident.len() + 1,
            early >> 20,
            late >> 20
        );
        // The first half covers all families and fills the arenas of the allocator, so only a leak grows later.
        assert!(late < early + early / 4 + (32 << 20), "{resident:?}");
    }
    let texts = editor(&mut harness).messages.texts().join("; ");
    assert!(!texts.contains("fault"), "{texts}");
}

/// Returns the resident memory of this process [bytes], if the system reports it.
fn resident_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    let pages: u64 = text.split_whitespace().nth(1)?.parse().ok()?;
    Some(pages * 4096)
}

/// The environment variable that is set in a process that runs only the long test.
const OWN_PROCESS: &str = "BISCALE_TEST_OWN_PROCESS";

#[test]
fn sixty_random_edits_give_the_brdf_of_a_fresh_pipeline() {
    soak(60, 1);
}

#[test]
#[ignore = "minutes: 2,000 edits; runs by name in release"]
fn two_thousand_random_edits_neither_crash_nor_grow() {
    // Other tests that run in the same process would count as memory of the editor.
    if std::env::var_os(OWN_PROCESS).is_some() {
        return soak(2000, 2);
    }
    let run = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "app::tests::soak::two_thousand_random_edits_neither_crash_nor_grow"])
        .args(["--ignored", "--nocapture"])
        .env(OWN_PROCESS, "1")
        .output()
        .unwrap();
    eprint!("{}", String::from_utf8_lossy(&run.stderr));
    assert!(run.status.success() && String::from_utf8_lossy(&run.stdout).contains("1 passed"));
}

/// Repeatedly writes settings and a recovery file into the shared folder. `other_ended` returns true if the other
/// program has ended; only then may its recovery file be found.
fn write_repeatedly(folder: &Path, kind: &str, rounds: usize, mut other_ended: impl FnMut() -> bool) {
    let ours = EditorSettings { recent: vec![Path::new(kind).join("a.toml"); 10], ..EditorSettings::default() };
    let recovery = RecoveryFile::new(folder);
    let document = quick();
    for _ in 0..rounds {
        ours.save(Some(folder));
        recovery.prepare(&document).unwrap().write().unwrap();
        // The file is that of one writer: neither a mixture, nor damaged, which would give the defaults.
        let recent = EditorSettings::load(Some(folder)).recent;
        assert!(recent.len() == 10 && recent.iter().all(|path| *path == recent[0]), "{recent:?}");
        assert!(RecoveredDocument::find(folder).is_empty() || other_ended(), "both processes are running");
    }
    // Simulates a crash: the recovery file stays.
    std::mem::forget(recovery);
}

const SHARED: &str = "BISCALE_TEST_SHARED_FOLDER";

#[test]
fn an_editor_with_a_shared_folder_writes_to_it() {
    if let Some(folder) = std::env::var_os(SHARED) {
        write_repeatedly(Path::new(&folder), "theirs", 200, || false);
    }
}

#[test]
fn two_programs_that_share_a_folder_leave_complete_files() {
    let folder = tempfile::tempdir().unwrap();
    let mut other = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "app::tests::soak::an_editor_with_a_shared_folder_writes_to_it"])
        .env(SHARED, folder.path())
        .stdout(std::process::Stdio::null())
        .spawn()
        .unwrap();
    write_repeatedly(folder.path(), "ours", 200, || other.try_wait().unwrap().is_some());
    assert!(other.wait().unwrap().success());
    // The recovery file of the ended program is found. That of this running process is not.
    let left = RecoveredDocument::find(folder.path());
    if cfg!(target_os = "linux") {
        assert_eq!(left.len(), 1);
    }
    assert_eq!(left[0].restore().unwrap().scene(), quick().scene());
    let names = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name());
    let parts: Vec<_> = names.filter(|name| name.to_string_lossy().ends_with(".part")).collect();
    assert!(parts.is_empty(), "{parts:?}");
}
