//! Toroidal shadow maps on the GPU: the twin of [`crate::visibility::shadow_map`], which describes the method.
//!
//! A compute pass draws the triangles, not the raster pipeline, because the map is a torus. A render target would need
//! the triangles that cross its border drawn two to four times. The compute pass also decides coverage and ties as the
//! CPU twin does. One thread draws one triangle for one direction. Large triangles are cut into pieces first, so that
//! threads take similar times. Without 64-bit atomics, the height and the triangle of a texel take two passes.
//! Directions are processed in batches of maps that fit the buffers of the GPU.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::base::Cancel;
use crate::geometry::{Facets, TileMesh};
use crate::gpu::device::pipelines::{READ, UNIFORM, WRITE};
use crate::gpu::{Gpu, GpuError};
use crate::visibility::PackedVisibility;
use crate::visibility::shadow_view::{ShadowView, affordable_resolution, max_coordinate};

/// Largest size of the maps of one batch in bytes, so that they fit on small GPUs.
const BATCH_BYTES: u64 = 128 << 20;
/// Largest number of triangles times directions of one batch.
const BATCH_TRIANGLES: u64 = 8 << 20;
/// Largest number of triangles times directions of one submission. It keeps submissions far below the timeout of
/// drivers.
const SUBMITTED_TRIANGLES: u64 = 64 << 20;
/// Longest edge that is not cut, as a fraction of the tile.
const LONGEST_EDGE: f32 = 1.0 / 16.0;
/// Largest number of pieces that cutting adds to the triangles of a mesh.
const MAX_PIECES: usize = 1 << 18;
const THREADS: u32 = 64;

/// The compiled pipelines of `shadow_map.wgsl`, for any number of tiles.
#[derive(Debug)]
pub struct GpuShadowMaps {
    layout: wgpu::BindGroupLayout,
    draw_heights: wgpu::ComputePipeline,
    draw_triangles: wgpu::ComputePipeline,
    test_facets: wgpu::ComputePipeline,
}

