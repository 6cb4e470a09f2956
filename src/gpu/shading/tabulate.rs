//! Shading tables that the GPU computes from a sum over facets: the twin of [`ShadingTable::build`]. Nothing is read
//! back.
//!
//! One dispatch adds one lobe, or the visible area, of some facets to its columns, with one thread per node. The last
//! dispatch fills in mirror images and the ends of θ_d. If facets are sampled per half vector, `sampled_facets.rs` has
//! the dispatches.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use super::column_terms::ColumnTerms;
use super::direct::{FacetBuffers, SOFTWARE_FACETS, Sum, pieces};
use super::sampled_facets::GroupSampling;
use super::table::GpuTable;
use super::visibility::GpuVisibility;
use super::{GpuShading, MAX_GROUPS, PaddedVec3, Pass, THREADS, Variant, padded};
use crate::effective::shading_table::columns::{Column, ColumnKind, Weight};
use crate::effective::{FacetSum, Interpolation, ShadingTable};
use crate::gpu::{Gpu, GpuError, Tier};
use crate::math::directions::{HemispherePairGrid, PolarGrid};

/// Largest number of lobes of one dispatch. It bounds the time of a dispatch on slow GPUs.
const MAX_LOBES: u64 = 1 << 30;

/// Largest number of facets from which one dispatch draws subsets.
const MAX_SAMPLED_FROM: usize = 1 << 19;

/// `Nodes` in `table_nodes.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(crate) struct GpuNodes {
    pairs: [u32; 4],
    columns: [u32; 3],
    column_count: u32,
    second_columns: [u32; 3],
    width: u32,
    shapes: [f32; 2],
    scales: [f32; 2],
    subset_size: f32,
    row_length: u32,
    crowding: f32,
    lowest: f32,
}

impl GpuNodes {
    /// Returns the nodes with the parameters of sampling. `lobes` holds number, shape and scale of one lobe or two.
    pub(crate) fn with_lobes(
        self,
        second_columns: &[u32],
        lobes: [[f32; 3]; 2],
        subset_size: f32,
        row_length: usize,
    ) -> Self {
        let [[_, shape, scale], [_, other_shape, other_scale]] = lobes;
        let column = |k: usize| second_columns.get(k).copied().unwrap_or_default();
        Self {
            second_columns: [column(0), column(1), column(2)],
            shapes: [shape, other_shape],
            scales: [scale, other_scale],
            subset_size,
            row_length: row_length as u32,
            ..self
        }
    }
}

/// `Angle` in `table_nodes.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Angle {
    cosine: f32,
    sine: f32,
    image: u32,
    is_reversed: u32,
}

/// Dispatches that must run before the first image: they compute a table, or horizon bounds.
#[derive(Debug)]
pub(crate) struct Preparation {
    /// Buffers to which the dispatches add: the table, and the projected areas.
    pub(crate) sums: Vec<wgpu::Buffer>,
    steps: Vec<Step>,
}

/// One dispatch.
#[derive(Debug)]
pub(crate) struct Step {
    pub(crate) pipeline: wgpu::ComputePipeline,
    pub(crate) groups: Vec<wgpu::BindGroup>,
    pub(crate) workgroups: [u32; 2],
    /// Number of lobes that all its threads evaluate.
    pub(crate) lobes: u64,
}

impl Preparation {
    /// Wraps one dispatch that adds to no buffer.
    pub(crate) fn of(step: Step) -> Self {
        Self { sums: Vec::new(), steps: vec![step] }
    }

    /// Splits the dispatches into parts of at most `max_lobes` lobes, or of one dispatch.
    pub(crate) fn parts(&self, max_lobes: u64) -> Vec<Range<usize>> {
        let (mut parts, mut lobes) = (Vec::<Range<usize>>::new(), 0);
        for (k, step) in self.steps.iter().enumerate() {
            match parts.last_mut() {
                Some(part) if lobes + step.lobes <= max_lobes => {
                    part.end = k + 1;
                    lobes += step.lobes;
                }
                _ => {
                    parts.push(k..k + 1);
                    lobes = step.lobes;
                }
            }
        }
        parts
    }

    /// Records a part. It adds to the sums, which must be zeros before the first part.
    pub(crate) fn dispatch(&self, compute: &mut wgpu::ComputePass, part: Range<usize>) {
        for Step { pipeline, groups, workgroups: [columns, rows], .. } in &self.steps[part] {
            compute.set_pipeline(pipeline);
            for (group, index) in groups.iter().zip(0..) {
                compute.set_bind_group(index, group, &[]);
            }
            compute.dispatch_workgroups(*columns, *rows, 1);
        }
    }
}

/// Shape of a table: its grid, the mirror planes of the tile, and the number of columns in units of four.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TableShape {
    pub(crate) grid: HemispherePairGrid,
    pub(crate) mirrors: [bool; 2],
    vec4s: usize,
}

impl TableShape {
    fn rows(self) -> usize {
        self.grid.half_vectors() * self.grid.phi_d
    }

    fn numbers(self) -> usize {
        4 * self.vec4s * self.rows() * (self.grid.theta_d + 2)
    }

