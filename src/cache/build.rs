//! The build of the program, which is part of every key.

use crate::math::simd;

/// Everything besides its inputs that the bits of a result depend on: the code, and the instructions that the processor has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Build {
    version: &'static str,
    /// A hash of the sources, the dependencies and the compiler.
    program: &'static str,
    machine: [&'static str; 3],
}

impl Build {
    /// The build of this program or library. It is compiled in: the running executable may be an interpreter.
    pub fn of_this_program() -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION"),
            program: env!("BISCALE_BUILD"),
            machine: [std::env::consts::OS, std::env::consts::ARCH, simd::instructions()],
        }
    }

    #[cfg(test)]
    pub(super) fn of_another_version(self) -> Self {
        Self { version: "0.0.0", ..self }
    }

    /// Bytes that no other build has.
    pub(super) fn bytes(&self) -> Vec<u8> {
        format!("{self:?}").into_bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_of_a_build_changes_its_bytes() {
        let build = Build::of_this_program();
        let [os, arch, _] = build.machine;
        let others = [
            Build { version: "0.0.0", ..build.clone() },
            Build { program: "another program", ..build.clone() },
            Build { machine: [os, arch, "none"], ..build.clone() },
            Build { machine: [os, "other", build.machine[2]], ..build.clone() },
        ];
        assert_eq!(build.bytes(), Build::of_this_program().bytes());
        for other in others {
            assert_ne!(build.bytes(), other.bytes());
        }
    }
}
