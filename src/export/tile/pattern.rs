//! Patterns to cut, fold and glue: a paper strip for grooves, nets and a floor for pyramids, a sheet for a flat tile.

use glam::{DVec2, DVec3, Vec3};

use super::page::{Line, Page};
use super::{TileOptions, paper_color};
use crate::base::{InputError, Progress, Result, progress};
use crate::geometry::{self, GrooveCrossSection, PyramidLayout};
use crate::scene::{Geometry, Scene, Tile};

/// Width of a glue tab, millimetres.
const TAB_MM: f64 = 6.0;
/// Bounds the angle of an edge without a fold line: the cosine of 12°.
const BEND_COSINE: f64 = 0.978;
/// Bounds the number of nets on one sheet.
const MAX_NETS: usize = 200;

/// Draws the sheet of a scene's tile with `unit_mm` millimetres per tile unit, and returns it with notes.
///
/// # Errors
/// A geometry that does not unfold, too many nets, or [`crate::base::Error::Cancelled`] if `progress` cancels.
pub fn sheet(
    scene: &Scene,
    options: &TileOptions,
    unit_mm: f64,
    progress: &Progress<'_>,
) -> Result<(Page, Vec<String>)> {
    let scale = unit_mm * f64::from(options.scale);
    let size = scene.tile.size;
    match &scene.tile.geometry {
        Geometry::Grooves(spec) => {
            let section = GrooveCrossSection::of(spec, size);
            let colors = [paper_color(scene, "bottom")?, paper_color(scene, "sides")?];
            grooves(&section, options, scale, &colors, progress)
        }
        Geometry::Pyramids(spec) => {
            let one = PyramidLayout::of(spec, size);
            let colors = [paper_color(scene, "faces")?, paper_color(scene, "floor")?];
            pyramids(&one, size.as_dvec2(), options, scale, &colors)
        }
        Geometry::Flat(_) => plane(scene, options, scale, progress),
        other => {
            let expected = "grooves, pyramids or flat, which unfold";
            Err(InputError::new("tile.geometry.kind", other.kind(), expected).into())
        }
    }
}

/// Draws the strip of a groove tile. Ridges point towards the reader, so that the printed side is visible.
fn grooves(
    section: &GrooveCrossSection,
    options: &TileOptions,
    scale: f64,
    colors: &[Vec3; 2],
    progress: &Progress<'_>,
) -> Result<(Page, Vec<String>)> {
    let length = section.length * f64::from(options.repeat.y) * scale;
    let periods = section.count * options.repeat.x as usize;
    let mut page = Page::default();
    let (mut x, mut previous) = (0.0, None::<DVec2>);
    for period in 0..periods {
        progress::step(progress, period, periods)?;
        for pair in section.points.windows(2) {
            let along = (pair[1].0 - pair[0].0) * scale;
            let width = along.length();
            if width < 1e-9 {
                continue;
            }
            let corners =
                [DVec2::new(x, 0.0), DVec2::new(x + width, 0.0), DVec2::new(x + width, length), DVec2::new(x, length)];
            page.polygon(corners, Some(colors[usize::from(pair[0].1)]), Line::None);
            if let Some(previous) = previous {
                let direction = along / width;
                if previous.dot(direction) < BEND_COSINE {
                    let line = if previous.perp_dot(direction) > 0.0 { Line::Valley } else { Line::Mountain };
                    page.segment(DVec2::new(x, 0.0), DVec2::new(x, length), line);
                }
            }
            previous = Some(along / width);
            x += width;
        }
    }
    let corner = |x: f64, y: f64| DVec2::new(x, y);
    page.polygon([corner(0.0, 0.0), corner(x, 0.0), corner(x, length), corner(0.0, length)], None, Line::Cut);
    tab(&mut page, corner(0.0, length), corner(0.0, 0.0));
    tab(&mut page, corner(x, 0.0), corner(x, length));
    // Marks for the base: the start of each period of the folded strip.
    let pitch = section.pitch * scale;
    let y = length + 2.0 * TAB_MM;
    for k in 0..=periods {
        page.segment(corner(k as f64 * pitch, y), corner(k as f64 * pitch, y + 8.0), Line::Cut);
    }
    page.segment(corner(0.0, y), corner(periods as f64 * pitch, y), Line::Cut);
    page.text(corner(0.0, y + 14.0), format!("glue the folded strip along these marks: {pitch:.2} mm a groove"));
    legend(&mut page, corner(0.0, y + 22.0));
    let notes = vec![format!(
        "{periods} grooves: a strip of {x:.2} x {length:.2} mm folds to {:.2} x {length:.2} mm",
        periods as f64 * pitch
    )];
    Ok((page, notes))
}

