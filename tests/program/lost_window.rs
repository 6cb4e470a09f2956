//! A lost GPU of the editor's window: a new window opens and the editor continues. The test starts a display of its
//! own.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A process that is killed when it is dropped.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Starts an X server and returns its display; `None` if Xvfb is missing.
fn display() -> Option<(Process, String)> {
    let mut command = Command::new("Xvfb");
    command.args(["-displayfd", "1", "-screen", "0", "1000x700x24", "-nolisten", "tcp"]);
    let mut server = Process(command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().ok()?);
    let mut number = String::new();
    BufReader::new(server.0.stdout.take()?).read_line(&mut number).ok()?;
    Some((server, format!(":{}", number.trim())))
}

#[test]
fn a_lost_gpu_opens_a_new_window_and_the_editor_continues() {
    let Some((_server, display)) = display() else { return eprintln!("SKIPPED: no Xvfb") };
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.txt");
    let mut command = Command::new(env!("CARGO_BIN_EXE_biscale"));
    command.args(["edit", "default"]).current_dir(folder.path()).env("DISPLAY", display);
    command.env("BISCALE_CACHE", "off");
    command.env_remove("WAYLAND_DISPLAY").env("XDG_STATE_HOME", folder.path()).env("BISCALE_LOSE_DEVICE", "6");
    let mut editor = Process(command.stderr(std::fs::File::create(&log).unwrap()).spawn().unwrap());
    let start = Instant::now();
    loop {
        let mut text = String::new();
        std::fs::File::open(&log).unwrap().read_to_string(&mut text).unwrap();
        if text.contains("Vulkan driver") {
            return eprintln!("SKIPPED: {text}");
        }
        if let Some(status) = editor.0.try_wait().unwrap() {
            panic!("the program ended with {status}: {text}");
        }
        if text.contains("a new window is opened") {
            break;
        }
        assert!(start.elapsed() < Duration::from_secs(90), "no GPU is lost within 90 s: {text}");
        std::thread::sleep(Duration::from_millis(200));
    }
    std::thread::sleep(Duration::from_secs(4));
    assert!(editor.0.try_wait().unwrap().is_none(), "the program ended after its GPU was lost");
}
