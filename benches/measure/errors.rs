//! True and stated errors of hard tiles.

use crate::hard_tiles::{Measured, RayCast, TrueValues, all, measure};

const PRESETS: [&str; 2] = ["draft", "standard"];
const SEEDS: std::ops::RangeInclusive<u64> = 1..=3;
/// Bounds of the standard errors of true values.
const RAYS: RayCast = RayCast { points: 4096, max_passes: 16, target: 4e-3 };

/// Prints the errors of all hard tiles, or of those whose name contains `part`.
///
/// # Errors
/// A temporary folder cannot be created.
pub fn errors(part: Option<&str>, print: &mut dyn FnMut(String)) -> Result<(), String> {
    print("| tile | `draft`: true | stated | PSNR | `standard`: true | stated | PSNR | true values |".to_owned());
    print("|---|---|---|---|---|---|---|---|".to_owned());
    for tile in all().iter().filter(|tile| part.is_none_or(|part| tile.name.contains(part))) {
        let folder = tempfile::tempdir().map_err(|error| format!("temporary folder: {error}"))?;
        let loaded = tile.open(folder.path(), "standard", 1);
        let (pairs, truth) = tile.pairs_and_values(&loaded, &RAYS);
        let of = |preset| SEEDS.map(|seed| measure(&loaded, preset, seed, &pairs, &truth)).collect::<Vec<_>>();
        print(row(tile.name, &PRESETS.map(of), &truth));
    }
    Ok(())
}

fn row(name: &str, presets: &[Vec<Measured>], truth: &TrueValues) -> String {
    let all =
        |runs: &[Measured], value: &dyn Fn(&Measured) -> String| runs.iter().map(value).collect::<Vec<_>>().join(", ");
    let sign = |run: &Measured| if run.is_resolved { "" } else { "≈ " };
    let mut cells = vec![name.to_owned()];
    for runs in presets {
        cells.push(all(runs, &|run| format!("{}{:.2} %", sign(run), 100.0 * run.errors.rel_l2)));
        cells
            .push(all(runs, &|run| format!("{:.2} %{}", 100.0 * run.stated, if run.warns { " (warned)" } else { "" })));
        cells.push(all(runs, &|run| format!("{:.1} dB", run.errors.psnr_db)));
    }
    let closed = truth.std_error == 0.0;
    cells.push(if closed { "closed form".to_owned() } else { format!("± {:.2} %", 100.0 * truth.std_error) });
    format!("| {} |", cells.join(" | "))
}
