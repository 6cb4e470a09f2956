//! Reader and writer of the container of RGL `.bsdf` files, which stores named arrays.
//!
//! A file has `tensor_file\0`, two version bytes (1, 0) and the u32 field count. Each field has u16 name length, name,
//! u16 dimensions, u8 type, u64 offset from the start of the file, and u64 per dimension. The arrays follow, with the
//! last dimension fastest. Numbers are little-endian.

use std::io::{self, Read, Write};
use std::path::Path;

use crate::base::{InputError, regular_file};

const MAGIC: &[u8; 12] = b"tensor_file\0";
/// Largest file in bytes. Published isotropic RGB files have less than 1 MB.
const MAX_FILE: u64 = 256 << 20;
/// Largest number of fields and of dimensions; published files have at most 12 fields of at most 5 dimensions.
const MAX_FIELDS: u32 = 256;
const MAX_DIMENSIONS: u16 = 8;

/// A file in memory. Its table of contents has been checked against its size.
pub(crate) struct TensorFile {
    bytes: Vec<u8>,
    fields: Vec<Field>,
}

struct Field {
    name: String,
    kind: u8,
    offset: usize,
    shape: Vec<usize>,
}

/// Codes of the element types that BRDF files use.
const U8: u8 = 1;
const F32: u8 = 10;
const F64: u8 = 11;

impl TensorFile {
    pub(crate) fn read(path: &Path) -> Result<Self, InputError> {
        let unreadable = |error: std::io::Error| InputError::new("", error, "an RGL file that can be read");
        let file = regular_file::open(path).map_err(unreadable)?;
        let len = file.metadata().map_err(unreadable)?.len();
        if len > MAX_FILE {
            let expected = format!("at most {MAX_FILE} bytes");
            return Err(InputError::new("file size", format!("{len} bytes"), expected));
        }
        let mut bytes = Vec::with_capacity(len as usize);
        file.take(MAX_FILE).read_to_end(&mut bytes).map_err(unreadable)?;
        Self::parse(bytes)
    }

    pub(crate) fn parse(bytes: Vec<u8>) -> Result<Self, InputError> {
        let mut reader = Reader { bytes: &bytes, at: 0 };
        if reader.take::<12>("header")? != *MAGIC {
            return Err(
                InputError::new("header", "other bytes", "\"tensor_file\"").with_hint("is this an RGL .bsdf file?")
            );
        }
        let version = reader.take::<2>("version")?;
        if version != [1, 0] {
            return Err(InputError::new("version", format!("{version:?}"), "[1, 0]"));
        }
        let count = u32::from_le_bytes(reader.take("field count")?);
        if count > MAX_FIELDS {
            return Err(InputError::new("field count", count, format!("at most {MAX_FIELDS}")));
        }
        let fields = (0..count).map(|_| reader.field()).collect::<Result<Vec<_>, _>>()?;
        Ok(Self { bytes, fields })
    }

    pub(crate) fn has(&self, name: &str) -> bool {
        self.fields.iter().any(|field| field.name == name)
    }

    fn field(&self, name: &str) -> Result<&Field, InputError> {
        self.fields.iter().find(|field| field.name == name).ok_or_else(|| {
            let names: Vec<_> = self.fields.iter().map(|field| field.name.as_str()).collect();
            InputError::new("fields", names.join(", "), format!("a field named \"{name}\""))
        })
    }

    /// Shape and finite values of a field with `DIMENSIONS` dimensions.
    pub(crate) fn floats<const DIMENSIONS: usize>(
        &self,
        name: &str,
    ) -> Result<([usize; DIMENSIONS], Vec<f64>), InputError> {
        let field = self.field(name)?;
        let place = || format!("field \"{name}\"");
        let shape: [usize; DIMENSIONS] = field.shape.as_slice().try_into().map_err(|_| {
            InputError::new(place(), format!("shape {:?}", field.shape), format!("{DIMENSIONS} dimensions"))
        })?;
        let bytes = &self.bytes[field.offset..];
        let count: usize = shape.iter().product();
        let values: Vec<f64> = match field.kind {
            U8 => bytes.iter().take(count).map(|&byte| f64::from(byte)).collect(),
            F32 => bytes.as_chunks().0.iter().take(count).map(|&b| f64::from(f32::from_le_bytes(b))).collect(),
            F64 => bytes.as_chunks().0.iter().take(count).map(|&b| f64::from_le_bytes(b)).collect(),
            other => {
                return Err(InputError::new(place(), format!("element type {other}"), "1 (u8), 10 (f32) or 11 (f64)"));
            }
        };
        match values.iter().position(|value| !value.is_finite()) {
            Some(at) => Err(InputError::new(format!("{}, element {at}", place()), values[at], "a finite number")),
            None => Ok((shape, values)),
        }
    }
}

