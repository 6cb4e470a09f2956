//! Drafts of objects that a viewer sees through, on the GPU: the twin of
//! [`seen_through::render`](crate::render::seen_through::render) without paths.

use std::time::Instant;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::device::pipelines::{READ, UNIFORM, WRITE};
use super::{Gpu, GpuError};
use crate::base::Result;
use crate::effective::{ViewLobe, ViewLobes};
use crate::render::image::render::{RenderTimes, check_size};
use crate::render::image::shading::gather_over;
use crate::render::image::shading_points::ShadingPoints;
use crate::render::seen_through::{Backdrop, Kernel, SlabScene};
use crate::render::{CameraView, RenderScene, Rendered};

/// Reads along a line in the table of reads.
const MAX_PROBES: usize = 9;
/// Deviation of an even distribution over an interval of width 1.
const BOX: f32 = 0.288_675_13;

/// Slab and backdrop of a scene on the GPU, and the pipeline that reads them. Images from several cameras share it.
#[derive(Debug)]
pub struct GpuSeenThrough {
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
    levels: wgpu::Buffer,
    texels: wgpu::Buffer,
    reads: wgpu::Buffer,
    nodes: wgpu::Buffer,
    backdrop: [[f32; 4]; 2],
}

/// `View` in `seen_through.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct View {
    backdrop: [[f32; 4]; 2],
    eye: [f32; 4],
    right: [f32; 4],
    up: [f32; 4],
    back: [f32; 4],
    counts: [u32; 4],
}

/// `Point` in `seen_through.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
struct Point {
    position: [f32; 3],
    pixel: u32,
    normal: [f32; 4],
    tangent: [f32; 4],
}

impl GpuSeenThrough {
    /// Uploads the slab and the backdrop of a scene.
    ///
    /// # Errors
    /// [`GpuError::Unsupported`] for refined images, captured sheets and directional lights; other errors of the GPU.
    pub fn new(gpu: &Gpu, scene: &SlabScene) -> std::result::Result<Self, GpuError> {
        use wgpu::BufferUsages as Usage;
        let Some(lobes) = scene.draft_lobes() else {
            let reason = "the GPU draws drafts of slabs with two faces and without directional lights";
            return Err(GpuError::Unsupported(reason.to_owned()));
        };
        let Packed { levels, texels, backdrop } = packed(scene.behind());
        let mut reads = vec![[0.0; 2]; Kernel::reads().len() * MAX_PROBES];
        for (row, line) in reads.chunks_mut(MAX_PROBES).zip(Kernel::reads()) {
            row.iter_mut().zip(line).for_each(|(read, (at, weight))| *read = [*at, *weight]);
        }
        let nodes: Vec<[[f32; 4]; 8]> = lobes.iter().map(node).collect();
        let bindings = [UNIFORM, READ, READ, READ, READ, READ, WRITE];
        let layout = gpu.layout("seen through", wgpu::ShaderStages::COMPUTE, &bindings)?;
        let module = gpu.module("seen_through")?;
        Ok(Self {
            pipeline: gpu.compute_pipeline(&module, "seen_through", &[&layout])?,
            levels: gpu.upload("levels", &levels, Usage::STORAGE)?,
            texels: gpu.upload("texels", &texels, Usage::STORAGE)?,
            reads: gpu.upload("reads", &reads, Usage::STORAGE)?,
            nodes: gpu.upload("lobes", &nodes, Usage::STORAGE)?,
            layout,
            backdrop,
        })
    }

    /// Renders the object of a scene.
    ///
    /// # Errors
    /// The camera cannot frame the object, the size is out of range, or the GPU fails.
    pub fn render(
        &self,
        gpu: &Gpu,
        render_scene: &RenderScene,
        size: [usize; 2],
        samples_per_side: usize,
    ) -> Result<Rendered> {
        check_size(size, samples_per_side)?;
        let view = CameraView::new(&render_scene.camera, render_scene.mesh(), size)?;
        let start = Instant::now();
        let points = ShadingPoints::new(render_scene.mesh(), &view, samples_per_side);
        let after_gbuffer = Instant::now();
        let radiance = self.radiance(gpu, &view, &points)?;
        let (of_points, behind) = radiance.split_at(points.len());
        let image = gather_over(&points, of_points, view.size, |pixel| behind[pixel]);
        let times = RenderTimes::without_shadows(start, after_gbuffer);
        Ok(Rendered { image, times, points: points.len() })
    }

