//! Faults around the program: a kill, a full disk, a read-only folder. A file on disk is complete, old or new, and a
//! message names the file.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use biscale::base::replace_file;

const SCENE: &str = r#"
[tile]
geometry = { kind = "grooves", count = 2 }
[[material]]
name = "default"
brdf = { kind = "cook_torrance", roughness = 0.4, f0 = 0.8 }
[light]
count = 4
[quality]
preset = "draft"
facets = 256
backend = "cpu"
method = "direct"
"#;

fn program(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_biscale"));
    command.env("BISCALE_CACHE", "off");
    command.args(arguments).current_dir(folder).stdout(Stdio::null()).stderr(Stdio::null());
    command
}

/// Returns the names in a folder, without the partial files of a killed program.
fn names(folder: &Path) -> Vec<String> {
    let all = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = all.filter(|name| !name.ends_with(".part")).collect();
    names.sort();
    names
}

#[test]
fn an_export_that_is_killed_leaves_the_old_table_or_the_complete_new_one() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.toml"), SCENE).unwrap();
    let export = ["export", "a.toml", "-o", "t.npz", "--resolution", "16x32", "--quiet"];
    let target = folder.path().join("t.npz");
    let start = Instant::now();
    assert!(program(folder.path(), &export).status().unwrap().success());
    let duration = start.elapsed();
    let new = std::fs::read(&target).unwrap();
    let old = b"the old table".to_vec();
    let mut survived = 0;
    // Twenty moments from the start to after the end.
    for moment in 0..20 {
        std::fs::write(&target, &old).unwrap();
        let mut child = program(folder.path(), &export).spawn().unwrap();
        std::thread::sleep(duration.mul_f64(f64::from(moment) / 18.0));
        child.kill().unwrap();
        child.wait().unwrap();
        let left = std::fs::read(&target).unwrap();
        assert!(left == old || left == new, "found {} bytes of neither table", left.len());
        survived += usize::from(left == old);
    }
    assert!(survived > 0, "every kill came after the export");
    // Partial files do not stop the next run.
    std::fs::write(&target, &old).unwrap();
    assert!(program(folder.path(), &export).status().unwrap().success());
    assert_eq!(std::fs::read(&target).unwrap(), new);
}

/// Returns a [`program`] whose files have at most this many blocks of 512 bytes. At the first byte beyond, the system
/// ends the program as a kill does if `ends` is true, and otherwise fails the write as a full disk does.
#[cfg(target_os = "linux")]
fn limited(folder: &Path, blocks: usize, ends: bool, arguments: &[&str]) -> Command {
    let mut command = Command::new("sh");
    let ignored = if ends { "" } else { "trap '' XFSZ; " };
    command
        .args(["-c", &format!("{ignored}ulimit -c 0; ulimit -f {blocks}; exec \"$0\" \"$@\"")])
        .arg(env!("CARGO_BIN_EXE_biscale"))
        .args(arguments)
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    command
}

/// The program ends at a given byte, which depends on no timing.
#[test]
#[cfg(target_os = "linux")]
fn a_program_that_ends_in_the_middle_of_a_write_leaves_the_old_file_complete() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.toml"), SCENE).unwrap();
    for (file, more) in [("t.npz", &["--resolution", "8x16"][..]), ("t.csv", &["--resolution", "8x16"]), ("t.bin", &[])]
    {
        let arguments = [&["export", "a.toml", "-o", file, "--quiet"][..], more].concat();
        let target = folder.path().join(file);
        assert!(program(folder.path(), &arguments).status().unwrap().success());
        let bytes = std::fs::metadata(&target).unwrap().len() as usize;
        std::fs::write(&target, "the old one").unwrap();
        for blocks in [1, bytes / 1024, bytes / 512 - 1] {
            for ends in [true, false] {
                let output = limited(folder.path(), blocks, ends, &arguments).output().unwrap();
                let message = String::from_utf8_lossy(&output.stderr);
                assert!(
                    !output.status.success() && !message.contains("panicked"),
                    "{file}, {blocks} blocks: {message}"
                );
                assert_eq!(std::fs::read_to_string(&target).unwrap(), "the old one", "{file}, {blocks} blocks");
                let all = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap());
                let parts: Vec<_> =
                    all.filter(|entry| entry.file_name().to_string_lossy().ends_with(".part")).collect();
                if ends {
                    // The partial file stays beside the old file.
                    let [part] = &parts[..] else { panic!("{file}: {parts:?}") };
                    assert_eq!(part.metadata().unwrap().len() as usize, 512 * blocks, "{file}");
                    // The next write to this place removes it.
                    assert!(program(folder.path(), &arguments).status().unwrap().success());
                    assert!(!part.path().exists());
                    std::fs::write(&target, "the old one").unwrap();
                } else {
                    assert!(parts.is_empty() && message.contains(file) && output.status.code() == Some(2), "{message}");
                }
            }
        }
    }
}

