//! Toroidal shadow maps on wgpu: the twin of [`super::shadow_map`], which says how they work.
//!
//! A compute pass draws the triangles, not the raster pipeline: the map is a torus, which only our own addressing wraps
//! (a render target would need the triangles that cross its border drawn two to four times, or a margin folded back), and
//! it decides coverage and ties as the CPU twin does. One thread draws one triangle for one direction; large triangles are
//! cut into pieces first, so that no thread draws for long. Without 64-bit atomics a texel's height and triangle take
//! two passes. Directions go through in batches of maps that fit the device's buffers.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::PackedVisibility;
use super::shadow_view::{ShadowView, affordable, extent};
use crate::geometry::{Facets, TileMesh};
use crate::gpu::pipelines::{READ, UNIFORM, WRITE};
use crate::gpu::{Gpu, GpuError};

/// Bytes of the maps of one batch: what a small card has to spare.
const BATCH_BYTES: u64 = 128 << 20;
/// Triangles drawn by one submission: fractions of a second, far from any driver's watchdog.
const BATCH_TRIANGLES: u64 = 8 << 20;
/// Edges longer than this part of the tile are cut.
const LONGEST_EDGE: f32 = 1.0 / 16.0;
/// No mesh is cut into more pieces than this beyond its own number of triangles.
const MOST_PIECES: usize = 1 << 18;
const THREADS: u32 = 64;

/// `shadow_map.wgsl`, compiled: build once, use for any number of tiles.
#[derive(Debug)]
pub struct GpuShadowMaps {
    layout: wgpu::BindGroupLayout,
    draw_heights: wgpu::ComputePipeline,
    draw_triangles: wgpu::ComputePipeline,
    test_facets: wgpu::ComputePipeline,
}

/// [`GpuShadowMaps::visibility`] with pipelines built for this one call.
pub fn visibility_maps_gpu(
    gpu: &Gpu,
    mesh: &TileMesh,
    facets: &Facets,
    directions: &[Vec3],
    resolution: u32,
) -> Result<PackedVisibility, GpuError> {
    GpuShadowMaps::new(gpu)?.visibility(gpu, mesh, facets, directions, resolution)
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Params {
    corner_count: u32,
    facet_count: u32,
    words_per_row: u32,
    map_stride: u32,
    lowest: f32,
    same_height: f32,
    pad: [u32; 2],
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct View {
    direction: [f32; 3],
    tolerance: f32,
    column_from_tile: [f32; 3],
    columns: u32,
    row_from_tile: [f32; 3],
    rows: u32,
    plane_from_texel: [f32; 4],
}

/// A triangle or a piece of it.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Corners {
    a: [f32; 3],
    triangle: u32,
    b: [f32; 3],
    pad_b: u32,
    c: [f32; 3],
    pad_c: u32,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Facet {
    position: [f32; 3],
    pad_p: u32,
    normal: [f32; 3],
    pad_n: u32,
}

/// The buffers of one call.
struct Buffers {
    heights: wgpu::Buffer,
    triangles: wgpu::Buffer,
    visible: wgpu::Buffer,
    staging: wgpu::Buffer,
    views: wgpu::Buffer,
    group: wgpu::BindGroup,
}

impl GpuShadowMaps {
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let module = gpu.module("shadow_map")?;
        let bindings = [UNIFORM, READ, READ, READ, READ, WRITE, WRITE, WRITE];
        let layout = gpu.layout("shadow maps", wgpu::ShaderStages::COMPUTE, &bindings)?;
        Ok(Self {
            draw_heights: gpu.compute_pipeline(&module, "draw_heights", &[&layout])?,
            draw_triangles: gpu.compute_pipeline(&module, "draw_triangles", &[&layout])?,
            test_facets: gpu.compute_pipeline(&module, "test_facets", &[&layout])?,
            layout,
        })
    }

    /// Which facets each direction sees, as [`super::visibility_maps_cpu`] answers it but for rounding.
    pub fn visibility(
        &self,
        gpu: &Gpu,
        mesh: &TileMesh,
        facets: &Facets,
        directions: &[Vec3],
        resolution: u32,
    ) -> Result<PackedVisibility, GpuError> {
        let mut visibility = PackedVisibility::new(facets.len(), directions.len());
        let extent = extent(mesh);
        let views = directions.iter().enumerate();
        let resolution = affordable(mesh, resolution);
        let views = views.filter_map(|(d, &w)| Some((d, ShadowView::new(mesh.size, extent, w, resolution)?)));
        let views: Vec<(usize, ShadowView)> = views.collect();
        let Some(stride) = views.iter().map(|(_, view)| view.texels() as u64).max().filter(|_| !facets.is_empty())
        else {
            return Ok(visibility);
        };
        let corners = cut_large_triangles(mesh);
        let words = visibility.words_per_row();
        let most = BATCH_BYTES.min(gpu.limits.max_storage_buffer_binding_size);
        let batch =
            (most / (8 * stride)).min(most / (4 * words as u64)).min(BATCH_TRIANGLES / corners.len().max(1) as u64);
        let groups_per_side = gpu.limits.max_compute_workgroups_per_dimension;
        let batch = batch.clamp(1, u64::from(groups_per_side)).min(views.len() as u64) as usize;

        let (lowest, highest) = mesh.z_range();
        let params = Params {
            corner_count: corners.len() as u32,
            facet_count: facets.len() as u32,
            words_per_row: words as u32,
            map_stride: stride as u32,
            lowest,
            same_height: 4.0 * f32::EPSILON * (highest - lowest),
            pad: [0; 2],
        };
        let buffers = self.buffers(gpu, mesh, facets, &corners, params, batch)?;
        for batch in views.chunks(batch) {
            let gpu_views: Vec<View> = batch.iter().map(|(_, view)| gpu_view(view)).collect();
            gpu.write(&buffers.views, &gpu_views)?;
            gpu.checked("drawing shadow maps", || {
                self.submit(gpu, &buffers, &params, batch.len() as u32);
                Ok(())
            })?;
            let rows: Vec<u32> = gpu.checked("reading visibility back", || gpu.map(&buffers.staging))?;
            for ((d, _), row) in batch.iter().zip(rows.chunks_exact(words)) {
                visibility.row_mut(*d).copy_from_slice(row);
            }
        }
        Ok(visibility)
    }

    fn buffers(
        &self,
        gpu: &Gpu,
        mesh: &TileMesh,
        facets: &Facets,
        corners: &[Corners],
        params: Params,
        batch: usize,
    ) -> Result<Buffers, GpuError> {
        use wgpu::BufferUsages as Usage;
        let normals: Vec<[f32; 4]> =
            (0..mesh.triangles.len()).map(|k| mesh.geometric_normal(k).extend(0.0).into()).collect();
        let facets = facets.positions.iter().zip(&facets.geometric_normals);
        let facets: Vec<Facet> =
            facets.map(|(p, n)| Facet { position: (*p).into(), pad_p: 0, normal: (*n).into(), pad_n: 0 }).collect();
        let map_bytes = 4 * u64::from(params.map_stride) * batch as u64;
        let row_bytes = 4 * u64::from(params.words_per_row) * batch as u64;

        let params = gpu.upload("parameters", &[params], Usage::UNIFORM)?;
        let views = gpu.buffer("views", (batch * size_of::<View>()) as u64, Usage::STORAGE | Usage::COPY_DST)?;
        let corners = gpu.upload("triangles", corners, Usage::STORAGE)?;
        let normals = gpu.upload("triangle normals", &normals, Usage::STORAGE)?;
        let facets = gpu.upload("facets", &facets, Usage::STORAGE)?;
        let heights = gpu.buffer("shadow maps (heights)", map_bytes, Usage::STORAGE | Usage::COPY_DST)?;
        let triangles = gpu.buffer("shadow maps (triangles)", map_bytes, Usage::STORAGE | Usage::COPY_DST)?;
        let visible = gpu.buffer("visibility", row_bytes, Usage::STORAGE | Usage::COPY_SRC)?;
        let staging = gpu.buffer("visibility read-back", visible.size(), Usage::COPY_DST | Usage::MAP_READ)?;
        let bound = [&params, &views, &corners, &normals, &facets, &heights, &triangles, &visible];
        let bound = bound.map(|buffer| buffer.as_entire_binding());
        let group = gpu.group("shadow maps", &self.layout, &bound)?;
        Ok(Buffers { heights, triangles, visible, staging, views, group })
    }

    fn submit(&self, gpu: &Gpu, buffers: &Buffers, params: &Params, directions: u32) {
        let mut encoder =
            gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("shadow maps") });
        encoder.clear_buffer(&buffers.heights, 0, None);
        encoder.clear_buffer(&buffers.triangles, 0, None);
        let most = gpu.limits.max_compute_workgroups_per_dimension;
        let groups = |items: u32| items.div_ceil(THREADS).clamp(1, most);
        for (pipeline, groups) in [
            (&self.draw_heights, groups(params.corner_count)),
            (&self.draw_triangles, groups(params.corner_count)),
            (&self.test_facets, groups(params.words_per_row)),
        ] {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &buffers.group, &[]);
            pass.dispatch_workgroups(groups, directions, 1);
        }
        encoder.copy_buffer_to_buffer(&buffers.visible, 0, &buffers.staging, 0, buffers.visible.size());
        gpu.queue.submit([encoder.finish()]);
    }
}

