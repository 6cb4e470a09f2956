//! Paths that cannot be written, full disks, and files that other programs change.

use std::path::Path;
use std::time::{Duration, Instant};

use eframe::egui::Event;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use super::{editor, harness, quick};
use crate::app::actions::Action;
use crate::app::dialogs::Dialog;
use crate::app::document::RecoveryFile;
use crate::app::editor::Editor;
use crate::app::worker::{ExportKind, TableChoice};

type Window = Harness<'static, Option<Editor>>;

fn set_lights(harness: &mut Window, count: usize) {
    let mut scene = (**editor(harness).document.scene()).clone();
    scene.light.count = count;
    editor(harness).document.edit(scene);
}

/// Runs frames until `condition` accepts the texts of all messages.
fn run_until(harness: &mut Window, condition: impl Fn(&str) -> bool) {
    let start = Instant::now();
    loop {
        harness.step();
        let texts = editor(harness).messages.texts().join("; ");
        if condition(&texts) {
            return;
        }
        assert!(start.elapsed() < Duration::from_secs(60), "{texts}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Makes a file on a full disk; `None` if the system has no `/dev/full`.
fn on_full_disk(folder: &Path, name: &str) -> Option<std::path::PathBuf> {
    let path = folder.join(name);
    #[cfg(target_os = "linux")]
    std::os::unix::fs::symlink("/dev/full", &path).ok()?;
    path.exists().then_some(path)
}

#[test]
fn a_full_disk_is_reported_while_saving_and_exporting_and_the_document_stays_unsaved() {
    let folder = tempfile::tempdir().unwrap();
    let (Some(scene), Some(table)) = (on_full_disk(folder.path(), "a.toml"), on_full_disk(folder.path(), "a.csv"))
    else {
        return eprintln!("SKIPPED: no /dev/full");
    };
    let mut harness = harness(quick());
    set_lights(&mut harness, 3);
    let before = editor(&mut harness).document.scene().clone();
    editor(&mut harness).save(&scene);
    let texts = editor(&mut harness).messages.texts().join("; ");
    assert!(texts.contains("a full disk") && texts.contains("free some") && texts.contains("still here"), "{texts}");
    let document = &editor(&mut harness).document;
    assert!(document.is_dirty() && document.path.is_none() && *document.scene() == before);
    let choice = TableChoice { theta: 2, phi: 4, ..TableChoice::default() };
    editor(&mut harness).export(table, ExportKind::Table(choice));
    run_until(&mut harness, |texts| texts.contains("Not exported") && texts.matches("a full disk").count() == 2);
    assert!(editor(&mut harness).exporting.is_none());
}

#[test]
fn a_recovery_file_that_cannot_be_written_is_reported_until_one_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let name = format!("recovery-{}.toml", std::process::id());
    let Some(path) = on_full_disk(folder.path(), &name) else { return eprintln!("SKIPPED: no /dev/full") };
    let mut harness = harness(quick());
    editor(&mut harness).recovery = Some(RecoveryFile::new(folder.path()));
    set_lights(&mut harness, 3);
    run_until(&mut harness, |texts| texts.contains("No recovery file") && texts.contains("a full disk"));
    std::fs::remove_file(&path).unwrap();
    set_lights(&mut harness, 2);
    run_until(&mut harness, |texts| !texts.contains("No recovery file"));
    assert!(std::fs::read_to_string(path).unwrap().contains("count = 2"));
}

#[test]
fn a_file_that_another_program_changed_is_noticed_when_the_window_gets_the_focus() {
    let folder = tempfile::tempdir().unwrap();
    for is_dirty in [false, true] {
        let path = folder.path().join("shared.toml");
        let mut harness = harness(quick());
        editor(&mut harness).save(&path);
        let saved = std::fs::read_to_string(&path).unwrap();
        let theirs = saved.replace("count = 4", "count = 7") + "# someone else\n";
        std::fs::write(&path, &theirs).unwrap();
        if is_dirty {
            set_lights(&mut harness, 3);
        }
        let ours = editor(&mut harness).document.scene().clone();
        let refocus = |harness: &mut Window| {
            harness.event(Event::WindowFocused(false));
            harness.step();
            harness.event(Event::WindowFocused(true));
            harness.run_steps(2);
            harness.query_by_label_contains("was changed by another program").is_some()
        };
        assert!(refocus(&mut harness));
        assert_eq!(harness.query_by_label_contains("drops the changes you have not saved").is_some(), is_dirty);
        harness.get_by_label("Later").click();
        harness.run_steps(2);
        assert_eq!(
            (editor(&mut harness).document.is_dirty(), editor(&mut harness).document.scene()),
            (is_dirty, &ours)
        );
        assert!(refocus(&mut harness), "Later does not settle the question");
        harness.get_by_label("Keep mine").click();
        harness.run_steps(2);
        // The open document differs from the file, so it is unsaved work.
        assert!(editor(&mut harness).document.is_dirty() && *editor(&mut harness).document.scene() == ours);
        assert!(!refocus(&mut harness), "the question is settled");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), theirs);
        // The question waits until another dialog is closed.
        std::fs::write(&path, theirs + "# once more\n").unwrap();
        editor(&mut harness).dialog = Some(Dialog::Help);
        assert!(!refocus(&mut harness));
        editor(&mut harness).dialog = None;
        harness.run_steps(2);
        harness.get_by_label("Reload").click();
        harness.run_steps(2);
        let document = &editor(&mut harness).document;
        assert_eq!((document.scene().light.count, document.is_dirty()), (7, false));
    }
}

#[test]
fn a_path_that_cannot_be_written_is_reported_and_the_document_stays_unsaved() {
    let mut harness = harness(quick());
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.light.count = 3;
    let editor = editor(&mut harness);
    editor.document.edit(scene);
    editor.save(std::path::Path::new("/nonexistent/folder/a.toml"));
    let texts = editor.messages.texts().join("; ");
    assert!(texts.contains("Not saved") && texts.contains("nonexistent") && texts.contains("still here"), "{texts}");
    assert_eq!(editor.settings.files, None, "the next dialog does not start there");
    assert!(editor.document.is_dirty());
}

#[test]
fn a_file_that_another_program_changed_is_not_overwritten_without_a_question() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("shared.toml");
    let mut harness = harness(quick());
    let ctx = harness.ctx.clone();
    editor(&mut harness).save(&path);
    let theirs = std::fs::read_to_string(&path).unwrap() + "# someone else\n";
    std::fs::write(&path, &theirs).unwrap();
    let mut scene = (**editor(&mut harness).document.scene()).clone();
    scene.light.count = 3;
    editor(&mut harness).document.edit(scene.clone());
    for (answer, is_ours) in [("Later", false), ("Keep mine", true)] {
        editor(&mut harness).action(&ctx, Action::Save);
        harness.run_steps(2);
        assert!(harness.query_by_label_contains("was changed by another program").is_some());
        assert_eq!(std::fs::read_to_string(&path).unwrap(), theirs);
        harness.get_by_label(answer).click();
        harness.run_steps(2);
        assert_eq!(std::fs::read_to_string(&path).unwrap() != theirs, is_ours);
        assert_eq!(editor(&mut harness).document.is_dirty(), !is_ours);
    }
    assert_eq!(**editor(&mut harness).document.scene(), scene);
}