#[test]
fn a_partial_file_of_an_earlier_process_with_the_same_id_does_not_stop_a_save() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    for attempt in 0..3 {
        let stale = folder.path().join(format!(".a.toml.{}-{attempt}.part", std::process::id()));
        std::fs::write(stale, "half of some").unwrap();
    }
    replace_file(&path, SCENE.as_bytes()).unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), SCENE);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "they are removed");
}

/// A tabulation of seconds is killed before it has anything to write.
#[test]
fn a_program_that_is_killed_while_it_computes_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.toml"), SCENE.replace("facets = 256", "facets = 4096")).unwrap();
    let mut child =
        program(folder.path(), &["export", "a.toml", "-o", "t.npz", "--resolution", "36x72"]).spawn().unwrap();
    std::thread::sleep(std::time::Duration::from_millis(500));
    assert!(child.try_wait().unwrap().is_none(), "the export is done before it is killed");
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn names_up_to_the_limit_of_the_file_system_are_written() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.toml"), SCENE).unwrap();
    let name = "x".repeat(251) + ".png";
    let arguments = ["render", "a.toml", "-o", &name, "--size", "8x8"];
    assert!(program(folder.path(), &arguments).status().unwrap().success());
    assert!(folder.path().join(&name).exists());
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_gives_a_message_and_a_device_file_stays_a_device_file() {
    use std::os::unix::fs::FileTypeExt;
    let full = Path::new("/dev/full");
    if !full.exists() {
        return eprintln!("SKIPPED: no /dev/full");
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.toml"), SCENE).unwrap();
    std::fs::write(folder.path().join("p.csv"), "theta_i,phi_i,theta_o,phi_o\n0,0,0,0\n").unwrap();
    for arguments in [
        &["eval", "a.toml", "--pairs", "p.csv", "-o", "/dev/full"][..],
        &["eval", "a.toml", "--pairs", "p.csv", "-o", "-"],
        &["plan", "a.toml", "--json"],
        &["export", "a.toml", "-o", "-", "--resolution", "4x8"],
    ] {
        let output = program(folder.path(), arguments)
            .stdout(std::fs::OpenOptions::new().write(true).open(full).unwrap())
            .stderr(Stdio::piped())
            .output()
            .unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(1) && message.contains("space"), "{arguments:?}: {message}");
        assert!(!message.contains("panicked"), "{message}");
        assert!(full.metadata().unwrap().file_type().is_char_device(), "{arguments:?} replaced the device file");
    }
    let error = replace_file(full, b"something").unwrap_err();
    assert!(error.to_string().contains("/dev/full") && error.to_string().contains("space"), "{error}");
}