fn legend(page: &mut Page, at: DVec2) {
    let lines = [
        (Line::Cut, "cut"),
        (Line::Mountain, "fold to a ridge"),
        (Line::Valley, "fold to a valley"),
        (Line::Mark, "glue here"),
    ];
    for (k, (line, label)) in lines.into_iter().enumerate() {
        let at = at + DVec2::new(0.0, 5.0 * k as f64);
        page.segment(at, at + DVec2::new(15.0, 0.0), line);
        page.text(at + DVec2::new(18.0, 1.0), label);
    }
}

/// Draws a glue tab, its outline and its fold, on the left of the edge from `from` to `to` as viewed on the sheet.
fn tab(page: &mut Page, from: DVec2, to: DVec2) {
    let along = to - from;
    let Some(direction) = along.try_normalize() else { return };
    let outward = DVec2::new(direction.y, -direction.x);
    let width = TAB_MM.min(0.5 * along.length());
    let inset = direction * (0.5 * width);
    page.polygon([from, from + outward * width + inset, to + outward * width - inset, to], None, Line::Cut);
    page.segment(from, to, Line::Mountain);
}

fn pyramids(
    one: &PyramidLayout,
    size: DVec2,
    options: &TileOptions,
    scale: f64,
    colors: &[Vec3; 2],
) -> Result<(Page, Vec<String>)> {
    let periods = options.repeat.as_dvec2();
    let count = one.centres.len() * (options.repeat.x * options.repeat.y) as usize;
    if count > MAX_NETS {
        let found = format!("{count} pyramids");
        return Err(InputError::new("repeat", found, format!("at most {MAX_NETS} on a sheet")).into());
    }
    let mut page = Page::default();
    // The floor, with the outline of each base.
    let extent = size * periods * scale;
    let corner = |x: f64, y: f64| DVec2::new(x, y);
    page.polygon([corner(0.0, 0.0), corner(extent.x, 0.0), extent, corner(0.0, extent.y)], Some(colors[1]), Line::Cut);
    // The tile's y points up, the sheet's y down.
    let on_sheet = |p: DVec2| corner(p.x * scale, extent.y - p.y * scale);
    for y in 0..options.repeat.y {
        for x in 0..options.repeat.x {
            let shift = DVec2::new(f64::from(x), f64::from(y)) * size;
            for centre in &one.centres {
                page.polygon(one.base.iter().map(|p| on_sheet(*p + *centre + shift)), None, Line::Mark);
            }
        }
    }
    let net = Net::of(one, scale);
    let (low, high) = net.bounds();
    let cell = high - low + DVec2::splat(2.0 * TAB_MM + 3.0);
    let columns = ((extent.x.max(180.0)) / cell.x).floor().max(1.0) as usize;
    let top = extent.y + 2.0 * TAB_MM;
    for k in 0..count {
        let at = DVec2::new((k % columns) as f64 * cell.x + TAB_MM, top + (k / columns) as f64 * cell.y + TAB_MM) - low;
        net.draw(&mut page, at, colors[0]);
    }
    let rows = count.div_ceil(columns);
    legend(&mut page, corner(0.0, top + rows as f64 * cell.y + 8.0));
    Ok((page, vec![format!("{count} nets and a floor of {:.2} x {:.2} mm with their places", extent.x, extent.y)]))
}

/// The net of a pyramid, y downwards: a row of side faces that share edges, and the top face on the first.
struct Net {
    faces: Vec<Vec<DVec2>>,
    top: Vec<DVec2>,
}

impl Net {
    fn of(one: &PyramidLayout, scale: f64) -> Self {
        let corners = one.base.len();
        let foot = |k: usize| (one.base[k % corners] * scale).extend(0.0);
        let tip = |k: usize| (one.top[k % corners] * scale).extend(one.top_z * scale);
        let mut faces: Vec<Vec<DVec2>> = Vec::new();
        for k in 0..corners {
            let solid = [foot(k), foot(k + 1), tip(k + 1), tip(k)];
            let flat = match faces.last() {
                None => {
                    unfold(&solid, [foot(k), foot(k + 1)], [DVec2::ZERO, DVec2::new((foot(1) - foot(0)).length(), 0.0)])
                }
                // The edge shared with the last face keeps its position.
                Some(last) => unfold(&solid, [tip(k), foot(k)], [last[2], last[1]]),
            };
            faces.push(flat);
        }
        let solid: Vec<DVec3> = (0..corners).map(tip).collect();
        let first = &faces[0];
        let top = if one.has_top { unfold(&solid, [tip(0), tip(1)], [first[3], first[2]]) } else { Vec::new() };
        // The sheet's y points down.
        let flipped = |points: Vec<DVec2>| points.into_iter().map(|p| DVec2::new(p.x, -p.y)).collect();
        Self { faces: faces.into_iter().map(flipped).collect(), top: flipped(top) }
    }

