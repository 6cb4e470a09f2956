//! Hard lights and objects: every pixel is finite and not negative, and energy is conserved.

use std::path::{Path, PathBuf};

use biscale::effective::Reflectance;
use biscale::math::directions::from_angles;
use biscale::render::RenderScene;
use biscale::render::image::shading::ImageBackground;
use biscale::render::render;
use biscale::scene;
use biscale::scene::{LoadedScene, Painted};
use glam::Vec3;

/// A white diffuse surface.
struct White;

impl Reflectance for White {
    fn eval_lights(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        for (light, out) in lights.iter().zip(out) {
            *out = if o.z > 0.0 { Vec3::splat(light.z.max(0.0) / std::f32::consts::PI) } else { Vec3::ZERO };
        }
    }
}

fn render_scene(folder: &Path, text: &str) -> biscale::base::Result<RenderScene> {
    let scene = scene::parse(&format!("[tile]\ngeometry = {{ kind = \"flat\" }}\n{text}")).unwrap();
    let base_dir: PathBuf = folder.to_owned();
    RenderScene::new(&LoadedScene { scene, base_dir, name: String::new(), painted: Painted::default() })
}

fn image(render_scene: &RenderScene) -> Vec<Vec3> {
    let background = ImageBackground::Uniform(Vec3::ZERO);
    let rendered = render(&render_scene.input(&White, [48, 40], 2, &background)).unwrap();
    let pixels = rendered.image.pixels;
    let bad = pixels.iter().position(|pixel| !pixel.is_finite() || pixel.min_element() < 0.0);
    assert_eq!(bad, None, "{:?}", bad.map(|at| pixels[at]));
    pixels
}

fn brightest(pixels: &[Vec3]) -> f32 {
    pixels.iter().map(|pixel| pixel.max_element()).fold(0.0, f32::max)
}

#[test]
fn lights_of_1e8_and_1e_minus_8_add_up_and_black_lights_add_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let lights = |bright: f64, faint: f64| {
        format!(
            "[light]\nenvironment = \"none\"\ndirectional = [{{ direction = [0.3, 1, 0.4], irradiance = {bright} }}, {{ direction \
             = [-1, 0.2, 0.3], irradiance = {faint} }}]\n"
        )
    };
    // By default, the plan omits a light if another is a thousand times as bright.
    let text = lights(1e8, 1e-8) + "[effects]\nfaint_lights = \"on\"\n";
    let both = image(&render_scene(folder.path(), &text).unwrap());
    assert!(brightest(&both) > 1e7, "{}", brightest(&both));
    // The faint light is visible in the shadow of the bright one.
    let faint = both.iter().filter(|pixel| pixel.x > 1e-11 && pixel.x < 1e-7).count();
    assert!(faint > 10, "{faint}");
    assert_eq!(brightest(&image(&render_scene(folder.path(), &lights(0.0, 0.0)).unwrap())), 0.0);
    let none = render_scene(folder.path(), "[light]\nenvironment = \"none\"\n").unwrap();
    assert_eq!(brightest(&image(&none)), 0.0);
    assert!(none.lights().warnings.iter().any(|warning| warning.contains("no light")));
}

fn write_sky(path: &Path, width: usize, height: usize, texel: impl Fn(usize, usize) -> f32 + Sync) {
    exr::prelude::write_rgb_file(path, width, height, |x, y| {
        let value = texel(x, y);
        (value, value, value)
    })
    .unwrap();
}

