//! Images compared with closed forms.

use std::f32::consts::PI;
use std::path::Path;

use glam::Vec3;

use super::*;
use crate::render::lighting::lights;
use crate::render::object;

struct Lambertian;

impl Reflectance for Lambertian {
    fn eval_lights(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        assert!(o.z > 0.0 && lights.len() == out.len());
        for (i, out) in lights.iter().zip(out) {
            assert!(i.z > 0.0);
            *out = Vec3::splat(i.z / PI);
        }
    }
}

/// A Ward-like lobe with a width along tile x and one along tile y, on a dim diffuse base.
struct Brushed {
    alpha: [f32; 2],
}

impl Reflectance for Brushed {
    fn eval_lights(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        let [ax, ay] = self.alpha;
        for (i, out) in lights.iter().zip(out) {
            let h = (*i + o).normalize();
            let slope = (h.x / ax).powi(2) + (h.y / ay).powi(2);
            let lobe = (-slope / (h.z * h.z)).exp() / (4.0 * PI * ax * ay * (i.z * o.z).max(1e-3).sqrt());
            *out = Vec3::new(0.85, 0.62, 0.35) * (0.5 * lobe * i.z) + Vec3::splat(0.08 * i.z / PI);
        }
    }
}

fn object(kind: &str) -> ObjectMesh {
    let path = kind.ends_with(".obj").then(|| Path::new(kind).to_owned());
    let kind = if path.is_some() { "mesh" } else { kind };
    object::build(&scene::Object { kind: kind.to_owned(), path }, Path::new(".")).unwrap()
}

fn front() -> scene::Camera {
    scene::Camera { azimuth_deg: 0.0, elevation_deg: 0.0, ..scene::Camera::default() }
}

/// The tolerance of `standard`.
const TOLERANCE: f32 = 8e-3;

fn image(
    mesh: &ObjectMesh,
    lights: &[DirectionalLight],
    reflectance: &dyn Reflectance,
    camera: &scene::Camera,
) -> Rendered {
    image_within(TOLERANCE, mesh, lights, reflectance, camera)
}

fn image_within(
    tolerance: f32,
    mesh: &ObjectMesh,
    lights: &[DirectionalLight],
    reflectance: &dyn Reflectance,
    camera: &scene::Camera,
) -> Rendered {
    let occluder = Occluder::if_needed(mesh);
    render(&RenderInput {
        mesh,
        occluder: occluder.as_ref(),
        shadow_cache: None,
        lights,
        camera,
        reflectance,
        size: [128, 128],
        samples_per_side: 2,
        tolerance,
        background: &ImageBackground::Uniform(Vec3::ZERO),
    })
    .unwrap()
}

/// Returns the unit sphere's normal at the centre of a pixel, if the sphere is visible there.
fn sphere_normal(camera: &scene::Camera, mesh: &ObjectMesh, pixel: usize) -> Option<Vec3> {
    let view = CameraView::new(camera, mesh, [128, 128]).unwrap();
    let ndc = glam::Vec2::new((pixel % 128) as f32 + 0.5, (pixel / 128) as f32 + 0.5) / 64.0 - 1.0;
    let ray =
        (view.right * (ndc.x * view.tan_half_fov.x) - view.up * (ndc.y * view.tan_half_fov.y) - view.back).normalize();
    let b = view.eye.dot(ray);
    let root = b * b - view.eye.length_squared() + 1.0;
    (root > 0.0).then(|| view.eye + ray * (-b - root.sqrt()))
}

#[test]
fn a_lambertian_sphere_has_its_closed_form_radiance() {
    let mesh = object("sphere");
    let direction = Vec3::new(0.48, 0.64, 0.6);
    let lights = [DirectionalLight { direction, irradiance: Vec3::new(PI, 2.0 * PI, 0.0) }];
    let rendered = image(&mesh, &lights, &Lambertian, &front());
    let mut checked = 0;
    for (k, pixel) in rendered.image.pixels.iter().enumerate() {
        let Some(normal) = sphere_normal(&front(), &mesh, k) else {
            continue;
        };
        if normal.z > 0.5 {
            let expected = normal.dot(direction).max(0.0);
            assert!((pixel.x - expected).abs() < 0.01 && (pixel.y - 2.0 * expected).abs() < 0.02 && pixel.z == 0.0);
            checked += 1;
        }
    }
    assert!(checked > 5000, "{checked}");
}