/// Arrays to write into a file.
#[derive(Default)]
pub(crate) struct TensorWriter {
    fields: Vec<(&'static str, u8, Vec<usize>, Vec<u8>)>,
}

impl TensorWriter {
    /// Adds an array of f32, last dimension fastest.
    pub(crate) fn floats(&mut self, name: &'static str, shape: &[usize], values: &[f32]) {
        debug_assert_eq!(values.len(), shape.iter().product::<usize>());
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.fields.push((name, F32, shape.to_vec(), bytes));
    }

    /// Adds a list of bytes, which holds a text or a flag.
    pub(crate) fn bytes(&mut self, name: &'static str, bytes: &[u8]) {
        self.fields.push((name, U8, vec![bytes.len()], bytes.to_vec()));
    }

    /// Writes the table of contents, then the arrays, each at a multiple of 8 bytes.
    pub(crate) fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let entry = |name: &str, shape: &[usize]| 2 + name.len() + 2 + 1 + 8 + 8 * shape.len();
        let contents: usize = self.fields.iter().map(|(name, _, shape, _)| entry(name, shape)).sum();
        let mut header = MAGIC.to_vec();
        header.extend([1, 0]);
        header.extend(u32::try_from(self.fields.len()).map_err(io::Error::other)?.to_le_bytes());
        let mut offset = (header.len() + contents).next_multiple_of(ALIGNMENT);
        for (name, kind, shape, bytes) in &self.fields {
            header.extend((name.len() as u16).to_le_bytes());
            header.extend(name.as_bytes());
            header.extend((shape.len() as u16).to_le_bytes());
            header.push(*kind);
            header.extend((offset as u64).to_le_bytes());
            shape.iter().for_each(|&n| header.extend((n as u64).to_le_bytes()));
            offset = (offset + bytes.len()).next_multiple_of(ALIGNMENT);
        }
        header.resize(header.len().next_multiple_of(ALIGNMENT), 0);
        out.write_all(&header)?;
        for (_, _, _, bytes) in &self.fields {
            out.write_all(bytes)?;
            out.write_all(&[0; ALIGNMENT][..bytes.len().next_multiple_of(ALIGNMENT) - bytes.len()])?;
        }
        Ok(())
    }
}

/// Alignment of arrays in the file, in bytes.
const ALIGNMENT: usize = 8;

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Reader<'_> {
    fn slice(&mut self, len: usize, what: &str) -> Result<&[u8], InputError> {
        let end = self.at.saturating_add(len);
        let slice = self.bytes.get(self.at..end).ok_or_else(|| {
            InputError::new(
                format!("{what} at byte {}", self.at),
                format!("the end of the file at byte {}", self.bytes.len()),
                format!("{len} bytes"),
            )
        })?;
        self.at = end;
        Ok(slice)
    }

    fn take<const N: usize>(&mut self, what: &str) -> Result<[u8; N], InputError> {
        let mut array = [0; N];
        array.copy_from_slice(self.slice(N, what)?);
        Ok(array)
    }

    /// Reads one entry of the table of contents and checks that its array lies within the file.
    fn field(&mut self) -> Result<Field, InputError> {
        let name_len = u16::from_le_bytes(self.take("name length")?);
        let name = String::from_utf8_lossy(self.slice(usize::from(name_len), "field name")?).into_owned();
        let place = format!("field \"{name}\"");
        let dimensions = u16::from_le_bytes(self.take(&place)?);
        if dimensions > MAX_DIMENSIONS {
            return Err(InputError::new(
                place,
                format!("{dimensions} dimensions"),
                format!("at most {MAX_DIMENSIONS}"),
            ));
        }
        let [kind] = self.take(&place)?;
        let offset = u64::from_le_bytes(self.take(&place)?);
        let shape: Vec<u64> =
            (0..dimensions).map(|_| self.take(&place).map(u64::from_le_bytes)).collect::<Result<_, _>>()?;
        // Types 1 to 11: u8 i8 u16 i16 u32 i32 u64 i64 f16 f32 f64.
        let size = match kind {
            1 | 2 => 1,
            3 | 4 | 9 => 2,
            5 | 6 | 10 => 4,
            7 | 8 | 11 => 8,
            other => {
                return Err(InputError::new(place, format!("element type {other}"), "1 to 11"));
            }
        };
        let end = shape
            .iter()
            .try_fold(size, |bytes: u64, &n| bytes.checked_mul(n))
            .and_then(|bytes| bytes.checked_add(offset));
        match end {
            Some(end) if end <= self.bytes.len() as u64 => {
                let shape = shape.into_iter().map(|n| n as usize).collect();
                Ok(Field { name, kind, offset: offset as usize, shape })
            }
            _ => Err(InputError::new(
                place,
                format!("shape {shape:?} at byte {offset}"),
                format!("an array within the file's {} bytes", self.bytes.len()),
            )),
        }
    }
}
