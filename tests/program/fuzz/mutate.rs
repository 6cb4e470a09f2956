//! Mutations of bytes, of binary and textual numbers, and of longer pieces.

use rand::{Rng, RngExt};

/// Numbers at the limits of types.
const NUMBERS: [i64; 14] = [
    0,
    1,
    -1,
    2,
    255,
    65_535,
    65_536,
    i32::MAX as i64,
    i32::MIN as i64,
    u32::MAX as i64,
    1_000_000_000_000_000_000,
    i64::MAX,
    i64::MIN,
    1 << 40,
];

const WORDS: [&str; 22] = [
    "nan",
    "inf",
    "-inf",
    "-1",
    "0",
    "-0.0",
    "1e38",
    "-1e38",
    "1e39",
    "1e-38",
    "1e-45",
    "99999999999999999999",
    "0.5",
    "1/2",
    "\"\"",
    "[]",
    "{}",
    "true",
    "1e6",
    "1e-6",
    "3",
    "\u{feff}",
];

/// Returns `base` after a few mutations, with pieces of `other`.
pub fn mutated(base: &[u8], other: &[u8], is_text: bool, random: &mut impl Rng) -> Vec<u8> {
    let mut bytes = base.to_vec();
    for _ in 0..1 + random.random_range(0..4u32).pow(2) / 2 {
        if is_text && random.random_range(0..3u32) > 0 {
            replace_word(&mut bytes, random);
        } else {
            change_bytes(&mut bytes, other, random);
        }
    }
    bytes
}

/// Returns a random position.
fn position(length: usize, random: &mut impl Rng) -> usize {
    // Half of the positions are in the header.
    let end = if random.random_bool(0.5) { length.min(512) } else { length };
    if end == 0 { 0 } else { random.random_range(0..end) }
}

fn change_bytes(bytes: &mut Vec<u8>, other: &[u8], random: &mut impl Rng) {
    let at = position(bytes.len(), random);
    match random.random_range(0..9u32) {
        0 | 1 if !bytes.is_empty() => bytes[at] ^= 1 << random.random_range(0..8u32),
        2 if !bytes.is_empty() => bytes[at] = random.random(),
        3 => bytes.truncate(at),
        4 | 5 => {
            let number = NUMBERS[random.random_range(0..NUMBERS.len())];
            let wide = [
                number.to_le_bytes().to_vec(),
                (number as i32).to_le_bytes().to_vec(),
                (number as u16).to_le_bytes().to_vec(),
            ];
            let mut number = wide[random.random_range(0..3usize)].clone();
            if random.random_bool(0.3) {
                number.reverse();
            }
            // Most fields are aligned to four bytes.
            let at = if random.random_bool(0.5) { at & !3 } else { at };
            for (byte, new) in bytes.iter_mut().skip(at).zip(number) {
                *byte = new;
            }
        }
        6 => {
            let float = [f64::NAN, f64::INFINITY, -1.0, 1e300, 1e-300][random.random_range(0..5usize)];
            let number = if random.random_bool(0.5) {
                float.to_le_bytes().to_vec()
            } else {
                (float as f32).to_le_bytes().to_vec()
            };
            for (byte, new) in bytes.iter_mut().skip(at & !3).zip(number) {
                *byte = new;
            }
        }
        7 if !other.is_empty() => {
            let from = position(other.len(), random);
            let piece = &other[from..(from + random.random_range(1..64usize)).min(other.len())];
            bytes.splice(at..at, piece.iter().copied());
        }
        _ => {
            let end = (at + random.random_range(1..32usize)).min(bytes.len());
            bytes.drain(at..end);
        }
    }
}

/// Replaces or removes a word, or repeats a line.
fn replace_word(bytes: &mut Vec<u8>, random: &mut impl Rng) {
    let is_part = |byte: u8| byte.is_ascii_alphanumeric() || b".-+_".contains(&byte);
    let start = position(bytes.len(), random);
    let Some(from) = (start..bytes.len()).find(|&k| is_part(bytes[k])) else { return };
    let to = (from..bytes.len()).find(|&k| !is_part(bytes[k])).unwrap_or(bytes.len());
    match random.random_range(0..8u32) {
        0 => {
            let line_end = (to..bytes.len()).find(|&k| bytes[k] == b'\n').map_or(bytes.len(), |k| k + 1);
            let line: Vec<u8> = bytes[from..line_end].to_vec();
            for _ in 0..random.random_range(1..4u32) {
                bytes.splice(line_end..line_end, line.iter().copied());
            }
        }
        1 => drop(bytes.drain(from..to)),
        2 => {
            let digits: Vec<u8> =
                (0..random.random_range(1..30u32)).map(|_| b'0' + random.random_range(0..10u8)).collect();
            bytes.splice(from..to, digits);
        }
        _ => {
            let word = WORDS[random.random_range(0..WORDS.len())];
            bytes.splice(from..to, word.bytes());
        }
    }
}