#[test]
fn the_highlight_of_a_mirror_like_sphere_lies_where_the_half_vector_is_the_normal() {
    let mesh = object("sphere");
    let direction = Vec3::new(0.6, 0.48, 0.64);
    let lights = [DirectionalLight { direction, irradiance: Vec3::ONE }];
    let rendered = image(&mesh, &lights, &Brushed { alpha: [0.05, 0.05] }, &front());
    let brightest =
        (0..128 * 128).max_by(|&a, &b| rendered.image.pixels[a].x.total_cmp(&rendered.image.pixels[b].x)).unwrap();
    let normal = sphere_normal(&front(), &mesh, brightest).unwrap();
    let eye = CameraView::new(&front(), &mesh, [128, 128]).unwrap().eye;
    let half = (direction + (eye - normal).normalize()).normalize();
    assert!(normal.dot(half) > 0.999, "{}", normal.dot(half));
}

#[test]
fn an_anisotropic_highlight_on_a_sphere_stretches_along_tile_y_if_the_lobe_is_wide_there() {
    // Tile y runs up the meridians, so a lobe that is narrow in x and wide in y must give a tall highlight.
    let mesh = object("sphere");
    let lights = [DirectionalLight { direction: Vec3::Z, irradiance: Vec3::ONE }];
    let extent = |alpha| {
        let rendered = image(&mesh, &lights, &Brushed { alpha }, &front());
        let lit = |k: usize| rendered.image.pixels[k].x > 0.4 * rendered.image.pixels[64 * 128 + 64].x;
        let wide = (0..128).filter(|x| lit(64 * 128 + x)).count();
        let tall = (0..128).filter(|y| lit(y * 128 + 64)).count();
        (wide, tall)
    };
    let (wide, tall) = extent([0.08, 0.35]);
    assert!(tall > 3 * wide, "{wide} {tall}");
    assert!(extent([0.35, 0.08]).0.abs_diff(tall) <= 4);
}

#[test]
fn edges_are_averaged_in_linear_radiance_and_coverage_matches_the_disc() {
    struct White;
    impl Reflectance for White {
        fn eval_lights(&self, _: &[Vec3], _: Vec3, out: &mut [Vec3]) {
            out.fill(Vec3::ONE);
        }
    }
    let mesh = object("sphere");
    let lights = [DirectionalLight { direction: Vec3::Z, irradiance: Vec3::ONE }];
    let camera = scene::Camera { distance: 40.0, fov_deg: 3.5, ..front() };
    let rendered = image(&mesh, &lights, &White, &camera);
    let sum: f32 = rendered.image.pixels.iter().map(|p| p.x).sum();
    // Under perspective, the rim has the angular radius asin(1/40).
    let radius = 64.0 * (1f32 / 40.0).asin().tan() / 1.75f32.to_radians().tan();
    assert!((sum / (PI * radius * radius) - 1.0).abs() < 0.01, "{sum}");
    assert!(rendered.image.pixels.iter().any(|p| p.x > 0.1 && p.x < 0.9));
}

#[test]
fn one_and_several_threads_give_the_same_image() {
    let mesh = object("cup");
    let lights = lights::build(&scene::Light::default(), Path::new(".")).unwrap().directional;
    let with_threads = |n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| image(&mesh, &lights, &Lambertian, &scene::Camera::default()).image)
    };
    assert_eq!(with_threads(1), with_threads(3));
}

#[test]
fn sizes_that_make_no_image_are_errors() {
    let mesh = object("sphere");
    for (size, samples_per_side) in [([0, 4], 1), ([4, 4], 0), ([1 << 20, 1 << 20], 2), ([usize::MAX, 2], 1)] {
        let camera = front();
        let input = RenderInput {
            mesh: &mesh,
            occluder: None,
            shadow_cache: None,
            lights: &[],
            camera: &camera,
            reflectance: &Lambertian,
            size,
            samples_per_side,
            tolerance: 0.0,
            background: &ImageBackground::Wall,
        };
        assert_eq!(render(&input).unwrap_err().exit_code(), 2);
    }
}

/// Light that facets send to each other, as a part of its own or within all light.
struct Bounced {
    is_apart: bool,
}