#[test]
fn skies_with_a_sun_of_one_texel_or_with_invalid_texels_light_the_object() {
    let folder = tempfile::tempdir().unwrap();
    let sky = "[light]\nenvironment = \"sky.exr\"\ncount = 16\n";
    let path = folder.path().join("sky.exr");
    write_sky(&path, 64, 32, |x, y| if (x, y) == (20, 6) { 1e6 } else { 0.0 });
    let sun = render_scene(folder.path(), sky).unwrap();
    assert_eq!(sun.lights().directional.len(), 1, "one texel becomes one light");
    assert!(brightest(&image(&sun)) > 1.0);
    // Infinite, NaN, negative and huge texels among texels of 1.
    let invalid = [f32::INFINITY, f32::NAN, -5.0, 3e38];
    write_sky(&path, 64, 32, |x, y| if (x + 7 * y) % 31 < 4 { invalid[(x + 7 * y) % 31] } else { 1.0 });
    let repaired = render_scene(folder.path(), sky).unwrap();
    assert!(
        repaired.lights().warnings.iter().any(|w| w.contains("count as black")),
        "{:?}",
        repaired.lights().warnings
    );
    let found = brightest(&image(&repaired));
    assert!(found > 0.3 && found < 3.0, "{found}");
    write_sky(&path, 64, 32, |_, _| 0.0);
    assert_eq!(brightest(&image(&render_scene(folder.path(), sky).unwrap())), 0.0);
    // The width is a prime number.
    write_sky(&path, 1031, 3, |_, _| 1.0);
    let odd = render_scene(folder.path(), sky).unwrap();
    let total: f32 = odd.lights().directional.iter().map(|light| light.irradiance.x).sum();
    assert!((total / (4.0 * std::f32::consts::PI) - 1.0).abs() < 1e-3, "{total}");
}

#[test]
fn objects_with_degenerate_uvs_poles_or_the_camera_inside_are_shaded() {
    let folder = tempfile::tempdir().unwrap();
    let quad = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    let meshes = [
        ("one UV for all", format!("{quad}vt 0.5 0.5\nf 1/1 2/1 3/1 4/1\n")),
        ("UVs on a line", format!("{quad}vt 0 0\nvt 1 1\nvt 2 2\nvt 3 3\nf 1/1 2/2 3/3 4/4\n")),
        ("mirrored UVs", format!("{quad}vt 0 0\nvt -1 0\nvt -1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n")),
        ("huge", quad.replace('1', "1e30") + "f 1 2 3 4\n"),
        ("tiny", quad.replace('1', "1e-30") + "f 1 2 3 4\n"),
        ("slivers and points", format!("{quad}v 0.5 0 0\nf 1 2 3 4\nf 1 5 2\nf 1 1 1\n")),
        ("normals without length", format!("{quad}vn 0 0 0\nf 1//1 2//1 3//1 4//1\n")),
    ];
    for (name, text) in meshes {
        std::fs::write(folder.path().join("object.obj"), text).unwrap();
        let scene = render_scene(
            folder.path(),
            "[object]\nkind = \"mesh\"\npath = \"object.obj\"\n[camera]\nazimuth_deg = 0\n",
        );
        let scene = scene.unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(brightest(&image(&scene)) > 0.0, "{name}");
        let sound = |v: &Vec3| v.is_finite() && (v.length() - 1.0).abs() < 1e-3;
        assert!(scene.mesh().tangents.iter().chain(&scene.mesh().normals).all(sound), "{name}");
    }
    // From straight above, at the pole of the sphere's frame, and from inside.
    for camera in [
        "elevation_deg = 90",
        "elevation_deg = -90",
        "distance = 0.01",
        "distance = 1.0",
        "fov_deg = 150\ndistance = 0.5",
    ] {
        for kind in ["sphere", "cup", "teapot"] {
            image(&render_scene(folder.path(), &format!("[object]\nkind = \"{kind}\"\n[camera]\n{camera}\n")).unwrap());
        }
    }
}

#[test]
fn uniform_light_from_all_directions_gives_a_white_sphere() {
    let folder = tempfile::tempdir().unwrap();
    write_sky(&folder.path().join("sky.exr"), 64, 32, |_, _| 1.0);
    let scene = render_scene(folder.path(), "[light]\nenvironment = \"sky.exr\"\ncount = 256\n").unwrap();
    let mut values: Vec<f32> = image(&scene).iter().map(|pixel| pixel.x).filter(|x| *x > 0.2).collect();
    values.sort_by(f32::total_cmp);
    // The 256 lights sample the sphere, so the median is 1 within their sampling error.
    let median = values[values.len() / 2];
    assert!((median - 1.0).abs() < 0.02, "{median}");
    assert!(from_angles(0.0, 0.0) == Vec3::Z);
}