/// Uses a file system of 256 kB, if the user may mount one.
#[test]
#[cfg(target_os = "linux")]
fn a_disk_that_fills_in_the_middle_of_a_write_keeps_the_old_file_complete() {
    let folder = tempfile::tempdir().unwrap();
    let mounted = Command::new("mount")
        .args(["-t", "tmpfs", "-o", "size=256k", "tmpfs"])
        .arg(folder.path())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success());
    if !mounted {
        return eprintln!("SKIPPED: the user may not mount a file system");
    }
    let path = folder.path().join("a.exr");
    replace_file(&path, &[7; 100_000]).unwrap();
    let failed = replace_file(&path, &[9; 1_000_000]);
    let (old, others) = (std::fs::read(&path), names(folder.path()));
    let parts = std::fs::read_dir(folder.path()).unwrap().count();
    let again = replace_file(&path, &[8; 50_000]);
    Command::new("umount").arg(folder.path()).status().unwrap();
    assert!(failed.is_err_and(|error| error.to_string().contains("a.exr")));
    assert_eq!(old.unwrap(), [7; 100_000]);
    assert_eq!((others, parts), (vec!["a.exr".to_owned()], 1), "a partial file stays");
    again.unwrap();
}

#[test]
#[cfg(unix)]
fn a_read_only_folder_gives_a_message_that_names_the_file() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    use std::os::unix::process::CommandExt;
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.toml"), SCENE).unwrap();
    std::fs::write(folder.path().join("t.csv"), "old").unwrap();
    let set = |mode: u32| std::fs::set_permissions(folder.path(), std::fs::Permissions::from_mode(mode)).unwrap();
    set(0o555);
    for arguments in [&["export", "a.toml", "-o", "t.csv", "--resolution", "4x8"][..], &["plan", "a.toml"]] {
        let mut command = program(folder.path(), arguments);
        // Every folder is writable for root, so the program runs as the user `nobody`.
        if folder.path().metadata().unwrap().uid() == 0 {
            command.uid(65_534).gid(65_534);
        }
        let output = match command.stderr(Stdio::piped()).output() {
            Ok(output) => output,
            Err(error) => return eprintln!("SKIPPED: the program cannot run as another user: {error}"),
        };
        let message = String::from_utf8_lossy(&output.stderr);
        if arguments[0] == "plan" {
            assert!(output.status.success(), "`plan` writes no file: {message}");
        } else {
            assert!(output.status.code() == Some(2) && message.contains("t.csv"), "{:?}: {message}", output.status);
        }
    }
    set(0o755);
    assert_eq!(std::fs::read_to_string(folder.path().join("t.csv")).unwrap(), "old");
    assert_eq!(names(folder.path()), ["a.toml", "t.csv"]);
}

#[test]
#[cfg(unix)]
fn a_pipe_receives_the_bytes_and_stays_a_pipe() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    if !Command::new("mkfifo").arg(&pipe).status().is_ok_and(|status| status.success()) {
        return eprintln!("SKIPPED: no mkfifo");
    }
    let reader = {
        let pipe = pipe.clone();
        std::thread::spawn(move || std::fs::read(pipe).unwrap())
    };
    replace_file(&pipe, b"through").unwrap();
    assert_eq!(reader.join().unwrap(), b"through");
    assert!(!pipe.metadata().unwrap().is_file());
}

#[test]
fn two_programs_that_write_the_same_file_leave_the_complete_file_of_one() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.toml"), SCENE).unwrap();
    let export = |seed: &str| {
        let arguments = ["export", "a.toml", "-o", "t.csv", "--resolution", "6x12", "--quiet", "--seed", seed];
        program(folder.path(), &arguments).spawn().unwrap()
    };
    let mut expected = Vec::new();
    for seed in ["1", "2"] {
        assert!(export(seed).wait().unwrap().success());
        expected.push(std::fs::read(folder.path().join("t.csv")).unwrap());
    }
    for _ in 0..4 {
        let mut both = [export("1"), export("2")];
        for child in &mut both {
            assert!(child.wait().unwrap().success());
        }
        let left = std::fs::read(folder.path().join("t.csv")).unwrap();
        assert!(expected.contains(&left), "found {} bytes of neither file", left.len());
    }
    assert_eq!(names(folder.path()), ["a.toml", "t.csv"]);
}
