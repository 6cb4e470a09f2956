//! What the points say, in sentences.

use super::SceneReport;
use super::svg::number;
use crate::plan::Preset;
use crate::tuning::candidates::Family;
use crate::tuning::sweep::{Point, is_preset, pareto};

/// A sentence each.
pub fn of(scene: &SceneReport) -> Vec<String> {
    let mut all = Vec::new();
    let preset = |preset: Preset| scene.points.iter().find(|point| is_preset(point, preset));
    for name in [Preset::Draft, Preset::Standard, Preset::Fine] {
        if let Some(point) = preset(name) {
            all.push(format!(
                "{} answers a geometry edit in {} ms at {:.1} dB ({} % relative L2), {}.",
                name.name(),
                number(point.ms),
                point.psnr_db,
                number(point.rel_l2 * 100.0),
                point.form
            ));
        }
    }
    if let Some(paper) = preset(Preset::Wu2011) {
        all.extend(against_the_paper(scene, paper));
    }
    all.extend(crossing(scene).map(|crossing| crossing.sentence));
    all.extend(best_knob(scene));
    all
}

fn ours(scene: &SceneReport) -> Vec<&Point> {
    scene
        .points
        .iter()
        .filter(|point| !is_preset(point, Preset::Wu2011) && !is_preset(point, Preset::Reference))
        .collect()
}

/// The front at the time of the paper's own choices, and at their error.
fn against_the_paper(scene: &SceneReport, paper: &Point) -> Option<String> {
    let ours = ours(scene);
    let front: Vec<&Point> = pareto(&ours).into_iter().map(|k| ours[k]).collect();
    let as_fast = front.iter().rfind(|point| point.ms <= paper.ms);
    let as_good = front.iter().find(|point| point.rel_l2 <= paper.rel_l2);
    let better = as_fast.map(|point| format!("{:.1} dB better in no more time", point.psnr_db - paper.psnr_db));
    let faster = as_good.map(|point| format!("{} times faster at no larger error", number(paper.ms / point.ms)));
    let both: Vec<String> = [better, faster].into_iter().flatten().collect();
    let (ms, error) = (number(paper.ms), number(paper.rel_l2 * 100.0));
    (!both.is_empty()).then(|| {
        format!(
            "The paper's own choices (wu2011) take {ms} ms and leave {:.1} dB, {error} %: ours are {}.",
            paper.psnr_db,
            both.join(", and ")
        )
    })
}

/// Where factored and direct evaluation cost the same.
pub struct Crossing<'a> {
    pub direct: &'a Point,
    pub low_rank: &'a Point,
    pub sentence: String,
}

/// Compares the two points of the knob `method`.
pub fn crossing(scene: &SceneReport) -> Option<Crossing<'_>> {
    let of = |method: &str| {
        let knob = Family::Knob("method".to_owned());
        scene.points.iter().find(|point| point.family == knob && point.settings.contains(method))
    };
    let (direct, low_rank) = (of("\"direct\"")?, of("\"low_rank\"")?);
    let (dearer, cheaper) = (low_rank.ms - direct.ms, direct.query_us - low_rank.query_us);
    let sentence = if cheaper <= 0.0 {
        "Summing directly is cheaper for any number of direction pairs.".to_owned()
    } else if dearer <= 0.0 {
        "Factors are cheaper for any number of direction pairs.".to_owned()
    } else {
        format!(
            "Factors take {} ms longer to make and save {} µs a direction pair: they pay from {:.0} pairs on (one thread). They leave {} %, the direct sum {} %.",
            number(dearer),
            number(cheaper),
            dearer * 1e3 / cheaper,
            number(low_rank.rel_l2 * 100.0),
            number(direct.rel_l2 * 100.0)
        )
    };
    Some(Crossing { direct, low_rank, sentence })
}

/// The knob whose range changes the error most.
fn best_knob(scene: &SceneReport) -> Option<String> {
    let mut knobs: Vec<(&str, f64, f64)> = Vec::new();
    for point in &scene.points {
        let Family::Knob(name) = &point.family else { continue };
        if name == "method" {
            continue;
        }
        match knobs.iter_mut().find(|knob| knob.0 == name) {
            Some(knob) => (knob.1, knob.2) = (knob.1.min(point.rel_l2), knob.2.max(point.rel_l2)),
            None => knobs.push((name, point.rel_l2, point.rel_l2)),
        }
    }
    let most = knobs.into_iter().max_by(|a, b| (a.2 / a.1).total_cmp(&(b.2 / b.1)))?;
    Some(format!(
        "The knob that matters most here is {}: over its range the error goes from {} % to {} %.",
        most.0,
        number(most.2 * 100.0),
        number(most.1 * 100.0)
    ))
}