    fn bounds(&self) -> (DVec2, DVec2) {
        let points = || self.faces.iter().flatten().chain(&self.top);
        (points().copied().fold(DVec2::INFINITY, DVec2::min), points().copied().fold(DVec2::NEG_INFINITY, DVec2::max))
    }

    fn draw(&self, page: &mut Page, at: DVec2, color: Vec3) {
        let moved = |points: &[DVec2]| points.iter().map(|p| *p + at).collect::<Vec<_>>();
        for (k, face) in self.faces.iter().enumerate() {
            let face = moved(face);
            page.polygon(face.iter().copied(), Some(color), Line::None);
            tab(page, face[1], face[0]);
            if k == 0 {
                page.segment(face[3], face[0], Line::Cut);
            }
            if k + 1 < self.faces.len() {
                page.segment(face[1], face[2], Line::Mountain);
            } else {
                tab(page, face[2], face[1]);
            }
            let has_top = k == 0 && !self.top.is_empty();
            page.segment(face[2], face[3], if has_top { Line::Mountain } else { Line::Cut });
        }
        if !self.top.is_empty() {
            let top = moved(&self.top);
            page.polygon(top.iter().copied(), Some(color), Line::None);
            for k in 1..top.len() {
                page.segment(top[k], top[(k + 1) % top.len()], Line::Cut);
            }
        }
    }
}

/// Maps a planar polygon to the sheet (y upwards) so that its `edge` lies on `onto` and its inside is on the left.
fn unfold(polygon: &[DVec3], edge: [DVec3; 2], onto: [DVec2; 2]) -> Vec<DVec2> {
    let along = (edge[1] - edge[0]).normalize_or_zero();
    let across = |p: DVec3| (p - edge[0]) - along * (p - edge[0]).dot(along);
    let farthest =
        polygon.iter().copied().map(across).fold(DVec3::ZERO, |a, b| if b.length() > a.length() { b } else { a });
    let inside = farthest.normalize_or_zero();
    let x = (onto[1] - onto[0]).normalize_or_zero();
    let y = x.perp();
    polygon.iter().map(|p| onto[0] + x * (*p - edge[0]).dot(along) + y * (*p - edge[0]).dot(inside)).collect()
}

fn plane(scene: &Scene, options: &TileOptions, scale: f64, progress: &Progress<'_>) -> Result<(Page, Vec<String>)> {
    // The pattern has no painted images.
    let plain = Tile { color_path: None, slot_path: None, ..scene.tile.clone() };
    let mesh = geometry::build(&plain, std::path::Path::new(""))?;
    let colors: Vec<Vec3> = mesh.slots.iter().map(|slot| paper_color(scene, slot)).collect::<Result<_>>()?;
    let size = mesh.size.as_dvec2();
    let extent = size * options.repeat.as_dvec2() * scale;
    let mut page = Page::default();
    for y in 0..options.repeat.y {
        progress::report(progress, y as f32 / options.repeat.y as f32)?;
        for x in 0..options.repeat.x {
            let shift = DVec2::new(f64::from(x), f64::from(y)) * size;
            for triangle in 0..mesh.triangles.len() {
                let on_sheet = |p: Vec3| {
                    let at = (p.as_dvec3().truncate() + shift) * scale;
                    DVec2::new(at.x, extent.y - at.y)
                };
                let color = colors[usize::from(mesh.triangle_slot[triangle])];
                page.polygon(mesh.corners(triangle).map(on_sheet), Some(color), Line::None);
            }
        }
    }
    page.polygon([DVec2::ZERO, DVec2::new(extent.x, 0.0), extent, DVec2::new(0.0, extent.y)], None, Line::Cut);
    Ok((page, vec![format!("a sheet of {:.2} x {:.2} mm", extent.x, extent.y)]))
}
