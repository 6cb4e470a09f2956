//! The HTML page of a report.

use std::fmt::Write as _;

use super::svg::{COLORS, Chart, LogAxis, escape, number, stacked_bars};
use super::thumbnails::scale_strip;
use super::{Report, SceneReport, conclusions};
use crate::tuning::candidates::Family;
use crate::tuning::sweep::{BANDS_DEG, SweepPoint, pareto};

const STYLE: &str = "
:root { color-scheme: light dark; --ink: #1b1f24; --soft: #59636e; --line: #d9dee4; --card: #fff; --page: #f5f6f8; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e9ed; --soft: #9aa4af; --line: #3a424c; --card: #1d2228; --page: #14171b; } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--page); margin: 0 auto; max-width: 1380px; padding: 24px; }
h1 { font-size: 26px; margin: 0; } h2 { font-size: 21px; margin: 40px 0 8px; } h3 { font-size: 15px; margin: 0 0 6px; }
p, li { max-width: 90ch; } .soft { color: var(--soft); }
.grid-of { display: grid; grid-template-columns: repeat(auto-fit, minmax(430px, 1fr)); gap: 16px; }
.card { background: var(--card); border: 1px solid var(--line); border-radius: 8px; padding: 14px; }
svg { width: 100%; height: auto; } .grid { stroke: var(--line); } .tick { font-size: 12px; fill: var(--soft); }
.label { font-size: 13px; fill: var(--ink); } .mark { font-size: 13px; font-weight: 600; }
table { border-collapse: collapse; width: 100%; font-size: 13px; } th, td { text-align: right; padding: 3px 8px; border-bottom: 1px solid var(--line); }
th:first-child, td:first-child, .left { text-align: left; } code { font-size: 12px; }
.thumbs { display: flex; flex-wrap: wrap; gap: 14px; } .thumbs figure { margin: 0; width: 150px; } .thumbs img { width: 150px; border-radius: 4px; display: block; margin-bottom: 4px; }
.strip { font-size: 12px; color: var(--soft); } .strip span { display: inline-block; width: 16px; height: 10px; }
details { margin-top: 12px; }
";

pub fn page(report: &Report) -> String {
    let mut html = String::new();
    let names: Vec<String> = report.scenes.iter().map(|scene| escape(&scene.name)).collect();
    let _ = write!(
        html,
        "<!doctype html><html lang='en'><meta charset='utf-8'><meta name='viewport' content='width=device-width'><title>biscale: accuracy against time</title><style>{STYLE}</style><body>\
         <h1>Accuracy against time</h1><p class='soft'>biscale {} on {} ({} threads). Made by <code>{}</code>. Times hold on that machine only.</p>\
         <p>Each dot is one choice of settings. It shows the time from an edit of the geometry to the effective BRDF, and the error against the reference (exact rays, exact BRDFs, no tables). Scenes: {}.</p>",
        escape(&report.machine.version),
        escape(&report.machine.processor),
        report.machine.threads,
        escape(&report.command),
        names.join(", ")
    );
    for scene in &report.scenes {
        section(&mut html, scene);
    }
    html.push_str("</body></html>\n");
    html
}

fn section(html: &mut String, scene: &SceneReport) {
    let _ = write!(
        html,
        "<h2>{}</h2><p class='soft'>{}{}</p>",
        escape(&scene.name),
        reference(scene),
        if scene.left_out > 0 {
            format!(" {} settings were left out because the time was over.", scene.left_out)
        } else {
            String::new()
        }
    );
    if !scene.has_reference() {
        html.push_str("<div class='grid-of'>");
        card(html, "Error against time", &error_against_time(scene));
        html.push_str("</div>");
        table(html, scene);
        return;
    }
    html.push_str("<ul>");
    for sentence in conclusions::of(scene) {
        let _ = write!(html, "<li>{}</li>", escape(&sentence));
    }
    html.push_str("</ul><div class='grid-of'>");
    card(html, "Error against time", &error_against_time(scene));
    card(html, "One setting at a time", &error_per_setting(scene));
    if let Some(chart) = crossing(scene) {
        card(html, "Direct sum or factors", &chart);
    }
    card(html, "Error by angle (the larger of the two, from the normal)", &error_by_angle(scene));
    card(html, "Time of each stage", &stage_times(scene));
    if !scene.thumbnails.is_empty() {
        card(html, "Images", &thumbnails(scene));
    }
    html.push_str("</div>");
    table(html, scene);
}

fn reference(scene: &SceneReport) -> String {
    if !scene.has_reference() {
        return "The reference is not computed yet. The errors are those that the results state; bars span half to one and a half times of them. Load this page again to see them against the reference.".to_owned();
    }
    format!(
        "Reference: {} direction pairs up to 85°, {} passes in {} s; its standard error is {} % relative L2, which is subtracted in squares. Bars show what is left of it.",
        scene.pairs,
        scene.reference_passes,
        number(scene.reference_seconds),
        number(scene.reference_error * 100.0)
    )
}

fn card(html: &mut String, title: &str, body: &str) {
    let _ = write!(html, "<div class='card'><h3>{}</h3>{body}</div>", escape(title));
}

fn family_name(point: &SweepPoint) -> String {
    match &point.family {
        Family::Preset => "preset".to_owned(),
        Family::Setting(name) => format!("setting {name}"),
        Family::QualityScale => "quality level".to_owned(),
        Family::Combination => "combination".to_owned(),
    }
}

fn title(point: &SweepPoint) -> String {
    format!(
        "{}: {} ms, {:.1} dB, {} %, {}",
        point.settings,
        number(point.ms),
        point.psnr_db,
        number(point.rel_l2 * 100.0),
        point.representation
    )
}

/// Relative L2 error in percent as it is drawn, at least 0.01.
fn percent(point: &SweepPoint) -> f64 {
    drawn(point.rel_l2)
}

fn drawn(rel_l2: f64) -> f64 {
    (rel_l2 * 100.0).max(0.01)
}

fn axes(points: &[SweepPoint]) -> (LogAxis, LogAxis) {
    (LogAxis::over(points.iter().map(|point| point.ms)), LogAxis::over(points.iter().map(percent)))
}

fn error_against_time(scene: &SceneReport) -> String {
    let (x, y) = axes(&scene.points);
    let mut chart =
        Chart::new(x, "milliseconds from a geometry edit to the effective BRDF", y, "relative L2 error [%]");
    let ours: Vec<&SweepPoint> =
        scene.points.iter().filter(|point| point.preset != "wu2011" && point.preset != "reference").collect();
    let front: Vec<(f64, f64)> = pareto(&ours).into_iter().map(|k| (ours[k].ms, percent(ours[k]))).collect();
    chart.line(&front, COLORS[4], false);
    let color = |point: &SweepPoint| match point.family {
        Family::Preset => COLORS[5],
        Family::Combination => COLORS[7],
        Family::QualityScale => COLORS[2],
        Family::Setting(_) => COLORS[0],
    };
    for point in &scene.points {
        let ends = [-1.0, 1.0].map(|side| drawn(point.rel_l2 + side * point.rel_l2_std_error));
        chart.error_bar(point.ms, ends, color(point));
    }
    for point in scene.points.iter().filter(|point| point.family != Family::Preset) {
        let color = color(point);
        chart.dot(point.ms, percent(point), 3.5, color, &title(point));
    }
    for point in scene.points.iter().filter(|point| point.family == Family::Preset) {
        chart.dot(point.ms, percent(point), 6.0, COLORS[5], &title(point));
        chart.label(point.ms, percent(point), COLORS[5], &point.preset);
    }
    format!(
        "{}<p class='soft'>Blue: one setting varied. Green: quality levels, as --target-db and --budget-ms choose them. Grey: all settings varied at once. Line: no other point is both faster and more accurate.</p>",
        chart.finish()
    )
}

fn error_per_setting(scene: &SceneReport) -> String {
    let setting_of = |point: &SweepPoint| match &point.family {
        Family::Setting(name) => Some(name.clone()),
        _ => None,
    };
    let points: Vec<&SweepPoint> = scene.points.iter().filter(|point| setting_of(point).is_some()).collect();
    let (x, y) = axes(&points.iter().map(|point| (*point).clone()).collect::<Vec<_>>());
    let mut chart = Chart::new(x, "milliseconds", y, "relative L2 error [%]");
    let mut names: Vec<String> = Vec::new();
    for name in points.iter().filter_map(|point| setting_of(point)) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    for (k, name) in names.iter().enumerate() {
        let color = COLORS[k % COLORS.len()];
        let line: Vec<&&SweepPoint> = points.iter().filter(|point| setting_of(point).as_ref() == Some(name)).collect();
        chart.line(&line.iter().map(|point| (point.ms, percent(point))).collect::<Vec<_>>(), color, false);
        for point in &line {
            chart.dot(point.ms, percent(point), 3.5, color, &title(point));
        }
    }
    let legend: Vec<String> = names
        .iter()
        .enumerate()
        .map(|(k, name)| format!("<span style='color:{}'>●</span> {}", COLORS[k % COLORS.len()], escape(name)))
        .collect();
    format!("{}<p class='soft'>{}</p>", chart.finish(), legend.join(" &nbsp; "))
}

fn crossing(scene: &SceneReport) -> Option<String> {
    let crossing = conclusions::crossing(scene)?;
    let ms = |point: &SweepPoint, pairs: f64| point.ms + pairs * point.query_us * 1e-3;
    let pairs: Vec<f64> = (4..=32).map(|k| 10_f64.powf(f64::from(k) * 0.25)).collect();
    let lines = [crossing.direct, crossing.low_rank].map(|p| pairs.iter().map(|&n| (n, ms(p, n))).collect::<Vec<_>>());
    let values = lines.iter().flatten().map(|point| point.1);
    let mut chart = Chart::new(
        LogAxis::over(pairs.iter().copied()),
        "direction pairs evaluated",
        LogAxis::over(values),
        "total milliseconds, one thread",
    );
    for (line, (color, name)) in lines.iter().zip([(COLORS[0], "direct sum"), (COLORS[1], "factors")]) {
        chart.line(line, color, false);
        if let Some(&(x, y)) = line.get(line.len() - 6) {
            chart.label(x, y, color, name);
        }
    }
    Some(format!("{}<p class='soft'>{}</p>", chart.finish(), escape(&crossing.sentence)))
}

fn error_by_angle(scene: &SceneReport) -> String {
    let presets: Vec<&SweepPoint> = scene.points.iter().filter(|point| point.family == Family::Preset).collect();
    let mut rows = String::from("<table><tr><th>preset</th>");
    let mut from = 0.0;
    for end in BANDS_DEG {
        let _ = write!(rows, "<th>{from}° to {end}°</th>");
        from = end;
    }
    rows.push_str("<th>albedo</th></tr>");
    for point in presets {
        let _ = write!(rows, "<tr><td>{}</td>", escape(&point.preset));
        for error in point.rel_l2_by_angle {
            let _ = write!(rows, "<td>{} %</td>", number(error * 100.0));
        }
        let _ = write!(rows, "<td>{} %</td></tr>", number(point.albedo_error * 100.0));
    }
    format!(
        "{rows}</table><p class='soft'>Albedo: the largest relative error of the directional albedo, for light at 10°, 45° and 75°.</p>"
    )
}

fn stage_times(scene: &SceneReport) -> String {
    let rows: Vec<(String, Vec<(String, f64)>)> = scene
        .points
        .iter()
        .filter(|point| point.family == Family::Preset && point.preset != "reference")
        .map(|point| (point.preset.clone(), point.stages.clone()))
        .collect();
    stacked_bars(&rows)
}

fn thumbnails(scene: &SceneReport) -> String {
    let mut html = String::from("<div class='thumbs'>");
    for thumb in &scene.thumbnails {
        let _ = write!(html, "<figure><img alt='{0} image' src='{1}'>", escape(&thumb.label), thumb.image);
        if let Some(difference) = &thumb.difference {
            let _ = write!(
                html,
                "<img alt='difference' src='{difference}'><figcaption><b>{}</b><br><span class='soft'>ΔE mean {}, 95 % below {}</span></figcaption>",
                escape(&thumb.label),
                number(f64::from(thumb.mean_delta_e)),
                number(f64::from(thumb.high_delta_e))
            );
        } else {
            let _ = write!(html, "<figcaption><b>{}</b></figcaption>", escape(&thumb.label));
        }
        html.push_str("</figure>");
    }
    format!(
        "{html}</div><p>{} <span class='soft'>(CIE 1976; a ΔE of about 2 is just visible side by side)</span></p>",
        scale_strip()
    )
}

fn table(html: &mut String, scene: &SceneReport) {
    html.push_str("<details><summary>All settings</summary><table><tr><th>settings</th><th class='left'>kind</th><th>ms</th><th>µs per pair</th><th>relative L2</th><th>PSNR</th><th class='left'>representation</th></tr>");
    let mut points: Vec<&SweepPoint> = scene.points.iter().collect();
    points.sort_by(|a, b| a.ms.total_cmp(&b.ms));
    for point in points {
        let _ = write!(
            html,
            "<tr><td><code>{}</code></td><td class='left'>{}</td><td>{}</td><td>{}</td><td>{} %</td><td>{:.1} dB</td><td class='left'>{}</td></tr>",
            escape(&point.settings),
            family_name(point),
            number(point.ms),
            number(point.query_us),
            number(point.rel_l2 * 100.0),
            point.psnr_db,
            escape(&point.representation)
        );
    }
    html.push_str("</table></details>");
}
