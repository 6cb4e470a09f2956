//! Whose results a file holds.

use std::time::UNIX_EPOCH;

use crate::math::simd;

/// What the bits of a result depend on besides its inputs: the code, and the instructions that the processor has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Build {
    version: &'static str,
    /// Length and time [ns] of the running program's file: a rebuilt program makes its own results, whatever its version says.
    program: (u64, u128),
    machine: [&'static str; 3],
}

impl Build {
    /// The running program's; `None` where its file cannot be looked at.
    pub fn of_this_program() -> Option<Self> {
        let file = std::env::current_exe().and_then(std::fs::metadata).ok()?;
        let modified = file.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
        Some(Self {
            version: env!("CARGO_PKG_VERSION"),
            program: (file.len(), modified.as_nanos()),
            machine: [std::env::consts::OS, std::env::consts::ARCH, simd::instructions()],
        })
    }

    #[cfg(test)]
    pub(super) fn of_another_version(self) -> Self {
        Self { version: "0.0.0", ..self }
    }

    /// All of it, as bytes that no other build has.
    pub(super) fn bytes(&self) -> Vec<u8> {
        format!("{self:?}").into_bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_of_a_build_makes_another_one() {
        let build = Build::of_this_program().unwrap();
        let [os, arch, _] = build.machine;
        let others = [
            Build { version: "0.0.0", ..build.clone() },
            Build { program: (build.program.0 + 1, build.program.1), ..build.clone() },
            Build { program: (build.program.0, build.program.1 + 1), ..build.clone() },
            Build { machine: [os, arch, "none"], ..build.clone() },
            Build { machine: [os, "other", build.machine[2]], ..build.clone() },
        ];
        assert_eq!(build.bytes(), Build::of_this_program().unwrap().bytes());
        for other in others {
            assert_ne!(build.bytes(), other.bytes());
        }
    }
}
