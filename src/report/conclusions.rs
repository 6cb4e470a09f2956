//! Sentences that summarize the points of a report. They are a part of `report.json`.

use super::SceneReport;
use super::svg::number;
use crate::plan::Preset;
use crate::tuning::candidates::Family;
use crate::tuning::sweep::{SweepPoint, is_preset, pareto};

/// All sentences about a scene.
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
                point.representation
            ));
        }
    }
    if let Some(paper) = preset(Preset::Wu2011) {
        all.extend(against_the_paper(scene, paper));
    }
    all.extend(crossing(scene).map(|crossing| crossing.sentence));
    all.extend(most_influential_setting(scene));
    all
}

/// All points except the paper's own choices and the reference.
fn own_points(scene: &SceneReport) -> Vec<&SweepPoint> {
    scene
        .points
        .iter()
        .filter(|point| !is_preset(point, Preset::Wu2011) && !is_preset(point, Preset::Reference))
        .collect()
}

/// Compares the Pareto front with the paper's own choices, at their time and at their error.
fn against_the_paper(scene: &SceneReport, paper: &SweepPoint) -> Option<String> {
    let points = own_points(scene);
    let front: Vec<&SweepPoint> = pareto(&points).into_iter().map(|k| points[k]).collect();
    let as_fast = front.iter().rfind(|point| point.ms <= paper.ms);
    let as_good = front.iter().find(|point| point.rel_l2 <= paper.rel_l2);
    let better = as_fast.map(|point| format!("{:.1} dB better in no more time", point.psnr_db - paper.psnr_db));
    let faster = as_good.map(|point| format!("{} times faster at no larger error", number(paper.ms / point.ms)));
    let both: Vec<String> = [better, faster].into_iter().flatten().collect();
    let (ms, error) = (number(paper.ms), number(paper.rel_l2 * 100.0));
    (!both.is_empty()).then(|| {
        format!(
            "The paper's own choices (wu2011) take {ms} ms and leave {:.1} dB, {error} %: the other settings are {}.",
            paper.psnr_db,
            both.join(", and ")
        )
    })
}

/// Comparison of factored and direct evaluation, and the number of pairs for which both cost the same.
pub struct Crossing<'a> {
    pub direct: &'a SweepPoint,
    pub low_rank: &'a SweepPoint,
    pub sentence: String,
}

/// Compares the two points that vary `method` alone.
pub fn crossing(scene: &SceneReport) -> Option<Crossing<'_>> {
    let of = |method: &str| {
        let family = Family::Setting("method".to_owned());
        scene.points.iter().find(|point| point.family == family && point.settings.contains(method))
    };
    let (direct, low_rank) = (of("\"direct\"")?, of("\"low_rank\"")?);
    let (extra_ms, saved_us) = (low_rank.ms - direct.ms, direct.query_us - low_rank.query_us);
    let sentence = if saved_us <= 0.0 {
        "Summing directly is cheaper for any number of direction pairs.".to_owned()
    } else if extra_ms <= 0.0 {
        "Factors are cheaper for any number of direction pairs.".to_owned()
    } else {
        format!(
            "Factors take {} ms longer to make and save {} µs a direction pair: they pay from {:.0} pairs on (one thread). They leave {} %, the direct sum {} %.",
            number(extra_ms),
            number(saved_us),
            extra_ms * 1e3 / saved_us,
            number(low_rank.rel_l2 * 100.0),
            number(direct.rel_l2 * 100.0)
        )
    };
    Some(Crossing { direct, low_rank, sentence })
}

/// Names the setting whose range changes the error most.
fn most_influential_setting(scene: &SceneReport) -> Option<String> {
    // Name, smallest and largest error.
    let mut settings: Vec<(&str, f64, f64)> = Vec::new();
    for point in &scene.points {
        let Family::Setting(name) = &point.family else { continue };
        if name == "method" {
            continue;
        }
        match settings.iter_mut().find(|setting| setting.0 == name) {
            Some(setting) => (setting.1, setting.2) = (setting.1.min(point.rel_l2), setting.2.max(point.rel_l2)),
            None => settings.push((name, point.rel_l2, point.rel_l2)),
        }
    }
    let most = settings.into_iter().max_by(|a, b| (a.2 / a.1).total_cmp(&(b.2 / b.1)))?;
    Some(format!(
        "The setting that matters most here is {}: over its range the error goes from {} % to {} %.",
        most.0,
        number(most.2 * 100.0),
        number(most.1 * 100.0)
    ))
}
