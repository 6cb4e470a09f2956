//! Reader of tabulated distributions of slopes: a square table of numbers in a CSV file.

use glam::DVec2;

use super::ellipse::Profile;
use super::ndf::Ndf;
use super::slope_table::SlopeTable;
use crate::base::InputError;

/// Largest number of rows.
const MAX_SIDE: usize = 1024;

/// Reads densities over slopes: row k holds the slopes with y in cell k of the cells that divide `-span..span` evenly, and
/// its values go along x. The table is scaled to the mass 1 and turned by `rotation` [rad].
///
/// # Errors
/// The table is not square, holds a value that is negative or no number, or sums to 0.
pub fn read(text: &str, span: f64, rotation: f64) -> Result<Ndf, InputError> {
    let mut masses = Vec::new();
    let mut rows = 0;
    let mut columns = None;
    for (number, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let place = || format!("line {}", number + 1);
        let start = masses.len();
        for field in line.split(',') {
            let value = field.trim().parse::<f64>().ok().filter(|value| value.is_finite() && *value >= 0.0);
            masses.push(
                value.ok_or_else(|| {
                    InputError::new(place(), format!("`{}`", field.trim()), "a density of at least 0")
                })?,
            );
        }
        let count = masses.len() - start;
        if *columns.get_or_insert(count) != count || count > MAX_SIDE {
            let expected = format!("{} values, at most {MAX_SIDE}", columns.unwrap_or_default());
            return Err(InputError::new(place(), format!("{count} values"), expected));
        }
        rows += 1;
    }
    let columns = columns.unwrap_or(0);
    if rows != columns || rows < 2 {
        return Err(InputError::new(
            "",
            format!("{rows} rows of {columns} values"),
            "a square table of 2 to 1024 rows",
        ));
    }
    let cell = 2.0 * span / rows as f64;
    let origin = DVec2::splat(0.5 * cell - span);
    let table = SlopeTable::new(rows, origin, cell, masses)
        .ok_or_else(|| InputError::new("", "a table that sums to 0", "at least one density above 0"))?;
    Ok(Ndf::of_table(if rotation == 0.0 { table } else { turned(&table, rotation) }))
}

/// The table turned about slope 0, with nodes twice as dense.
fn turned(table: &SlopeTable, rotation: f64) -> SlopeTable {
    let turn = DVec2::from_angle(rotation);
    let mut slopes = Vec::new();
    // Each node stands for its tent, as four by four slopes.
    for k in 0..table.side * table.side {
        let mass = table.masses[k];
        for j in 0..16 {
            let offset = [-0.625, -0.18, 0.18, 0.625];
            let inside = DVec2::new(offset[j % 4], offset[j / 4]);
            let node = DVec2::new((k % table.side) as f64, (k / table.side) as f64) + inside;
            slopes.push((turn.rotate(table.origin + table.cell * node), mass / 16.0));
        }
    }
    let side = (2 * table.side).min(MAX_SIDE);
    let span = table.reach() * std::f64::consts::SQRT_2;
    SlopeTable::of_slopes(&slopes, side, DVec2::ZERO, span).unwrap_or_else(|| table.clone())
}

/// A CSV file with a table of an analytic distribution, for tests and examples.
pub fn example(profile: Profile, roughness: f64, side: usize, span: f64) -> String {
    let ndf = Ndf::analytic(profile, DVec2::splat(roughness), 0.0);
    let at = |k: usize| (k as f64 + 0.5) / side as f64 * 2.0 * span - span;
    let row =
        |y: usize| (0..side).map(|x| ndf.density(DVec2::new(at(x), at(y))).to_string()).collect::<Vec<_>>().join(",");
    (0..side).map(|y| row(y) + "\n").collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_of_beckmann_slopes_is_read_back() {
        let ndf = read(&example(Profile::Beckmann, 0.2, 64, 0.7), 0.7, 0.0).unwrap();
        let closed = Ndf::analytic(Profile::Beckmann, DVec2::splat(0.2), 0.0);
        for m in [DVec2::ZERO, DVec2::new(0.1, 0.05), DVec2::new(-0.2, 0.2)] {
            assert!((ndf.density(m) / closed.density(m) - 1.0).abs() < 0.02, "{m}");
        }
        let turned = read(&example(Profile::Beckmann, 0.2, 64, 0.7), 0.7, 0.5).unwrap();
        assert!((turned.rough_moments().1 / closed.rough_moments().1 - 1.0).abs() < 0.02);
    }

    #[test]
    fn damaged_tables_are_read_or_refused_but_never_unsound() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let sound = example(Profile::Ggx, 0.3, 6, 1.0).into_bytes();
        let pieces: [&[u8]; 8] = [b",", b"\n", b"-", b"1e308", b"nan", b"inf", b"1e-320", b"\xff"];
        for _ in 0..400 {
            let mut bytes = sound.clone();
            for _ in 0..rng.random_range(1..4) {
                let at = rng.random_range(0..bytes.len());
                let end = (at + rng.random_range(0..9)).min(bytes.len());
                bytes.splice(at..end, pieces[rng.random_range(0..pieces.len())].iter().copied());
            }
            let Ok(text) = std::str::from_utf8(&bytes) else { continue };
            if let Ok(ndf) = read(text, 1.0, 0.0) {
                let density = ndf.density(DVec2::new(rng.random(), rng.random()));
                assert!(density.is_finite() && density >= 0.0, "{text}");
                assert!(ndf.signed_lambda(glam::DVec3::new(0.9, 0.1, 0.1)).is_finite(), "{text}");
            }
        }
    }

    #[test]
    fn bad_tables_are_refused_with_their_place() {
        for (text, expected) in [
            ("", "0 rows"),
            ("1,2\n3\n", "line 2: found 1 values"),
            ("1,2\n", "1 rows of 2"),
            ("1,-2\n3,4\n", "line 1: found `-2`"),
            ("1,nan\n3,4\n", "`nan`"),
            ("0,0\n0,0\n", "sums to 0"),
        ] {
            let error = read(text, 1.0, 0.0).unwrap_err().to_string();
            assert!(error.contains(expected), "{text:?}: {error}");
        }
    }
}
