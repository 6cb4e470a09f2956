//! Conversion of results to bytes and back, bit for bit.

use bytemuck::AnyBitPattern;

/// A result that can be cached. Numbers have the machine's byte order, because files of other machines have other keys.
pub trait Stored: Sized {
    fn write(&self, out: &mut Writer);
    /// Reads the result; `None` for bytes that are no such result.
    fn read(from: &mut Reader<'_>) -> Option<Self>;
}

/// Bytes of a result.
#[derive(Debug, Default)]
pub struct Writer(Vec<u8>);

/// Shortest run of zeros that [`Writer::sparse`] omits, in words.
const RUN: usize = 16;

impl Writer {
    pub fn count(&mut self, count: usize) {
        self.0.extend((count as u64).to_le_bytes());
    }

    /// Writes a length and the bits of numbers or vectors.
    pub fn numbers<T: bytemuck::NoUninit>(&mut self, numbers: &[T]) {
        self.count(numbers.len());
        self.0.extend_from_slice(bytemuck::cast_slice(numbers));
    }

    /// Writes words of which most may be zero: lengths of the runs of zeros, and the words between the runs.
    pub fn sparse(&mut self, words: &[u32]) {
        self.count(words.len());
        let mut at = 0;
        while at < words.len() {
            let zeros = words[at..].iter().take_while(|word| **word == 0).count();
            let start = at + zeros;
            let mut end = start;
            while end < words.len() && words[end..].iter().take(RUN).any(|word| *word != 0) {
                end += 1;
            }
            self.count(zeros);
            self.numbers(&words[start..end]);
            at = end;
        }
    }

    pub fn into_bytes(self) -> Vec<u8> {
        self.0
    }
}

/// Reads the bytes of a [`Writer`]. Every function returns `None` if the bytes end too early.
#[derive(Debug)]
pub struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    pub fn count(&mut self) -> Option<usize> {
        let (bytes, rest) = self.0.split_first_chunk::<8>()?;
        self.0 = rest;
        usize::try_from(u64::from_le_bytes(*bytes)).ok()
    }

    pub fn numbers<T: AnyBitPattern + bytemuck::NoUninit>(&mut self) -> Option<Vec<T>> {
        let length = self.count()?.checked_mul(size_of::<T>())?;
        let (bytes, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(bytemuck::pod_collect_to_vec(bytes))
    }

    /// Reads words that [`Writer::sparse`] wrote; `None` for more than `max_words`.
    pub fn sparse(&mut self, max_words: usize) -> Option<Vec<u32>> {
        let length = self.count().filter(|length| *length <= max_words)?;
        let mut words = Vec::with_capacity(length);
        while words.len() < length {
            let zeros = self.count().filter(|zeros| *zeros <= length - words.len())?;
            words.resize(words.len() + zeros, 0);
            let between: Vec<u32> = self.numbers()?;
            if between.len() > length - words.len() || zeros + between.len() == 0 {
                return None;
            }
            words.extend(between);
        }
        Some(words)
    }

    pub(super) fn is_at_end(&self) -> bool {
        self.0.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn sparse_words_are_read_back_and_runs_of_zeros_take_little_space(
            parts in prop::collection::vec((0_usize..200, prop::collection::vec(any::<u32>(), 0..20)), 0..8)
        ) {
            let words: Vec<u32> = parts.into_iter().flat_map(|(zeros, between)| [vec![0; zeros], between].concat()).collect();
            let mut out = Writer::default();
            out.sparse(&words);
            let bytes = out.into_bytes();
            let mut from = Reader::new(&bytes);
            prop_assert_eq!(from.sparse(words.len()), Some(words.clone()));
            prop_assert!(from.is_at_end());
            prop_assert!(bytes.len() <= 4 * words.iter().filter(|word| **word != 0).count() * RUN + 200);
            prop_assert!(words.is_empty() || Reader::new(&bytes).sparse(words.len() - 1).is_none());
        }

        #[test]
        fn any_bytes_are_read_without_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let _ = Reader::new(&bytes).sparse(1000);
            let _ = Reader::new(&bytes).numbers::<f32>();
        }
    }
}
