//! Tests of GPU rendering against its CPU twins on the same input.

use std::path::Path;

use glam::Vec3;

use super::gbuffer::GpuPoint;
use super::image;
use super::light_rays::{GpuLightRays, GpuOccluder};
use crate::base::Cancel;
use crate::effective::EffectiveBrdf;
use crate::gpu::shading::{GpuLight, ShadingParams};
use crate::gpu::{Gpu, GpuRenderer};
use crate::pipeline::Pipeline;
use crate::render::image::raster::NO_TRIANGLE;
use crate::render::image::shading::ImageBackground;
use crate::render::image::shading_points::ShadingPoints;
use crate::render::image::tone_map::{ToneCurve, ToneMap, srgb};
use crate::render::shadow::{LightVisibility, Occluder, ray_origin};
use crate::render::{CameraView, DirectionalLight, GBuffer, ObjectMesh, RenderInput, object};
use crate::scene;
use crate::scene::LoadedScene;

fn open_gpu() -> Option<Gpu> {
    Gpu::open().map_err(|error| eprintln!("SKIPPED: {error}")).ok()
}

fn object(kind: &str) -> ObjectMesh {
    object::build(&scene::Object { kind: kind.to_owned(), path: None }, Path::new(".")).unwrap()
}

fn camera(distance: f32) -> scene::Camera {
    scene::Camera { distance, ..scene::Camera::default() }
}

fn view(mesh: &ObjectMesh, distance: f32, size: [usize; 2]) -> CameraView {
    CameraView::new(&camera(distance), mesh, size).unwrap()
}

/// Returns a diffuse material.
fn brdf() -> EffectiveBrdf {
    let text = "[tile]\ngeometry = { kind = \"flat\" }\n[[material]]\nname = \"default\"\n\
                brdf = { kind = \"lambertian\", albedo = 0.5 }\n[quality]\npreset = \"draft\"\nbackend = \"cpu\"\n";
    let loaded = LoadedScene {
        scene: scene::parse(text).unwrap(),
        base_dir: ".".into(),
        name: String::new(),
        painted: scene::Painted::default(),
    };
    Pipeline::new().effective(&loaded).unwrap().brdf.as_ref().clone()
}

/// Returns the points of all slots of an image on the GPU, and the points with the starts of their shadow rays as
/// positions.
fn points_and_lifted(
    gpu: &Gpu,
    mesh: &ObjectMesh,
    camera: &scene::Camera,
    size: [usize; 2],
    samples: usize,
) -> [Vec<GpuPoint>; 2] {
    let (occluder, brdf) = (Occluder::new(mesh), brdf());
    let mut renderer = GpuRenderer::with_material(gpu, mesh, Some(&occluder), &brdf).unwrap();
    let input = RenderInput {
        mesh,
        occluder: Some(&occluder),
        shadow_cache: None,
        lights: &[DirectionalLight { direction: Vec3::Y, irradiance: Vec3::ONE }],
        camera,
        reflectance: &brdf,
        size,
        samples_per_side: samples,
        tolerance: 0.0,
        background: &ImageBackground::Wall,
    };
    renderer.render(gpu, &input, &Cancel::default()).unwrap();
    let [points, origins] = &renderer.buffers.as_ref().unwrap().points_and_origins;
    let count = size[0] * size[1] * samples * samples;
    let mut points: Vec<GpuPoint> = gpu.read(points).unwrap();
    let origins: Vec<[f32; 4]> = gpu.read(origins).unwrap();
    points.truncate(count);
    let lifted =
        points.iter().zip(&origins).map(|(point, origin)| GpuPoint { position: Vec3::from_slice(origin), ..*point });
    [points.clone(), lifted.collect()]
}

/// Returns whether a neighbouring sample shows another triangle, so that subpixel snapping may choose either.
fn is_at_edge(buffer: &GBuffer, k: usize) -> bool {
    let (x, y) = (k % buffer.width, k / buffer.width);
    let around = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
    let inside = around.into_iter().filter(|&(x, y)| x < buffer.width && y < buffer.height);
    inside.into_iter().any(|(x, y)| buffer.triangles[y * buffer.width + x] != buffer.triangles[k])
}

