//! Capture of spatially varying slabs from photographs of a sheet before a monitor (Dai et al. 2009, Sec. 4).
//!
//! The sheet lies in the plane z = 0 with its middle at the origin, the monitor at z = `distance`, and the cameras below.
//! Columns of images run along +x and rows along +y. Lengths are metres.

pub mod alpha;
pub mod bounced;
pub mod clusters;
pub mod fit;
#[cfg(test)]
pub(crate) mod hard_cases_tests;
pub mod inspection;
pub mod lobe;
pub mod patterns;
pub mod photographs;
pub mod points;
pub mod push_pull;
pub mod radiance;
pub mod rig;
pub mod sheet;
pub mod simulated;
pub mod svbtdf;
#[cfg(test)]
mod svbtdf_tests;
#[cfg(test)]
mod tests;