impl Reflectance for Bounced {
    fn eval_lights(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        let mut bounced = vec![Vec3::ZERO; lights.len()];
        self.eval_bounced(lights, o, &mut bounced);
        Lambertian.eval_lights(lights, o, out);
        out.iter_mut().zip(bounced).for_each(|(out, bounced)| *out += bounced);
    }

    fn eval_direct(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) -> bool {
        if self.is_apart {
            Lambertian.eval_lights(lights, o, out);
        } else {
            self.eval_lights(lights, o, out);
        }
        self.is_apart
    }

    /// A lobe as wide as the table of this light can hold.
    fn eval_bounced(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        for (i, out) in lights.iter().zip(out) {
            let apart = (i.truncate() + o.truncate()).length_squared();
            *out = Vec3::new(0.4, 0.3, 0.2) * (i.z.max(0.0) * (-apart / 0.25).exp());
        }
    }
}

/// Lights from everywhere above the ground.
fn many_lights() -> Vec<DirectionalLight> {
    (0..12)
        .map(|k| DirectionalLight {
            direction: crate::math::directions::from_angles(0.12 * k as f32, 2.4 * k as f32),
            irradiance: Vec3::splat(0.3),
        })
        .collect()
}

/// Relative L2 of the difference of two images, and the largest relative difference of a pixel.
fn differences(image: &Image, exact: &Image) -> (f64, f32) {
    let (mut sum, mut error, mut worst) = (0.0, 0.0, 0.0_f32);
    for (a, b) in image.pixels.iter().zip(&exact.pixels) {
        sum += f64::from(b.x).powi(2);
        error += f64::from(a.x - b.x).powi(2);
        worst = worst.max((a.x - b.x).abs() / b.x.max(0.05));
    }
    ((error / sum).sqrt(), worst)
}

#[test]
fn bounced_light_between_points_is_that_at_the_points() {
    for kind in ["sphere", "cup", "plate", "teapot"] {
        let (mesh, lights, camera) = (object(kind), many_lights(), scene::Camera::default());
        let apart = image(&mesh, &lights, &Bounced { is_apart: true }, &camera).image;
        let within = image_within(0.0, &mesh, &lights, &Bounced { is_apart: false }, &camera).image;
        let (rel_l2, worst) = differences(&apart, &within);
        eprintln!("{kind}: relative L2 {rel_l2:.5}, worst {worst:.4}");
        // Here the bounced light is as strong as the direct light; in shipped scenes it has a third of the light at most.
        assert!(rel_l2 < 6e-3 && worst < 0.05, "{kind}: {rel_l2} {worst}");
        assert!(rel_l2 > 0.0, "{kind}: nothing was interpolated");
    }
}

/// Counts the points at which a material, and its light between facets, are evaluated.
struct Counted<'a> {
    material: &'a dyn Reflectance,
    points: std::sync::atomic::AtomicUsize,
    bounced: std::sync::atomic::AtomicUsize,
}

impl<'a> Counted<'a> {
    fn new(material: &'a dyn Reflectance) -> Self {
        Self { material, points: 0.into(), bounced: 0.into() }
    }
}

impl Reflectance for Counted<'_> {
    fn eval_lights(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        self.points.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        self.material.eval_lights(lights, o, out);
    }

    fn eval_direct(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) -> bool {
        self.points.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        self.material.eval_direct(lights, o, out)
    }

    fn eval_bounced(&self, lights: &[Vec3], o: Vec3, out: &mut [Vec3]) {
        self.bounced.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        self.material.eval_bounced(lights, o, out);
    }
}

#[test]
fn light_between_facets_is_evaluated_at_a_part_of_the_points_of_direct_light() {
    for kind in ["sphere", "cup", "plate", "teapot"] {
        let counted = Counted::new(&Bounced { is_apart: true });
        let points = image(&object(kind), &many_lights(), &counted, &scene::Camera::default()).points as f64;
        let [direct, bounced] = [counted.points, counted.bounced].map(|count| count.into_inner() as f64 / points);
        eprintln!("{kind}: direct light at {direct:.3} of the points, light between facets at {bounced:.3}");
        assert!(bounced < 0.8 * direct, "{kind}: {bounced} of {direct}");
    }
}

