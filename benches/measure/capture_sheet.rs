//! Errors, time and memory of the capture of a whole sheet, by the program.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use biscale::slab::capture::patterns::Pattern;
use biscale::slab::capture::simulated::varying_sheet;
use biscale::slab::capture::svbtdf::Svbtdf;
use glam::{DVec2, DVec3};

/// Sheets by the pixels of a side, and dots of a side.
const SHEETS: [(usize, usize); 3] = [(48, 40), (96, 40), (192, 40)];
/// The sheets of Table 1 of Dai et al. 2009, made by formulas: pixels and dots of a side. The paper's have 600 x 600, 400 x 420
/// and 600 x 600 pixels.
const PATTERNS: [(Pattern, &str, usize, usize); 3] = [
    (Pattern::GridSheet, "grid sheet", 64, 40),
    (Pattern::LeafGlass, "leaf glass", 64, 40),
    (Pattern::RicePaper, "rice paper", 64, 20),
];
/// Pixels whose lobes are compared.
const COMPARED: usize = 60;

/// Prints a row per sheet, or the row of a sheet of `PIXELSxDOTS`.
pub fn capture_sheet(argument: Option<&str>, print: &mut dyn FnMut(String)) -> Result<(), String> {
    print("| sheet | pixels | dots | noise | representatives | error of lobes at 0, 30 and 60°: median, worst of 60 pixels | mean error of alpha | capture, processor time | memory |".to_owned());
    print("|---|---|---|---|---|---|---|---|---|".to_owned());
    let one = argument.and_then(|text| {
        let (pixels, dots) = text.split_once('x')?;
        Some((pixels.parse().ok()?, dots.parse().ok()?))
    });
    let sheets = one.map_or(SHEETS.to_vec(), |one| vec![one]);
    for (side, dots) in sheets {
        print(row("varying", &varying_sheet([side, side]), dots, 0.01)?);
    }
    if argument.is_none() {
        for (pattern, name, side, dots) in PATTERNS {
            print(row(name, &pattern.sheet([side, side]), dots, 0.01)?);
        }
    }
    Ok(())
}

fn row(name: &str, sheet: &Svbtdf, dots: usize, noise: f64) -> Result<String, String> {
    let side = sheet.size[0];
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let path = |name: &str| folder.path().join(name);
    sheet.write(&path("known.npz")).map_err(|error| error.to_string())?;
    let scene = "[tile]\ngeometry = { kind = \"flat\" }\n[slab]\nsvbtdf = \"known.npz\"\n";
    std::fs::write(path("known.toml"), scene).map_err(|error| error.to_string())?;
    let (pixels, counts, noise_text) = (format!("{side}x{side}"), format!("{dots}x{dots}"), noise.to_string());
    let rig =
        ["rig", "known.toml", "-o", "rig", "--pixels", &pixels, "--dots", &counts, "--noise", &noise_text, "--quiet"];
    run(folder.path(), &rig)?;
    let Used { memory, seconds } = run(folder.path(), &["capture", "rig", "-o", "found.npz", "--quiet"])?;
    let found = Svbtdf::read(&path("found.npz")).map_err(|error| error.to_string())?;
    let step = side * side / COMPARED;
    let compared: Vec<usize> = (0..COMPARED).map(|k| k * step + (k * 7919) % step.max(1)).collect();
    let mut errors: Vec<f64> = compared.iter().map(|pixel| error(sheet, &found, *pixel)).collect();
    errors.sort_by(f64::total_cmp);
    let alpha: f64 =
        compared.iter().map(|pixel| (sheet.model(*pixel).alpha - found.model(*pixel).alpha).abs()).sum::<f64>()
            / COMPARED as f64;
    Ok(format!(
        "| {name} | {side} x {side} | {dots} x {dots} | {:.0} % | {} | {:.1} %, {:.1} % | {alpha:.2} | {seconds:.1} s | {} MB |",
        100.0 * noise,
        found.models.len(),
        100.0 * errors[COMPARED / 2],
        100.0 * errors[COMPARED - 1],
        memory >> 20
    ))
}

/// Relative L2 of the lobes of a pixel over the disc of the light, at new views.
fn error(known: &Svbtdf, found: &Svbtdf, pixel: usize) -> f64 {
    let (mut difference, mut norm) = (0.0, 0.0);
    for degrees in [0.0, 30.0, 60.0_f64] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let o = DVec3::new(sin, 0.0, -cos);
        for k in 0..40 * 40 {
            let at = (DVec2::new(f64::from(k % 40), f64::from(k / 40)) + 0.5) / 20.0 - 1.0;
            let square = 1.0 - at.length_squared();
            if square < 0.0076 {
                continue;
            }
            let i = at.extend(square.sqrt());
            let (a, b) = (known.btdf(pixel, i, o), found.btdf(pixel, i, o));
            difference += (a - b).length_squared() / i.z;
            norm += a.length_squared() / i.z;
        }
    }
    (difference / norm).sqrt()
}

/// Memory and time of a run of the program.
struct Used {
    /// Peak resident memory [bytes].
    memory: u64,
    /// Time of all processors.
    seconds: f64,
}

/// Clock ticks per second in `/proc`.
const TICKS: f64 = 100.0;

/// Processor time from the text of `/proc/PID/stat`; its name in brackets may hold spaces.
fn processor_seconds(stat: &str) -> Option<f64> {
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |field: usize| fields.get(field)?.parse::<f64>().ok();
    Some((ticks(11)? + ticks(12)?) / TICKS)
}

/// Runs the program.
fn run(folder: &Path, arguments: &[&str]) -> Result<Used, String> {
    let mut child = Command::new(env!("CARGO_BIN_EXE_biscale"))
        .args(arguments)
        .current_dir(folder)
        .stdout(Stdio::null())
        .spawn()
        .map_err(|error| error.to_string())?;
    let [status, stat] = ["status", "stat"].map(|file| format!("/proc/{}/{file}", child.id()));
    let mut used = Used { memory: 0, seconds: 0.0 };
    loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let found = text.lines().find(|line| line.starts_with("VmHWM")).and_then(|line| line.split_whitespace().nth(1));
        let peak = found.and_then(|kilobytes| kilobytes.parse::<u64>().ok());
        used.memory = used.memory.max(peak.unwrap_or(0) << 10);
        let text = std::fs::read_to_string(&stat).unwrap_or_default();
        used.seconds = processor_seconds(&text).unwrap_or(0.0).max(used.seconds);
        if let Some(ended) = child.try_wait().map_err(|error| error.to_string())? {
            return if ended.success() { Ok(used) } else { Err(format!("{arguments:?} failed")) };
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}