fn gpu_view(view: &ShadowView) -> View {
    let [column, row] = view.plane_from_texel;
    View {
        direction: view.direction.into(),
        tolerance: view.tolerance,
        column_from_tile: view.texel_from_tile[0].into(),
        columns: view.size[0],
        row_from_tile: view.texel_from_tile[1].into(),
        rows: view.size[1],
        plane_from_texel: [column.x, column.y, row.x, row.y],
    }
}

/// The mesh's triangles, those with long edges halved across the longest until none is left. Triangles that are not
/// finite are left out: a shader's loop over one might not end.
fn cut_large_triangles(mesh: &TileMesh) -> Vec<Corners> {
    let longest = LONGEST_EDGE * mesh.size.min_element();
    let mut pieces = Vec::with_capacity(mesh.triangles.len());
    let mut left_to_cut = MOST_PIECES;
    let mut open = Vec::new();
    for triangle in 0..mesh.triangles.len() {
        open.push(mesh.corners(triangle));
        if !open.iter().flatten().all(|p| p.is_finite()) {
            open.clear();
        }
        while let Some([a, b, c]) = open.pop() {
            let (ab, bc, ca) = (a.distance_squared(b), b.distance_squared(c), c.distance_squared(a));
            if ab.max(bc).max(ca) > longest * longest && left_to_cut > 0 {
                left_to_cut -= 1;
                // Turned so that the longest edge comes first.
                let [a, b, c] = if ab >= bc && ab >= ca {
                    [a, b, c]
                } else if bc >= ca {
                    [b, c, a]
                } else {
                    [c, a, b]
                };
                let middle = 0.5 * (a + b);
                open.extend([[a, middle, c], [middle, b, c]]);
            } else {
                let triangle = triangle as u32;
                pieces.push(Corners { a: a.into(), triangle, b: b.into(), pad_b: 0, c: c.into(), pad_c: 0 });
            }
        }
    }
    pieces
}
