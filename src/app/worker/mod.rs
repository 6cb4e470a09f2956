//! Work behind the interface: one thread for the object's picture, one for the tile and its plots, one for thumbnails.

mod picture;
mod runner;
mod studio;
mod tone;

pub use picture::{Grade, Made, PictureAnswer, PictureJob};
pub use runner::Worker;

/// The thread that makes pictures; `None` where the system gives none.
pub fn spawn_picture(answer: impl Fn(PictureAnswer) + Clone + Send + 'static) -> Option<Worker<PictureJob>> {
    let told = answer.clone();
    let work =
        move |kept: &mut picture::Photographer, job, desk: &runner::Desk<PictureJob>| kept.work(job, desk, &answer);
    let panicked = move |text| told(PictureAnswer::Fault(text));
    Worker::spawn("picture", picture::Photographer::default, work, panicked).ok()
}