#[test]
fn gpu_and_cpu_compute_the_same_g_buffer() {
    let Some(gpu) = open_gpu() else { return };
    for (kind, distance) in
        [("sphere", 0.0), ("plate", 0.0), ("cup", 0.0), ("skirt", 0.0), ("teapot", 0.0), ("skirt", 0.3)]
    {
        let (mesh, size) = (object(kind), [300, 260]);
        let view = view(&mesh, distance, size);
        let cpu = GBuffer::new(&mesh, &view, 1);
        let [gpu_points, lifted] = points_and_lifted(&gpu, &mesh, &camera(distance), size, 1);
        assert_eq!(gpu_points.len(), cpu.triangles.len());
        let (mut other_triangle, mut inside, mut covered) = (0, 0, 0);
        let (mut position, mut normal, mut tangent) = (Vec::new(), Vec::new(), Vec::new());
        for (k, (point, lifted)) in gpu_points.iter().zip(&lifted).enumerate() {
            covered += usize::from(cpu.triangles[k] != NO_TRIANGLE);
            let triangle = if point.weight > 0.0 { point.triangle } else { NO_TRIANGLE };
            if triangle != cpu.triangles[k] {
                other_triangle += 1;
                inside += usize::from(!is_at_edge(&cpu, k));
                continue;
            }
            if triangle == NO_TRIANGLE {
                continue;
            }
            assert_eq!(point.weight, 1.0);
            position.push(point.position.distance(cpu.positions[k]) / mesh.bounds.radius);
            normal.push(point.normal.distance(cpu.normals[k]));
            tangent.push(point.tangent.distance(cpu.tangents[k]));
            let (origin, _) = ray_origin(&mesh, triangle as usize, point.position, view.eye);
            // Weights of a point are quotients of areas: thin triangles magnify their rounding.
            assert!(origin.distance(lifted.position) < 2e-5 * mesh.bounds.radius, "{kind}: {origin} {lifted:?}");
        }
        let [position, normal, tangent] = [position, normal, tangent].map(|mut distances| {
            distances.sort_by(f32::total_cmp);
            [distances[distances.len() * 99 / 100], distances[distances.len() - 1]]
        });
        eprintln!(
            "{kind}: {covered} covered, {other_triangle} other triangle, {inside} not at an edge, position {position:?}, normal {normal:?}, tangent {tangent:?}"
        );
        assert!(
            other_triangle < covered / 100 && inside == 0,
            "{kind}: {other_triangle} of {covered}, {inside} not at edges"
        );
        // Largest differences in 99 % of the samples, then in all. Triangles that are viewed edge-on magnify the
        // subpixel snapping, and normals and tangents change fast at the rim and at poles.
        for (what, [most, worst], allowed) in
            [("position", position, [5e-4, 0.02]), ("normal", normal, [1e-3, 0.05]), ("tangent", tangent, [1e-3, 0.2])]
        {
            assert!(most < allowed[0] && worst < allowed[1], "{kind}: {what} {most} {worst}");
        }
    }
}

#[test]
fn on_gpu_and_cpu_the_same_samples_share_a_point() {
    let Some(gpu) = open_gpu() else { return };
    for kind in ["sphere", "cup", "skirt"] {
        let (mesh, size, samples) = (object(kind), [150, 130], 2);
        let view = view(&mesh, 0.0, size);
        let points = ShadingPoints::new(&mesh, &view, samples);
        let [gpu_points, _] = points_and_lifted(&gpu, &mesh, &camera(0.0), size, samples);
        let pixels = size[0] * size[1];
        let (mut weights, mut firsts) = (vec![Vec::new(); pixels], vec![Vec3::ZERO; pixels]);
        for k in (0..points.len()).rev() {
            weights[points.pixels[k] as usize].push(points.weights[k]);
            firsts[points.pixels[k] as usize] = points.normals[k];
        }
        let (mut shared, mut separate, mut differ) = (0, 0, 0);
        for pixel in 0..pixels {
            let slots: Vec<&GpuPoint> = (0..samples * samples).map(|k| &gpu_points[k * pixels + pixel]).collect();
            let mut gpu_weights: Vec<f32> = slots.iter().map(|point| point.weight).filter(|&w| w > 0.0).collect();
            gpu_weights.reverse();
            if gpu_weights != weights[pixel] {
                differ += 1;
                continue;
            }
            shared += usize::from(gpu_weights == [1.0]);
            separate += usize::from(gpu_weights.len() > 1);
            if let Some(first) = slots.iter().find(|point| point.weight > 0.0) {
                assert!(first.normal.distance(firsts[pixel]) < 0.05, "{kind} {pixel}: {first:?} {}", firsts[pixel]);
            }
        }
        eprintln!("{kind}: {shared} pixels of one point, {separate} of several, {differ} differ");
        // Differences come from silhouettes within a subpixel of a sample, and from normals within rounding of the
        // limit.
        assert!(
            shared > 1000 && separate > 100 && differ * 100 < shared + separate,
            "{kind}: {shared} {separate} {differ}"
        );
    }
}

