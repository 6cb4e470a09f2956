//! ZIP archives of stored (uncompressed) members, for `.npz` files (PKWARE APPNOTE 6.3, Sec. 4.3).

use std::io::{self, Write};

/// 1980-01-01, the first date of ZIP. A fixed date makes archives of the same content byte-identical.
const DATE: u16 = 0x21;
/// Version 2.0, both made by (on Unix) and needed to extract.
const VERSION: u16 = 20;
const UNIX: u16 = 3 << 8;
/// Mode of a regular file that everyone may read.
const MODE: u32 = 0o100_644 << 16;

/// Writes members one after the other and the directory at the end.
pub struct ZipWriter<'a> {
    out: &'a mut dyn Write,
    offset: u64,
    directory: Vec<u8>,
    members: u16,
}

impl<'a> ZipWriter<'a> {
    pub fn new(out: &'a mut dyn Write) -> Self {
        Self { out, offset: 0, directory: Vec::new(), members: 0 }
    }

    /// Adds a member whose content is the concatenation of `parts`.
    pub fn member(&mut self, name: &str, parts: &[&[u8]]) -> io::Result<()> {
        let size = narrow(parts.iter().map(|part| part.len() as u64).sum())?;
        let offset = narrow(self.offset)?;
        let name_length = u16::try_from(name.len()).map_err(io::Error::other)?;
        // These fields, from "version needed" to "extra field length", are the same in local header and directory.
        let mut common = Vec::with_capacity(26);
        for field in [VERSION, 0, 0, 0, DATE] {
            common.extend(field.to_le_bytes());
        }
        for field in [crc32(parts), size, size] {
            common.extend(field.to_le_bytes());
        }
        for field in [name_length, 0] {
            common.extend(field.to_le_bytes());
        }
        self.put(b"PK\x03\x04")?;
        self.put(&common)?;
        self.put(name.as_bytes())?;
        for part in parts {
            self.put(part)?;
        }
        self.directory.extend(b"PK\x01\x02");
        self.directory.extend((UNIX | VERSION).to_le_bytes());
        self.directory.extend(common);
        // Comment length, disk number and internal attributes are 0.
        self.directory.extend([0; 6]);
        self.directory.extend(MODE.to_le_bytes());
        self.directory.extend(offset.to_le_bytes());
        self.directory.extend(name.as_bytes());
        self.members += 1;
        Ok(())
    }

    /// Writes the directory.
    pub fn finish(mut self) -> io::Result<()> {
        let directory = std::mem::take(&mut self.directory);
        let (size, offset) = (narrow(directory.len() as u64)?, narrow(self.offset)?);
        self.put(&directory)?;
        self.put(b"PK\x05\x06")?;
        for field in [0, 0, self.members, self.members] {
            self.put(&field.to_le_bytes())?;
        }
        self.put(&size.to_le_bytes())?;
        self.put(&offset.to_le_bytes())?;
        self.put(&[0; 2])
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.offset += bytes.len() as u64;
        self.out.write_all(bytes)
    }
}

/// Converts a size or an offset to the 32 bits of ZIP without ZIP64. The bound on pairs keeps tables below 4 GiB.
fn narrow(size: u64) -> io::Result<u32> {
    u32::try_from(size).map_err(|_| io::Error::other("the archive has 4 GiB or more"))
}

/// Computes the CRC-32 (ISO 3309) with the reflected polynomial of ZIP and PNG.
fn crc32(parts: &[&[u8]]) -> u32 {
    let bytes = parts.iter().copied().flatten();
    !bytes.fold(!0, |crc: u32, &byte| CRC_OF_BYTE[usize::from((crc as u8) ^ byte)] ^ (crc >> 8))
}

const CRC_OF_BYTE: [u32; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = byte as u32;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
            bit += 1;
        }
        table[byte] = crc;
        byte += 1;
    }
    table
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crc32_has_its_published_check_value() {
        assert_eq!(crc32(&[b"1234", b"56789"]), 0xcbf4_3926);
    }

    #[test]
    fn the_directory_points_to_the_headers_of_members() {
        let mut bytes = Vec::new();
        let mut zip = ZipWriter::new(&mut bytes);
        zip.member("a", &[b"xyz"]).unwrap();
        zip.member("bb", &[b"12", b"3456"]).unwrap();
        zip.finish().unwrap();
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let end = bytes.len() - 22;
        assert_eq!(&bytes[end..end + 4], b"PK\x05\x06");
        let directory = word(end + 16);
        assert_eq!(directory + word(end + 12), end);
        let second = directory + 46 + 1;
        assert_eq!(&bytes[second..second + 4], b"PK\x01\x02");
        let local = word(second + 42);
        assert_eq!(&bytes[local..local + 4], b"PK\x03\x04");
        assert_eq!(&bytes[local + 30..local + 32 + 6], b"bb123456");
        assert_eq!(word(local + 22), 6);
    }
}
