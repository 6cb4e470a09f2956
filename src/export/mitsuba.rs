//! A slab as a scene of Mitsuba 3: two rough sheets, with the scene's camera and background.
//!
//! The sheets are `roughdielectric` rectangles; their distance is small against their side, as the model of a thin slab
//! asks. Absorption becomes a medium between them.

use std::fmt::Write as _;
use std::path::Path;

use glam::Vec3;

use crate::base::{InputError, Result, replace_file};
use crate::render::{CameraView, RenderScene};
use crate::scene::{Background, LoadedScene, RoughFace, SlabFace, SlabSpec};

/// Ending of the file name that selects this format.
pub const ENDING: &str = "_mitsuba.xml";
/// Distance of the sheets, whose side is 2 [world units].
const GAP: f64 = 0.002;
/// Pixels of the image.
const SIZE: [usize; 2] = [384, 384];
/// Half side of the rectangle that stands for an endless plane [world units].
const PLANE: f32 = 50.0;

/// Writes the scene.
///
/// # Errors
/// A slab that Mitsuba has no material for, or a path that cannot be written.
pub fn write(loaded: &LoadedScene, path: &Path) -> Result<()> {
    replace_file(path, text(loaded)?.as_bytes())
}

/// Checks that Mitsuba has materials for the slab of a scene.
///
/// # Errors
/// The kind of a face, an index per channel, or a diffuse part that Mitsuba's materials cannot hold.
pub fn check(loaded: &LoadedScene) -> Result<&SlabSpec> {
    let refuse = |place: &str, found: String, expected: &str| Err(InputError::new(place, found, expected).into());
    let Some(slab) = &loaded.scene.slab else {
        return refuse("slab", "nothing".to_owned(), "a slab, which a scene of Mitsuba shows");
    };
    for (side, face) in slab.faces() {
        if matches!(face, SlabFace::Table(_) | SlabFace::Tile(_)) {
            let expected = "smooth, beckmann or ggx, for which Mitsuba has materials";
            return refuse(&format!("slab.{side}.kind"), format!("`{}`", face.kind()), expected);
        }
    }
    if slab.eta != Vec3::splat(slab.eta.x) {
        return refuse("slab.eta", format!("{}", slab.eta), "one index, because Mitsuba's materials have one");
    }
    if slab.diffuse != Vec3::ZERO {
        return refuse("slab.diffuse", format!("{}", slab.diffuse), "0, because two sheets have no diffuse part");
    }
    if let Some(Background::Image(_)) = loaded.scene.background {
        return refuse("background.kind", "`image`".to_owned(), "checkerboard or environment");
    }
    Ok(slab)
}

fn text(loaded: &LoadedScene) -> Result<String> {
    let slab = check(loaded)?;
    let mut out = String::from("<scene version=\"3.0.0\">\n");
    let depth = slab.absorption * slab.thickness;
    let absorbs = depth.max_element() > 0.0;
    let kind = if absorbs { "volpath" } else { "path" };
    let _ = writeln!(out, "  <integrator type=\"{kind}\"><integer name=\"max_depth\" value=\"32\"/></integrator>");
    out.push_str(&sensor(loaded)?);
    let medium = if absorbs {
        // Mitsuba takes colours up to 1, and a factor.
        let scale = f64::from(depth.max_element());
        let sigma = depth.as_dvec3() / scale;
        format!(
            "    <medium name=\"interior\" type=\"homogeneous\">\n      <rgb name=\"sigma_t\" value=\"{}, {}, {}\"/>\n      \
             <rgb name=\"albedo\" value=\"0, 0, 0\"/>\n      <float name=\"scale\" value=\"{}\"/>\n    </medium>\n",
            sigma.x,
            sigma.y,
            sigma.z,
            scale / GAP
        )
    } else {
        String::new()
    };
    let eta = slab.eta.x;
    out.push_str(&sheet(&slab.top, eta, &medium, true));
    out.push_str(&sheet(&slab.bottom, eta, &medium, false));
    if let Some(Background::Checkerboard(board)) = &loaded.scene.background {
        let rgb = |color: Vec3| format!("{}, {}, {}", color.x, color.y, color.z);
        // The texture has two squares per unit of its coordinates, which run from 0 to 1 over the rectangle.
        let repeats = PLANE / board.size;
        let _ = write!(
            out,
            "  <shape type=\"rectangle\">\n    <transform name=\"to_world\"><scale x=\"{PLANE}\" y=\"{PLANE}\"/><translate z=\"{}\"/></transform>\n    \
             <emitter type=\"area\"><texture type=\"checkerboard\" name=\"radiance\">\n      <rgb name=\"color0\" value=\"{}\"/>\n      \
             <rgb name=\"color1\" value=\"{}\"/>\n      <transform name=\"to_uv\"><translate x=\"-0.5\" y=\"-0.5\"/><scale x=\"{repeats}\" \
             y=\"{repeats}\"/></transform>\n    </texture></emitter>\n  </shape>\n",
            -board.distance - GAP as f32,
            rgb(board.colors[1]),
            rgb(board.colors[0]),
        );
    }
    out.push_str("  <emitter type=\"constant\"><rgb name=\"radiance\" value=\"1, 1, 1\"/></emitter>\n</scene>\n");
    Ok(out)
}

