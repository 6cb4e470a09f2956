//! Hash keys of the inputs of a stage.

use std::sync::LazyLock;

use super::Build;

/// Version of the file format and of the content of cached results.
const FORMAT: u32 = 1;

/// A BLAKE3 hash (256 bits) of everything that a result depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Key(pub(super) [u8; 32]);

/// Hashes inputs, each with its name and length, so that different lists of inputs give different bytes.
#[derive(Debug, Clone)]
pub struct KeyBuilder(blake3::Hasher);

impl KeyBuilder {
    #[cfg(test)]
    pub(super) fn new(kind: &str, build: &Build) -> Self {
        let mut key = Self::start(build);
        key.numbers("kind", kind.as_bytes());
        key
    }

    /// The start of a key of a stage: its name and this build.
    pub fn of_stage(name: &str) -> Self {
        static START: LazyLock<blake3::Hasher> = LazyLock::new(|| KeyBuilder::start(&Build::of_this_program()).0);
        let mut key = Self(START.clone());
        key.numbers("kind", name.as_bytes());
        key
    }

    /// The part of all keys: the format and the build.
    fn start(build: &Build) -> Self {
        let mut key = Self(blake3::Hasher::new());
        key.numbers("format", &[FORMAT]).numbers("build", &build.bytes());
        key
    }

    #[cfg(test)]
    pub(crate) fn for_tests() -> Self {
        Self(blake3::Hasher::new())
    }

    /// Adds the bits of numbers or vectors; 0 and -0 differ.
    pub fn numbers<T: bytemuck::NoUninit>(&mut self, name: &str, numbers: &[T]) -> &mut Self {
        let bytes: &[u8] = bytemuck::cast_slice(numbers);
        for part in [name.as_bytes(), bytes] {
            self.0.update(&(part.len() as u64).to_le_bytes());
            self.0.update(part);
        }
        self
    }

    /// Adds sizes or counts.
    pub fn counts(&mut self, name: &str, counts: impl IntoIterator<Item = usize>) -> &mut Self {
        let counts: Vec<u64> = counts.into_iter().map(|count| count as u64).collect();
        self.numbers(name, &counts)
    }

    /// Adds flags.
    pub fn flags(&mut self, name: &str, flags: impl IntoIterator<Item = bool>) -> &mut Self {
        let flags: Vec<u8> = flags.into_iter().map(u8::from).collect();
        self.numbers(name, &flags)
    }

    /// Adds a value that prints everything it depends on. Floats print every digit that tells them apart.
    pub fn debug(&mut self, name: &str, value: &impl std::fmt::Debug) -> &mut Self {
        self.numbers(name, format!("{value:?}").as_bytes())
    }

    /// Adds the key of an input.
    pub fn key(&mut self, name: &str, key: &Key) -> &mut Self {
        self.numbers(name, &key.0)
    }

    pub fn finish(&self) -> Key {
        Key(*self.0.finalize().as_bytes())
    }
}

impl Key {
    /// Returns the key of numbers only, for tests and for parts of other keys.
    pub fn of_numbers<T: bytemuck::NoUninit>(numbers: &[T]) -> Self {
        Self(*blake3::hash(bytemuck::cast_slice(numbers)).as_bytes())
    }

    pub fn bytes(&self) -> &[u8; 32] {
        &self.0
    }

    /// The key in hexadecimal digits.
    pub fn name(&self) -> String {
        blake3::Hash::from_bytes(self.0).to_hex().to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(kind: &str, inputs: impl FnOnce(&mut KeyBuilder)) -> Key {
        let mut key = KeyBuilder::new(kind, &Build::of_this_program());
        inputs(&mut key);
        key.finish()
    }

    #[test]
    fn different_inputs_have_different_keys() {
        let keys = [
            key("a", |_| {}),
            key("b", |_| {}),
            key("a", |key| _ = key.numbers("x", &[1_u8, 2])),
            key("a", |key| _ = key.numbers("x", &[1_u8]).numbers("x", &[2_u8])),
            key("a", |key| _ = key.numbers("y", &[1_u8, 2])),
            key("a", |key| _ = key.numbers::<f32>("x", &[])),
            key("a", |key| _ = key.numbers("x", &[0.0_f32])),
            key("a", |key| _ = key.numbers("x", &[-0.0_f32])),
            key("a", |key| _ = key.numbers("x", &[0.0_f32, 0.0])),
        ];
        for (k, a) in keys.iter().enumerate() {
            for b in &keys[..k] {
                assert_ne!(a, b, "{k}");
            }
        }
        assert_eq!(keys[2], key("a", |key| _ = key.numbers("x", &[1_u8, 2])));
    }
}
