//! The desktop editor. It knows the library; the library does not know it.
//!
//! ```text
//! panels, views ─▶ Document ─▶ workers (draft ─▶ refined) ─▶ views
//! ```
//! The interface never waits: workers answer over channels and wake it.

mod actions;
mod answers;
mod background;
mod dialogs;
mod document;
mod editor;
mod incoming;
mod layout;
mod menu;
mod messages;
mod paint;
mod painting;
mod panels;
mod perform;
mod pick;
mod start_times;
mod status;
#[cfg(test)]
mod tests;
mod theme;
mod views;
mod window;
mod worker;

pub use start_times::StartTimes;
pub use window::run;