    pub(crate) fn nodes(self, columns: &[u32]) -> GpuNodes {
        let HemispherePairGrid { rings, azimuths, phi_d, theta_d } = self.grid;
        let column = |k: usize| columns.get(k).copied().unwrap_or_default();
        GpuNodes {
            pairs: [rings, azimuths, phi_d, theta_d].map(|n| n as u32),
            columns: [column(0), column(1), column(2)],
            column_count: columns.len() as u32,
            width: 4 * self.vec4s as u32,
            crowding: HemispherePairGrid::CROWDING,
            lowest: HemispherePairGrid::MIN_SINE,
            ..GpuNodes::zeroed()
        }
    }

    /// Returns the azimuths of h, then the steps of φ_d.
    fn angles(self) -> Vec<Angle> {
        let angle = |radians: f32, (image, is_reversed): (usize, bool)| {
            let (sine, cosine) = radians.sin_cos();
            Angle { cosine, sine, image: image as u32, is_reversed: is_reversed.into() }
        };
        let grid = self.grid;
        let azimuths = (0..grid.azimuths).map(|k| angle(grid.phi_h(k), grid.image(k, self.mirrors)));
        azimuths.chain((0..grid.phi_d).map(|k| angle(grid.phi_d(k), (k, false)))).collect()
    }

    /// Returns the largest number of facets of one dispatch.
    fn max_facets(self, gpu: &Gpu) -> usize {
        if gpu.tier == Tier::Software {
            return SOFTWARE_FACETS;
        }
        let nodes = self.grid.originals(self.mirrors) as u64;
        (MAX_LOBES / nodes.max(1)).max(SOFTWARE_FACETS as u64) as usize
    }
}

/// Workgroups along the first axis of a dispatch. They are few, so that small tables use the second axis as large ones
/// do.
const COLUMNS: usize = 16;

/// Returns workgroups along two axes for a number of threads; excess threads do nothing.
pub(crate) fn workgroups(threads: usize) -> Result<[u32; 2], GpuError> {
    let rows = threads.div_ceil(THREADS as usize * COLUMNS);
    if rows > MAX_GROUPS {
        return Err(GpuError::Unsupported(format!("a table of {threads} numbers")));
    }
    Ok([COLUMNS, rows].map(|n| n as u32))
}

/// Returns the columns that one sum over facets fills: one, or one per channel.
pub(crate) fn columns_of(columns: &[Column], sum: &Column) -> Vec<u32> {
    let same = |column: &Column| (column.group, column.kind) == (sum.group, sum.kind);
    columns.iter().zip(0..).filter(|(column, _)| same(column)).map(|(_, column)| column).collect()
}

fn refused(reason: &str) -> GpuError {
    GpuError::Unsupported(reason.to_owned())
}

impl GpuShading {
    /// Returns the pass of a table that the GPU computes from a sum over facets, and the dispatches that compute it.
    ///
    /// # Errors
    /// [`GpuError::Unsupported`] for measured BRDFs and for sums of too many parts, and errors of the GPU.
    pub(super) fn tabulated(
        &mut self,
        gpu: &Gpu,
        (sum, visibility): (&FacetSum, &GpuVisibility),
        (nodes, interpolation): (crate::effective::Nodes, Interpolation),
        shadowed: bool,
    ) -> Result<(Pass, Preparation), GpuError> {
        let crate::effective::Nodes { grid, mirrors, facets: subset_size, .. } = nodes;
        let columns = Column::of(sum).ok_or_else(|| refused("the sum has too many parts for a table to pay"))?;
        let weights: Vec<Weight> = columns.iter().map(|column| column.weight(sum)).collect();
        let terms = ColumnTerms::of(&weights)?;
        let shape = TableShape { grid, mirrors: Weight::mirrors(&weights, mirrors), vec4s: terms.vec4s };
        let directions = ShadingTable::area_grid();
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        let values = gpu.buffer("table", 4 * shape.numbers() as u64, usage)?;
        let areas = gpu.buffer("projected areas", 4 * directions.len() as u64, usage)?;
        let table =
            GpuTable { grid, interpolation, columns: terms, directions, values: values.clone(), areas: areas.clone() };
        let pass = self.gpu_table_pass(gpu, table, shadowed)?;
        let buffers = FacetBuffers::of(gpu, sum, visibility)?;
        let of = (sum, visibility, &buffers);
        let mut steps = self.area_steps(gpu, of, directions, &areas)?;
        steps.extend(self.column_steps(gpu, of, (&columns, subset_size), shape, &values)?);
        Ok((pass, Preparation { sums: vec![values, areas], steps }))
    }