    /// The radiance of points, then that of the background of all pixels.
    fn radiance(
        &self,
        gpu: &Gpu,
        view: &CameraView,
        points: &ShadingPoints,
    ) -> std::result::Result<Vec<Vec3>, GpuError> {
        use wgpu::BufferUsages as Usage;
        let point = |k: usize| Point {
            position: points.positions[k].to_array(),
            pixel: points.pixels[k],
            normal: points.normals[k].extend(0.0).to_array(),
            tangent: points.tangents[k].extend(0.0).to_array(),
        };
        let rows: Vec<Point> = (0..points.len()).map(point).collect();
        let [width, height] = view.size.map(|side| side as u32);
        let count = rows.len() as u32 + width * height;
        let header = View {
            backdrop: self.backdrop,
            eye: view.eye.extend(BOX * view.pixel_extent()).to_array(),
            right: view.right.extend(view.tan_half_fov.x).to_array(),
            up: view.up.extend(view.tan_half_fov.y).to_array(),
            back: view.back.extend(0.0).to_array(),
            counts: [width, height, rows.len() as u32, 0],
        };
        let header = gpu.upload("view", &[header], Usage::UNIFORM)?;
        let rows = gpu.upload("points", &rows, Usage::STORAGE)?;
        let radiance = gpu.buffer("radiance", 16 * u64::from(count), Usage::STORAGE | Usage::COPY_SRC)?;
        let buffers = [&header, &self.levels, &self.texels, &self.reads, &self.nodes, &rows, &radiance];
        let group = gpu.group("seen through", &self.layout, &buffers.map(wgpu::Buffer::as_entire_binding))?;
        gpu.run_over(count, &self.pipeline, &group, "drawing what is seen through")?;
        let radiance: Vec<[f32; 4]> = gpu.read(&radiance)?;
        Ok(radiance.iter().map(|radiance| Vec3::from_slice(radiance)).collect())
    }
}

/// All resolutions of plane, environment and even light, and `Backdrop` in `backdrop.wgsl`.
struct Packed {
    levels: Vec<[u32; 4]>,
    texels: Vec<[f32; 4]>,
    backdrop: [[f32; 4]; 2],
}

fn packed(backdrop: &Backdrop) -> Packed {
    let (plane, [(environment, rotation), (even, even_rotation)]) = backdrop.maps();
    // Without a plane nothing reads the first image.
    let pyramids = [plane.map_or(even, |plane| &plane.pyramid), environment, even];
    let (mut levels, mut texels) = (vec![[0; 4]; pyramids.len()], Vec::new());
    for (k, pyramid) in pyramids.into_iter().enumerate() {
        levels[k] = [levels.len() as u32, pyramid.levels().count() as u32, u32::from(pyramid.wraps_y()), 0];
        for ([width, height], level) in pyramid.levels() {
            levels.push([width as u32, height as u32, texels.len() as u32, 0]);
            texels.extend(level.iter().map(|texel| texel.extend(0.0).to_array()));
        }
    }
    let of_plane = plane.map_or([0.0; 4], |plane| [plane.z, plane.scale, plane.origin.x, plane.origin.y]);
    let rotations = [rotation, even_rotation, if plane.is_some() { 1.0 } else { 0.0 }, 0.0];
    Packed { levels, texels, backdrop: [of_plane, rotations] }
}

