//! Settings chosen by measurement: quality levels, targets in dB or milliseconds, and sweeps over the settings.

pub mod candidates;
pub mod choose;
pub mod progressive;
pub mod quality_scale;
pub mod sweep;
mod target_reference;
pub mod timed_result;