#[test]
fn images_evaluate_a_material_at_a_part_of_the_points_and_stay_within_their_tolerance() {
    let brushed = |x, y| Brushed { alpha: [x, y] };
    for kind in ["sphere", "cup", "plate", "teapot"] {
        for lobe in [brushed(0.02, 0.02), brushed(0.05, 0.05), brushed(0.2, 0.2), brushed(0.1, 0.35)] {
            let (mesh, lights, camera) = (object(kind), many_lights(), scene::Camera::default());
            let exact = image_within(0.0, &mesh, &lights, &lobe, &camera);
            let counted = Counted::new(&lobe);
            let interpolated = image(&mesh, &lights, &counted, &camera);
            let part = counted.points.into_inner() as f64 / interpolated.points as f64;
            let (rel_l2, worst) = differences(&interpolated.image, &exact.image);
            eprintln!("{kind} {:?}: {part:.3} of the points, L2 {rel_l2:.5}, worst {worst:.4}", lobe.alpha);
            // The narrowest highlight is about as wide as a pixel here.
            let most = if lobe.alpha[0] < 0.05 { 0.2 } else { 0.05 };
            assert!(rel_l2 < f64::from(TOLERANCE) && worst < most, "{kind} {:?}: {rel_l2} {worst}", lobe.alpha);
        }
        let counted = Counted::new(&Lambertian);
        let points = image(&object(kind), &many_lights(), &counted, &scene::Camera::default()).points;
        let part = counted.points.into_inner() as f64 / points as f64;
        eprintln!("{kind}, Lambertian: {part:.3} of the points");
        assert!(part < if kind == "teapot" { 1.0 } else { 0.85 }, "{kind}: {part}");
    }
}

/// As bright in grazing light as in any other, so that it ends abruptly at the horizon.
struct Even;

impl Reflectance for Even {
    fn eval_lights(&self, lights: &[Vec3], _: Vec3, out: &mut [Vec3]) {
        lights.iter().zip(out).for_each(|(i, out)| *out = if i.z > 0.0 { Vec3::ONE } else { Vec3::ZERO });
    }
}

#[test]
fn interpolation_keeps_the_edges_of_shadows_and_the_horizons_of_lights() {
    for kind in ["sphere", "cup", "skirt"] {
        let (mesh, lights, camera) = (object(kind), many_lights(), scene::Camera::default());
        let counted = Counted::new(&Even);
        let interpolated = image(&mesh, &lights, &counted, &camera);
        let exact = image_within(0.0, &mesh, &lights, &Even, &camera);
        let (_, worst) = differences(&interpolated.image, &exact.image);
        assert!(worst < 1e-5, "{kind}: {worst}");
        let evaluated = counted.points.into_inner();
        assert!(evaluated < interpolated.points, "{kind}: {evaluated} of {}", interpolated.points);
    }
}

#[test]
fn interpolation_reaches_the_borders_of_images_of_any_size_with_any_number_of_lights_and_samples() {
    let (mesh, camera) = (object("plate"), scene::Camera { distance: 1.5, ..scene::Camera::default() });
    let occluder = Occluder::if_needed(&mesh);
    for size in [[1, 1], [7, 5], [16, 16], [33, 40], [65, 31]] {
        for (lights, samples_per_side) in [(0, 1), (1, 2), (40, 3), (70, 1)] {
            let lights = many_lights().into_iter().cycle().take(lights).collect::<Vec<_>>();
            let input = RenderInput {
                mesh: &mesh,
                occluder: occluder.as_ref(),
                shadow_cache: None,
                lights: &lights,
                camera: &camera,
                reflectance: &Even,
                size,
                samples_per_side,
                tolerance: TOLERANCE,
                background: &ImageBackground::Uniform(Vec3::ZERO),
            };
            let exact = render(&RenderInput { tolerance: 0.0, ..input }).unwrap().image;
            let image = render(&input).unwrap().image;
            assert!(lights.is_empty() || exact.pixels.iter().any(|pixel| pixel.x > 0.0), "{size:?}");
            for (a, b) in image.pixels.iter().zip(&exact.pixels) {
                assert!((*a - *b).abs().max_element() <= 1e-5 * b.x, "{size:?} {} lights: {a} {b}", lights.len());
            }
        }
    }
}