    fn area_steps(
        &mut self,
        gpu: &Gpu,
        (sum, visibility, buffers): (&FacetSum, &GpuVisibility, &FacetBuffers),
        directions: PolarGrid,
        areas: &wgpu::Buffer,
    ) -> Result<Vec<Step>, GpuError> {
        let facets = sum.facet_count();
        let max_facets = if gpu.tier == Tier::Software { SOFTWARE_FACETS } else { facets.max(1) };
        let directions_buffer: Vec<PaddedVec3> = directions.directions().into_iter().map(padded).collect();
        let directions_buffer = gpu.upload("directions", &directions_buffer, wgpu::BufferUsages::STORAGE)?;
        let nodes = self.nodes_group(gpu, GpuNodes::zeroed(), &directions_buffer, areas)?;
        let visibility_swap = ("visibility_unblocked", visibility.shader_name());
        let variant =
            Variant { shader: "table_areas", entry_point: "add", swaps: vec![visibility_swap], constants: Vec::new() };
        let layouts = [self.nodes.clone(), self.facets.clone()];
        let pipeline = self.pipeline_over(gpu, variant, &layouts.each_ref())?;
        let step = |range: Range<usize>| {
            let groups = vec![nodes.clone(), self.sum_group(gpu, buffers, Sum::empty(sum, visibility).over(&range))?];
            let lobes = (directions.len() * range.len()) as u64;
            Ok(Step { pipeline: pipeline.clone(), groups, workgroups: [directions.len() as u32, 1], lobes })
        };
        pieces(0..facets, max_facets).map(step).collect()
    }

    fn column_steps(
        &mut self,
        gpu: &Gpu,
        (sum, visibility, buffers): (&FacetSum, &GpuVisibility, &FacetBuffers),
        (columns, subset_size): (&[Column], Option<usize>),
        shape: TableShape,
        values: &wgpu::Buffer,
    ) -> Result<Vec<Step>, GpuError> {
        // Sampling pays below half of the facets, and one dispatch cannot draw from very many.
        let subset_size =
            subset_size.filter(|&count| sum.facet_count() >= 2 * count && sum.facet_count() <= MAX_SAMPLED_FROM);
        let angles = gpu.upload("angles", &shape.angles(), wgpu::BufferUsages::STORAGE)?;
        let visibility_shader = visibility.shader_name();
        let layouts = [self.nodes.clone(), self.facets.clone()];
        let mut steps = Vec::new();
        // The first channel fills the columns of all channels.
        for column in columns.iter().filter(|column| column.channel.is_none_or(|channel| channel == 0)) {
            if let (Some(count), ColumnKind::Lobe(lobe)) = (subset_size, column.kind) {
                if lobe == 0 {
                    let of = GroupSampling { sum, visibility, buffers, columns, group: column.group, count };
                    steps.extend(self.sampling_steps(gpu, &of, shape, [&angles, values])?);
                }
                continue;
            }
            let empty = Sum::empty(sum, visibility);
            let (sum_swap, lobe_sum) = match column.kind {
                ColumnKind::Lobe(lobe) => {
                    let (shader, lobe_sum) = empty.with_lobe(sum.groups()[column.group].lobes[lobe].0);
                    (("lobe_lambertian", shader), lobe_sum)
                }
                ColumnKind::Area(_) => (("sum_facets", "sum_visible_areas"), empty),
                ColumnKind::Measured { .. } => {
                    return Err(refused("measured BRDFs are summed over facets on the CPU only"));
                }
            };
            let swaps = vec![
                ("visibility_unblocked", visibility_shader),
                sum_swap,
                ("weights_area", if column.channel.is_some() { "weights_rgb" } else { "weights_area" }),
            ];
            let variant = Variant { shader: "table_of_sum", entry_point: "add", swaps, constants: Vec::new() };
            let pipeline = self.pipeline_over(gpu, variant, &layouts.each_ref())?;
            let nodes = self.nodes_group(gpu, shape.nodes(&columns_of(columns, column)), &angles, values)?;
            for range in pieces(column.facets(sum), shape.max_facets(gpu)) {
                let groups = vec![nodes.clone(), self.sum_group(gpu, buffers, lobe_sum.over(&range))?];
                let lobes = (shape.grid.originals(shape.mirrors) * range.len()) as u64;
                let workgroups = workgroups(shape.grid.nodes())?;
                steps.push(Step { pipeline: pipeline.clone(), groups, workgroups, lobes });
            }
        }
        let ends = Variant { shader: "table_borders", entry_point: "extend", swaps: Vec::new(), constants: Vec::new() };
        steps.push(Step {
            pipeline: self.pipeline_over(gpu, ends, &[&layouts[0]])?,
            groups: vec![self.nodes_group(gpu, shape.nodes(&[]), &angles, values)?],
            workgroups: workgroups(4 * shape.vec4s * shape.rows())?,
            lobes: shape.numbers() as u64,
        });
        Ok(steps)
    }

    pub(crate) fn nodes_group(
        &self,
        gpu: &Gpu,
        nodes: GpuNodes,
        angles: &wgpu::Buffer,
        sums: &wgpu::Buffer,
    ) -> Result<wgpu::BindGroup, GpuError> {
        let uniform = gpu.upload("nodes", &[nodes], wgpu::BufferUsages::UNIFORM)?;
        gpu.group("nodes of a table", &self.nodes, &[&uniform, angles, sums].map(|buffer| buffer.as_entire_binding()))
    }
}

#[cfg(test)]
#[path = "tabulate_tests.rs"]
mod tests;