#[test]
fn an_image_for_a_screen_is_the_tone_mapped_image_that_is_read_back() {
    let Some(gpu) = open_gpu() else { return };
    let (mesh, brdf, size) = (object("cup"), brdf(), [96, 64]);
    let mut renderer = GpuRenderer::with_material(&gpu, &mesh, None, &brdf).unwrap();
    let texture = image::image(&gpu, size).unwrap();
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    for (curve, gain, background) in [
        (ToneCurve::Filmic, 1.0, ImageBackground::Wall),
        (ToneCurve::Plain, 0.7, ImageBackground::Uniform(Vec3::new(0.001, 0.3, 2.0))),
        (ToneCurve::Filmic, 9.0, ImageBackground::Wall),
    ] {
        let input = RenderInput {
            mesh: &mesh,
            occluder: None,
            shadow_cache: None,
            lights: &[DirectionalLight { direction: Vec3::new(0.6, 0.48, 0.64), irradiance: Vec3::new(1.0, 2.0, 3.0) }],
            camera: &scene::Camera::default(),
            reflectance: &brdf,
            size,
            samples_per_side: 2,
            tolerance: 0.0,
            background: &background,
        };
        let tone_map = ToneMap { curve, gain };
        let image = renderer.render(&gpu, &input, &Cancel::default()).unwrap().image;
        renderer.show(&gpu, &input, &tone_map, &view, &Cancel::default()).unwrap();
        let shown_image = gpu.read_image(&texture).unwrap();
        for (pixel, shown) in image.pixels.iter().zip(shown_image.as_chunks::<4>().0) {
            let expected = tone_map.apply(*pixel).to_array().map(|linear| 255.0 * srgb(linear));
            // Adapters may be off by 0.6 of a step when they convert to bytes (Direct3D's data conversion rules).
            let off = (0..3).map(|c| (expected[c] - f32::from(shown[c])).abs()).fold(0.0, f32::max);
            assert!(off < 0.61 && shown[3] == 255, "{expected:?} {shown:?}");
        }
    }
}

/// Returns the visible lights that the GPU computes for points of the CPU.
fn traced(
    gpu: &Gpu,
    mesh: &ObjectMesh,
    occluder: &Occluder,
    points: &ShadingPoints,
    lights: &[DirectionalLight],
    eye: Vec3,
) -> LightVisibility {
    use wgpu::BufferUsages as Usage;
    let (rays, gpu_occluder) = (GpuLightRays::new(gpu).unwrap(), GpuOccluder::new(gpu, occluder).unwrap());
    let words = LightVisibility::words_of(lights.len()) as u32;
    let params = ShadingParams {
        eye,
        point_count: points.len() as u32,
        light_count: lights.len() as u32,
        words_per_point: words,
        slice: 8,
        min_area: 0.0,
    };
    let (mut slots, mut origins) = (Vec::new(), Vec::new());
    for k in 0..points.len() {
        let (position, normal) = (points.positions[k], points.normals[k]);
        slots.push(GpuPoint { position, normal, weight: 1.0, ..GpuPoint::default() });
        origins.push(ray_origin(mesh, points.triangles[k] as usize, position, eye).0.extend(0.0));
    }
    let gpu_lights: Vec<GpuLight> = lights.iter().map(GpuLight::from).collect();
    let bits =
        gpu.buffer("bits", 4 * u64::from(words) * points.len() as u64, Usage::STORAGE | Usage::COPY_SRC).unwrap();
    let group = rays
        .points(
            gpu,
            [
                &gpu.upload("parameters", &[params], Usage::UNIFORM).unwrap(),
                &gpu.upload("points", &slots, Usage::STORAGE).unwrap(),
                &gpu.upload("lights", &gpu_lights, Usage::STORAGE).unwrap(),
            ],
        )
        .unwrap();
    let origins = gpu.upload("origins", &origins, Usage::STORAGE).unwrap();
    let to_bits = rays.rays(gpu, &gpu_occluder, &origins, &bits).unwrap();
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    rays.trace(&mut pass, &group, &to_bits, [points.len() as u32, words]);
    drop(pass);
    gpu.queue.submit([encoder.finish()]);
    let mut visible = LightVisibility::none(points.len(), lights.len());
    let words_read: Vec<u32> = gpu.read(&bits).unwrap();
    let count = visible.words.len();
    visible.words.copy_from_slice(&words_read[..count]);
    visible
}

#[test]
fn gpu_and_cpu_compute_the_same_visible_lights() {
    let Some(gpu) = open_gpu() else { return };
    let lights: Vec<_> = (0..45)
        .map(|k| {
            let (y, phi) = (1.0 - 2.0 * (k as f32 + 0.5) / 45.0, 2.4 * k as f32);
            let across = (1.0 - y * y).sqrt();
            let direction = Vec3::new(across * phi.cos(), y, across * phi.sin());
            DirectionalLight { direction, irradiance: Vec3::ONE }
        })
        .chain([Vec3::X, Vec3::Y, Vec3::Z].map(|direction| DirectionalLight { direction, irradiance: Vec3::ONE }))
        .collect();
    for kind in ["cup", "skirt", "teapot"] {
        let mesh = object(kind);
        let view = view(&mesh, 0.0, [150, 130]);
        let points = ShadingPoints::new(&mesh, &view, 1);
        let occluder = Occluder::if_needed(&mesh).unwrap();
        let cpu = occluder.visible_lights(&mesh, &points, &lights, view.eye, None);
        let gpu_visible = traced(&gpu, &mesh, &occluder, &points, &lights, view.eye);
        let differ: u32 = cpu.words.iter().zip(&gpu_visible.words).map(|(a, b)| (a ^ b).count_ones()).sum();
        let pairs = points.len() * lights.len();
        eprintln!("{kind}: {differ} of {pairs} rays differ");
        // Rays that graze an edge or the horizon within rounding may differ.
        assert!((differ as usize) < pairs / 5000, "{kind}: {differ} of {pairs}");
    }
}
