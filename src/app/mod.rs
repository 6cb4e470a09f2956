//! The desktop editor. It uses the library; the library does not depend on it.
//!
//! ```text
//! panels, views ─▶ Document ─▶ workers (draft ─▶ refined) ─▶ views
//! ```
//! The interface never waits: workers report results over channels and request a repaint.

mod actions;
mod background;
mod dialogs;
mod document;
mod editor;
mod event_queue;
mod execute;
mod incoming;
mod layout;
mod left_out;
mod measurements;
mod menu;
mod messages;
mod paint;
mod painting;
mod panels;
mod pick;
mod python_lines;
mod results;
mod start_times;
mod status;
mod status_state;
#[cfg(test)]
mod tests;
mod theme;
mod views;
mod window;
mod worker;

pub use start_times::StartTimes;
pub use window::run;