/// A node of the table of lobes.
fn node(lobes: &ViewLobes) -> [[f32; 4]; 8] {
    let rows = |lobe: &ViewLobe, even: Vec3| {
        let [xx, xy, yy] = lobe.covariance;
        let [x, y, z] = even.to_array();
        [lobe.part.extend(lobe.tail).to_array(), [lobe.mean.x, lobe.mean.y, xx, xy], [yy, x, y, z]]
    };
    let ViewLobes { transmitted, reflected, even, straight } = lobes;
    let ([a, b, c], [d, e, f]) = (rows(transmitted, even[0]), rows(reflected, even[1]));
    let [g, h] = straight.map(|part| part.extend(0.0).to_array());
    [a, b, c, d, e, f, g, h]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Cancel;
    use crate::pipeline::Pipeline;
    use crate::testing::gaussian_tile::loaded;

    #[test]
    fn the_gpu_draws_drafts_of_slabs_before_planes_and_environments_as_the_cpu_does() {
        let Some(gpu) = Gpu::open().map_err(|error| eprintln!("SKIPPED: {error}")).ok() else { return };
        let rough =
            "top = { kind = \"ggx\", roughness = 0.1 }\nbottom = { kind = \"beckmann\", roughness = [0.05, 0.3] }";
        let frosted = "top = { kind = \"smooth\" }\nbottom = { kind = \"beckmann\", roughness = 0.15 }";
        let board = "[background]\nkind = \"checkerboard\"\ndistance = 0.3\nsize = 0.2\ncolors = [1.0, 0.0]\n";
        let scenes = [("sheet", rough, board), ("sheet", frosted, board), ("sphere", rough, "")];
        for (object, faces, background) in scenes {
            let loaded = loaded(&format!(
                "[quality]\npreset = \"draft\"\n[tile]\ngeometry = {{ kind = \"flat\" }}\n[object]\nkind = \"{object}\"\n\
                 [camera]\nazimuth_deg = 20\nelevation_deg = 12\n{background}[slab]\n{faces}\n"
            ));
            let pipeline = Pipeline::new();
            let outcome = pipeline.slab(&loaded).unwrap();
            let render_scene = RenderScene::with(&pipeline, &loaded).unwrap();
            let scene = SlabScene::with(&pipeline, &loaded, &outcome, &render_scene).unwrap();
            let size = [96, 64];
            let exact = scene.render(&render_scene, size, 1, &Cancel::default()).unwrap().image;
            let ours = GpuSeenThrough::new(&gpu, &scene).unwrap().render(&gpu, &render_scene, size, 1).unwrap().image;
            let difference = |(a, b): (&Vec3, &Vec3)| (*a - *b).abs().max_element() / b.max_element().max(1.0);
            let worst = ours.pixels.iter().zip(&exact.pixels).map(difference).fold(0.0, f32::max);
            println!("{object}: worst difference {worst:.6}");
            assert!(worst < 1e-4, "{object}: {worst}");
            assert!(exact.pixels.iter().any(|pixel| pixel.max_element() > 0.1));
        }
    }

    #[test]
    fn refined_images_and_directional_lights_are_refused() {
        let Some(gpu) = Gpu::open().map_err(|error| eprintln!("SKIPPED: {error}")).ok() else { return };
        let text = |preset: &str, light: &str| {
            format!(
                "[quality]\npreset = \"{preset}\"\nslab_facets = 16\n[tile]\ngeometry = {{ kind = \"flat\" }}\n[slab]\n\
                 bounces = \"off\"\ntop = {{ kind = \"ggx\", roughness = 0.1 }}\nbottom = {{ kind = \"smooth\" }}\n{light}"
            )
        };
        let lit = "[[light.directional]]\ndirection = [0, 1, 1]\nirradiance = 1.0\n";
        for text in [text("standard", ""), text("draft", lit)] {
            let (pipeline, loaded) = (Pipeline::new(), loaded(&text));
            let outcome = pipeline.slab(&loaded).unwrap();
            let render_scene = RenderScene::with(&pipeline, &loaded).unwrap();
            let scene = SlabScene::with(&pipeline, &loaded, &outcome, &render_scene).unwrap();
            assert!(matches!(GpuSeenThrough::new(&gpu, &scene), Err(GpuError::Unsupported(_))), "{text}");
        }
    }
}