/// The camera of the scene, as it frames the sheet.
fn sensor(loaded: &LoadedScene) -> Result<String> {
    let mut with_sheet = loaded.clone();
    with_sheet.scene.object = crate::scene::Object { kind: "sheet".to_owned(), path: None };
    let render_scene = RenderScene::new(&with_sheet)?;
    let view = CameraView::new(&render_scene.camera, render_scene.mesh(), SIZE)?;
    let point = |v: Vec3| format!("{}, {}, {}", v.x, v.y, v.z);
    let degrees = 2.0 * view.tan_half_fov.x.atan().to_degrees();
    Ok(format!(
        "  <sensor type=\"perspective\">\n    <float name=\"fov\" value=\"{degrees}\"/>\n    <string name=\"fov_axis\" value=\"x\"/>\n    \
         <transform name=\"to_world\"><lookat origin=\"{}\" target=\"{}\" up=\"{}\"/></transform>\n    \
         <film type=\"hdrfilm\"><integer name=\"width\" value=\"{}\"/><integer name=\"height\" value=\"{}\"/>\
         <rfilter type=\"box\"/></film>\n    <sampler type=\"independent\"><integer name=\"sample_count\" value=\"256\"/></sampler>\n  </sensor>\n",
        point(view.eye),
        point(view.eye - view.back),
        point(view.up),
        SIZE[0],
        SIZE[1]
    ))
}

/// One face, whose outer side is up (top) or down (bottom).
fn sheet(face: &SlabFace, eta: f32, medium: &str, is_top: bool) -> String {
    let (distribution, RoughFace { roughness, rotation_deg }) = match face {
        SlabFace::Beckmann(face) => ("beckmann", face.clone()),
        SlabFace::Ggx(face) => ("ggx", face.clone()),
        _ => ("", RoughFace { roughness: glam::Vec2::ZERO, rotation_deg: 0.0 }),
    };
    let bsdf = if roughness.max_element() > 0.0 {
        format!(
            "<bsdf type=\"roughdielectric\"><string name=\"distribution\" value=\"{distribution}\"/><float name=\"int_ior\" value=\"{eta}\"/>\
             <float name=\"ext_ior\" value=\"1\"/><float name=\"alpha_u\" value=\"{}\"/><float name=\"alpha_v\" value=\"{}\"/></bsdf>",
            roughness.x.max(1e-4),
            roughness.y.max(1e-4)
        )
    } else {
        format!(
            "<bsdf type=\"dielectric\"><float name=\"int_ior\" value=\"{eta}\"/><float name=\"ext_ior\" value=\"1\"/></bsdf>"
        )
    };
    // Mirrored about y, the bottom's normal points down; its axes turn the other way.
    let (turn, flip, z) = if is_top {
        (f64::from(rotation_deg), "", 0.0)
    } else {
        (-f64::from(rotation_deg), "<rotate y=\"1\" angle=\"180\"/>", -GAP)
    };
    // The rectangle is large, so that its own rotation does not show: the roughness follows its axes.
    format!(
        "  <shape type=\"rectangle\">\n    <transform name=\"to_world\"><scale value=\"1.5\"/><rotate z=\"1\" angle=\"{turn}\"/>{flip}<translate z=\"{z}\"/></transform>\n    \
         {bsdf}\n{medium}  </shape>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene;

    #[test]
    fn the_scene_holds_both_faces_the_medium_and_the_background() {
        let loaded = scene::open(
            "slab_fig3_both",
            &["slab.absorption=0.5".into(), "slab.thickness=2.0".into(), "slab.top.rotation_deg=30".into()],
        )
        .unwrap();
        let text = text(&loaded).unwrap();
        assert_eq!(text.matches("roughdielectric").count(), 2);
        assert!(text.contains("sigma_t\" value=\"1, 1, 1\"") && text.contains("volpath"), "{text}");
        assert!(text.contains("type=\"checkerboard\"") && text.contains("angle=\"30\""));
    }

    #[test]
    fn a_slab_without_a_material_of_mitsuba_is_refused_by_its_key() {
        for (overrides, place) in [
            (vec!["slab.eta=[1.4, 1.5, 1.6]"], "slab.eta"),
            (vec!["slab.diffuse=0.1"], "slab.diffuse"),
            (vec!["slab.bottom={ kind = \"tile\" }"], "slab.bottom.kind"),
        ] {
            let overrides: Vec<String> = overrides.into_iter().map(str::to_owned).collect();
            let error = check(&scene::open("slab_fig3_both", &overrides).unwrap()).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains(place), "{error}");
        }
    }
}
