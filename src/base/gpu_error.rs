//! Errors of the GPU.

/// The reason why work did not run on the GPU. In every case the CPU can do the work instead.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    #[error(
        "no graphics adapter found; install a Vulkan driver (Debian, Ubuntu: `apt install mesa-vulkan-drivers` \
         also has a software one; Fedora: `dnf install mesa-vulkan-drivers`), or use `--backend cpu`"
    )]
    NoAdapter(
        /// Message of wgpu.
        String,
    ),
    #[error("the graphics adapter {adapter} gave no device: {reason}; update its driver, or use `--backend cpu`")]
    NoDevice { adapter: String, reason: String },
    #[error("the GPU was lost ({0}); start again, or use `--backend cpu`")]
    Lost(String),
    #[error("out of graphics memory while {0}; lower the resolution, or use `--backend cpu`")]
    OutOfMemory(String),
    #[error("the graphics adapter allows {allowed} bytes for {what}, but {needed} are needed; use `--backend cpu`")]
    TooLarge { what: String, needed: u64, allowed: u64 },
    #[error("the graphics driver refused while {during}: {reason}")]
    Refused { during: String, reason: String },
    #[error("the GPU did not respond within {seconds} s while {during}")]
    Timeout { during: String, seconds: u64 },
    /// Work that only the CPU does, and the reason.
    #[error("the GPU does not support this: {0}; use `--backend cpu`")]
    Unsupported(String),
    #[error("no shader is called `{0}`")]
    UnknownShader(String),
}

impl From<GpuError> for super::Error {
    fn from(error: GpuError) -> Self {
        Self::Gpu(error)
    }
}