/// Computes [`GpuShadowMaps::visibility`] with pipelines that are compiled for this call only.
pub fn visibility_maps_gpu(
    gpu: &Gpu,
    mesh: &TileMesh,
    facets: &Facets,
    directions: &[Vec3],
    resolution: u32,
    cancel: &Cancel,
) -> Result<PackedVisibility, GpuError> {
    GpuShadowMaps::new(gpu)?.visibility(gpu, mesh, facets, directions, resolution, cancel)
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
    first_view: u32,
    direction_count: u32,
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

/// Shadow maps that submissions will draw, and the buffer of the resulting visibility.
#[derive(Debug)]
pub struct GpuMaps {
    /// The pipelines for heights, triangles and facets, with their numbers of workgroups.
    passes: [(wgpu::ComputePipeline, u32); 3],
    /// Bindings of each batch, and its number of directions.
    batches: Vec<(wgpu::BindGroup, u32)>,
    maps: [wgpu::Buffer; 2],
    /// Each word holds the bits of 32 facets for one direction; the directions are adjacent. Zeros until the maps are
    /// drawn.
    pub bits: wgpu::Buffer,
    /// Number of batches that one submission may draw.
    batches_per_submission: usize,
}

impl GpuShadowMaps {
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let module = gpu.module("shadow_map")?;
        let bindings = [UNIFORM, READ, READ, READ, READ, WRITE, WRITE, WRITE, READ];
        let layout = gpu.layout("shadow maps", wgpu::ShaderStages::COMPUTE, &bindings)?;
        Ok(Self {
            draw_heights: gpu.compute_pipeline(&module, "draw_heights", &[&layout])?,
            draw_triangles: gpu.compute_pipeline(&module, "draw_triangles", &[&layout])?,
            test_facets: gpu.compute_pipeline(&module, "test_facets", &[&layout])?,
            layout,
        })
    }

    /// Computes the facets that are visible from each direction, like [`crate::visibility::visibility_maps_cpu`] up to
    /// rounding. The result is undefined once `cancel` is set.
    pub fn visibility(
        &self,
        gpu: &Gpu,
        mesh: &TileMesh,
        facets: &Facets,
        directions: &[Vec3],
        resolution: u32,
        cancel: &Cancel,
    ) -> Result<PackedVisibility, GpuError> {
        let mut visibility = PackedVisibility::new(facets.len(), directions.len());
        let maps = self.maps(gpu, mesh, facets, directions, resolution)?;
        for batches in maps.batches() {
            gpu.checked("drawing shadow maps", || {
                let mut encoder =
                    gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("shadow maps") });
                for batch in batches {
                    maps.maps.iter().for_each(|map| encoder.clear_buffer(map, 0, None));
                    maps.draw(batch, &mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()));
                }
                gpu.queue.submit([encoder.finish()]);
                Ok(())
            })?;
            // Waits after each submission, because a window may draw on the same GPU and the caller may cancel.
            gpu.wait("drawing shadow maps")?;
            if cancel.is_set() {
                return Ok(visibility);
            }
        }
        let bits: Vec<u32> = gpu.read(&maps.bits)?;
        let (words, count) = (visibility.words_per_row(), directions.len());
        for d in 0..count {
            for (word, to) in visibility.row_mut(d).iter_mut().enumerate().take(words) {
                *to = bits[word * count + d];
            }
        }
        Ok(visibility)
    }

    /// Uploads the tile and its facets, and prepares the batches.
    ///
    /// # Errors
    /// Errors of the GPU.
    pub fn maps(
        &self,
        gpu: &Gpu,
        mesh: &TileMesh,
        facets: &Facets,
        directions: &[Vec3],
        resolution: u32,
    ) -> Result<GpuMaps, GpuError> {
        use wgpu::BufferUsages as Usage;
        let (extent, resolution) = (max_coordinate(mesh), affordable_resolution(mesh, resolution));
        let views = directions.iter().enumerate();
        let views = views.filter_map(|(d, &w)| Some((d as u32, ShadowView::new(mesh.size, extent, w, resolution)?)));
        let (numbers, views): (Vec<u32>, Vec<ShadowView>) = views.filter(|_| !facets.is_empty()).unzip();
        let stride = views.iter().map(|view| view.texels() as u64).max().unwrap_or(1);
        let corners = cut_large_triangles(mesh);
        let words = facets.len().div_ceil(32);
        let max_bytes = BATCH_BYTES.min(gpu.limits.max_storage_buffer_binding_size);
        let max_directions = BATCH_TRIANGLES / corners.len().max(1) as u64;
        let max_groups = gpu.limits.max_compute_workgroups_per_dimension;
        let batch = (max_bytes / (8 * stride))
            .min(max_directions)
            .clamp(1, u64::from(max_groups))
            .min(views.len().max(1) as u64);

        let (lowest, highest) = mesh.z_range();
        let params = Params {
            corner_count: corners.len() as u32,
            facet_count: facets.len() as u32,
            words_per_row: words as u32,
            map_stride: stride as u32,
            lowest,
            same_height: 4.0 * f32::EPSILON * (highest - lowest),
            first_view: 0,
            direction_count: directions.len() as u32,
        };
        let normals: Vec<[f32; 4]> =
            (0..mesh.triangles.len()).map(|k| mesh.geometric_normal(k).extend(0.0).into()).collect();
        let facet_rows = facets.positions.iter().zip(&facets.geometric_normals);
        let facet_rows: Vec<Facet> =
            facet_rows.map(|(p, n)| Facet { position: (*p).into(), pad_p: 0, normal: (*n).into(), pad_n: 0 }).collect();
        let gpu_views: Vec<View> = views.iter().map(gpu_view).collect();
        let map = |label| gpu.buffer(label, 4 * stride * batch, Usage::STORAGE | Usage::COPY_DST);
        let maps = [map("shadow maps (heights)")?, map("shadow maps (triangles)")?];
        let bits = gpu.buffer("visibility", 4 * (words * directions.len()) as u64, Usage::STORAGE | Usage::COPY_SRC)?;
        let bound = [
            &gpu.upload("views", &gpu_views, Usage::STORAGE)?,
            &gpu.upload("triangles", &corners, Usage::STORAGE)?,
            &gpu.upload("triangle normals", &normals, Usage::STORAGE)?,
            &gpu.upload("facets", &facet_rows, Usage::STORAGE)?,
            &maps[0],
            &maps[1],
            &bits,
            &gpu.upload("numbers of views", &numbers, Usage::STORAGE)?,
        ];
        let batches = (0..views.len()).step_by(batch as usize).map(|first| {
            let params = gpu.upload("parameters", &[Params { first_view: first as u32, ..params }], Usage::UNIFORM)?;
            let bound: Vec<_> = std::iter::once(&params).chain(bound).map(wgpu::Buffer::as_entire_binding).collect();
            Ok((gpu.group("shadow maps", &self.layout, &bound)?, (views.len() - first).min(batch as usize) as u32))
        });
        let groups = |items: u32| items.div_ceil(THREADS).clamp(1, max_groups);
        Ok(GpuMaps {
            passes: [
                (self.draw_heights.clone(), groups(params.corner_count)),
                (self.draw_triangles.clone(), groups(params.corner_count)),
                (self.test_facets.clone(), groups(params.words_per_row)),
            ],
            batches: batches.collect::<Result<_, GpuError>>()?,
            maps,
            bits,
            batches_per_submission: (SUBMITTED_TRIANGLES / (batch * corners.len().max(1) as u64)).max(1) as usize,
        })
    }
}

impl GpuMaps {
    /// Returns the batches of each submission.
    pub fn batches(&self) -> impl Iterator<Item = std::ops::Range<usize>> {
        let count = self.batches.len();
        (0..count)
            .step_by(self.batches_per_submission)
            .map(move |first| first..(first + self.batches_per_submission).min(count))
    }

    /// Returns the buffers that must be cleared before each batch.
    pub fn cleared_buffers(&self) -> Vec<&wgpu::Buffer> {
        self.maps.iter().collect()
    }

    /// Records one batch into a compute pass.
    pub fn draw(&self, batch: usize, pass: &mut wgpu::ComputePass) {
        let (group, directions) = &self.batches[batch];
        for (pipeline, groups) in &self.passes {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(*groups, *directions, 1);
        }
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

/// Returns the triangles of the mesh. Those with long edges are halved across the longest edge until none is left.
/// Triangles that are not finite are omitted, because the loop of a shader over them might not end.
fn cut_large_triangles(mesh: &TileMesh) -> Vec<Corners> {
    let longest = LONGEST_EDGE * mesh.size.min_element();
    let mut pieces = Vec::with_capacity(mesh.triangles.len());
    let mut cuts_left = MAX_PIECES;
    let mut open = Vec::new();
    for triangle in 0..mesh.triangles.len() {
        open.push(mesh.corners(triangle));
        if !open.iter().flatten().all(|p| p.is_finite()) {
            open.clear();
        }
        while let Some([a, b, c]) = open.pop() {
            let (ab, bc, ca) = (a.distance_squared(b), b.distance_squared(c), c.distance_squared(a));
            if ab.max(bc).max(ca) > longest * longest && cuts_left > 0 {
                cuts_left -= 1;
                // Rotates the corners so that the longest edge comes first.
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
