//! Arrays in `.npz` archives: a ZIP archive of `.npy` arrays for `numpy.load` (NumPy Enhancement Proposal 1).

use std::collections::HashMap;
use std::io;

use super::InputError;
use super::zip::ZipWriter;

/// The machine's byte order, in which numbers are written, as a NumPy type prefix.
const ORDER: char = if cfg!(target_endian = "big") { '>' } else { '<' };

/// Shapes and values of arrays by name.
pub type Arrays = HashMap<String, (Vec<usize>, Vec<f32>)>;

/// Adds `name.npy` in C order; `kind` is the NumPy type without its byte order.
///
/// # Errors
/// The archive cannot be written.
pub fn array(zip: &mut ZipWriter<'_>, name: &str, kind: &str, shape: &[usize], data: &[u8]) -> io::Result<()> {
    // A Python tuple of one element needs a trailing comma; longer tuples allow one.
    let shape: String = shape.iter().map(|length| format!("{length},")).collect();
    let mut header = format!("{{'descr': '{ORDER}{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    // Magic number, version and length take 10 bytes; the data must start at a multiple of 64, after a line break.
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let length = u16::try_from(header.len()).map_err(io::Error::other)?.to_le_bytes();
    zip.member(&format!("{name}.npy"), &[b"\x93NUMPY\x01\x00", &length, header.as_bytes(), data])
}

/// The little-endian f32 and u32 arrays of an archive of stored members. Members of other types are skipped. Numbers of u32
/// above 2²⁴ lose bits.
///
/// # Errors
/// The bytes are no ZIP archive, or one with compressed members.
pub fn arrays(bytes: &[u8]) -> std::result::Result<Arrays, InputError> {
    let broken =
        |at: usize| InputError::new(format!("byte {at}"), "something else", "a ZIP member without compression");
    let half = |at: usize| bytes.get(at..at + 2).map(|b| usize::from(u16::from_le_bytes([b[0], b[1]])));
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let mut arrays = Arrays::new();
    let mut at = 0;
    if !bytes.starts_with(b"PK\x03\x04") {
        return Err(InputError::new("header", "other bytes", "a ZIP archive").with_hint("is this an .npz file?"));
    }
    while bytes.get(at..at + 4) == Some(b"PK\x03\x04") {
        let whole = || Some((half(at + 8)?, word(at + 18)?, half(at + 26)?, half(at + 28)?));
        let (method, size, name_length, extra) = whole().ok_or_else(|| broken(at))?;
        let first = at + 30 + name_length + extra;
        let (Some(name), Some(data)) =
            (bytes.get(at + 30..at + 30 + name_length), bytes.get(first..first.saturating_add(size)))
        else {
            return Err(broken(at));
        };
        if method != 0 {
            return Err(broken(at).with_hint("archives of numpy.savez_compressed are not supported"));
        }
        let name = String::from_utf8_lossy(name).trim_end_matches(".npy").to_owned();
        if let Some(array) = npy(data) {
            arrays.insert(name, array);
        }
        at = first + size;
    }
    Ok(arrays)
}

/// Shape and values of a C-ordered array of little-endian f32 or u32.
fn npy(data: &[u8]) -> Option<(Vec<usize>, Vec<f32>)> {
    if !data.starts_with(b"\x93NUMPY\x01") {
        return None;
    }
    let length = usize::from(u16::from_le_bytes([*data.get(8)?, *data.get(9)?]));
    let header = std::str::from_utf8(data.get(10..10 + length)?).ok()?;
    let is_whole = header.contains("'<u4'");
    if !(is_whole || header.contains("'<f4'")) || header.contains("'fortran_order': True") {
        return None;
    }
    let shape = header.split("'shape': (").nth(1)?.split(')').next()?;
    let shape: Vec<usize> =
        shape.split(',').map(str::trim).filter(|n| !n.is_empty()).map(|n| n.parse().ok()).collect::<Option<_>>()?;
    let count = shape.iter().try_fold(1_usize, |product, &n| product.checked_mul(n))?;
    let numbers = data.get(10 + length..)?.as_chunks().0;
    let value = |&b: &[u8; 4]| if is_whole { u32::from_le_bytes(b) as f32 } else { f32::from_le_bytes(b) };
    (numbers.len() == count).then(|| (shape, numbers.iter().map(value).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_of_floats_and_whole_numbers_come_back() {
        let mut bytes = Vec::new();
        let mut zip = ZipWriter::new(&mut bytes);
        array(&mut zip, "a", "f4", &[2, 1], bytemuck::cast_slice(&[1.5_f32, -2.0])).unwrap();
        array(&mut zip, "b", "u4", &[], bytemuck::bytes_of(&16_777_215_u32)).unwrap();
        array(&mut zip, "c", "f8", &[], bytemuck::bytes_of(&1.0_f64)).unwrap();
        zip.finish().unwrap();
        let found = arrays(&bytes).unwrap();
        assert_eq!(found["a"], (vec![2, 1], vec![1.5, -2.0]));
        assert_eq!(found["b"], (vec![], vec![16_777_215.0]));
        assert!(!found.contains_key("c"));
    }
}
