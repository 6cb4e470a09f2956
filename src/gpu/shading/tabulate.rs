//! A table for pictures that the device makes of a sum over facets: nothing is read back, and nobody waits.
//!
//! The twin of [`ShadingTable::build`]. One dispatch adds one lobe, or the area that is seen, over some facets to its columns, a
//! thread a node; the last one fills in mirror images and the ends of θ_d. Where part of the facets are to be picked for each
//! half vector, `picked.rs` has the steps.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use super::column_terms::ColumnTerms;
use super::direct::{SOFTWARE_FACETS, Shared, Sum, pieces};
use super::sampled_facets::OfGroup;
use super::table::Held;
use super::visibility::GpuVisibility;
use super::{GpuShading, MAX_GROUPS, Padded, Pass, THREADS, Variant, padded};
use crate::effective::shading_table::columns::{Column, Part, Weight};
use crate::effective::{FacetSum, Interpolation, ShadingTable};
use crate::gpu::{Gpu, GpuError, Tier};
use crate::math::directions::{HemispherePairGrid, PolarGrid};

/// Lobes of one dispatch: slow devices take a fifth of a second. A submission holds no more than its renderer allows.
const MAX_LOBES: u64 = 1 << 30;

/// Facets of which some are picked, in one dispatch.
const MAX_TO_PICK_FROM: usize = 1 << 19;

/// `Nodes` in `table_nodes.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(crate) struct Nodes {
    pairs: [u32; 4],
    columns: [u32; 3],
    column_count: u32,
    seconds: [u32; 3],
    width: u32,
    shapes: [f32; 2],
    scales: [f32; 2],
    picked: f32,
    room: u32,
    crowding: f32,
    lowest: f32,
}

impl Nodes {
    /// The same where facets are picked, for one lobe or two: numbers, shapes and scales of these.
    pub(crate) fn with_lobes(self, seconds: &[u32], lobes: [[f32; 3]; 2], picked: f32, room: usize) -> Self {
        let [[_, shape, scale], [_, other_shape, other_scale]] = lobes;
        let place = |k: usize| seconds.get(k).copied().unwrap_or_default();
        Self {
            seconds: [place(0), place(1), place(2)],
            shapes: [shape, other_shape],
            scales: [scale, other_scale],
            picked,
            room: room as u32,
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
    is_turned: u32,
}

/// What is made before the first picture: a table, or less.
#[derive(Debug)]
pub(crate) struct Making {
    /// Buffers that are added to: the table, and the projected areas.
    pub(crate) sums: Vec<wgpu::Buffer>,
    steps: Vec<Step>,
}

/// A dispatch.
#[derive(Debug)]
pub(crate) struct Step {
    pub(crate) pipeline: wgpu::ComputePipeline,
    pub(crate) groups: Vec<wgpu::BindGroup>,
    pub(crate) workgroups: [u32; 2],
    /// Facets of all its threads together.
    pub(crate) lobes: u64,
}

impl Making {
    /// One dispatch that adds to nothing.
    pub(crate) fn of(step: Step) -> Self {
        Self { sums: Vec::new(), steps: vec![step] }
    }

    /// Runs of dispatches of no more lobes than these together, or of one dispatch.
    pub(crate) fn parts(&self, most: u64) -> Vec<Range<usize>> {
        let (mut parts, mut held) = (Vec::<Range<usize>>::new(), 0);
        for (k, step) in self.steps.iter().enumerate() {
            match parts.last_mut() {
                Some(part) if held + step.lobes <= most => {
                    part.end = k + 1;
                    held += step.lobes;
                }
                _ => {
                    parts.push(k..k + 1);
                    held = step.lobes;
                }
            }
        }
        parts
    }

    /// Adds to what is in the sums, which are zeros at first.
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

/// Which table: its grid, the planes that mirror the tile, and how many columns.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TableShape {
    pub(crate) grid: HemispherePairGrid,
    pub(crate) mirrors: [bool; 2],
    fours: usize,
}

impl TableShape {
    fn rows(self) -> usize {
        self.grid.half_vectors() * self.grid.turn
    }

    fn numbers(self) -> usize {
        4 * self.fours * self.rows() * (self.grid.difference + 2)
    }

    pub(crate) fn nodes(self, columns: &[u32]) -> Nodes {
        let HemispherePairGrid { rings, azimuths, turn, difference } = self.grid;
        let place = |k: usize| columns.get(k).copied().unwrap_or_default();
        Nodes {
            pairs: [rings, azimuths, turn, difference].map(|n| n as u32),
            columns: [place(0), place(1), place(2)],
            column_count: columns.len() as u32,
            width: 4 * self.fours as u32,
            crowding: HemispherePairGrid::CROWDING,
            lowest: HemispherePairGrid::LOWEST,
            ..Nodes::zeroed()
        }
    }

    /// Azimuths of h, then steps of φ_d.
    fn angles(self) -> Vec<Angle> {
        let angle = |radians: f32, (image, is_turned): (usize, bool)| {
            let (sine, cosine) = radians.sin_cos();
            Angle { cosine, sine, image: image as u32, is_turned: is_turned.into() }
        };
        let grid = self.grid;
        let azimuths = (0..grid.azimuths).map(|k| angle(grid.phi_h(k), grid.image(k, self.mirrors)));
        azimuths.chain((0..grid.turn).map(|k| angle(grid.phi_d(k), (k, false)))).collect()
    }

    /// Facets of one dispatch.
    fn most_facets(self, gpu: &Gpu) -> usize {
        if gpu.tier == Tier::Software {
            return SOFTWARE_FACETS;
        }
        let nodes = self.grid.originals(self.mirrors) as u64;
        (MAX_LOBES / nodes.max(1)).max(SOFTWARE_FACETS as u64) as usize
    }
}

/// Workgroups along the first axis of a dispatch: few, so that small tables go on along the second as large ones do.
const COLUMNS: usize = 16;

/// Workgroups along two axes for so many threads; those beyond have nothing to do.
pub(crate) fn workgroups(threads: usize) -> Result<[u32; 2], GpuError> {
    let rows = threads.div_ceil(THREADS as usize * COLUMNS);
    if rows > MAX_GROUPS {
        return Err(GpuError::Unsupported(format!("a table of {threads} numbers")));
    }
    Ok([COLUMNS, rows].map(|n| n as u32))
}

/// The columns that one sum over facets fills: one, or one for each channel.
pub(crate) fn columns_of(columns: &[Column], sum: &Column) -> Vec<u32> {
    let same = |column: &Column| (column.group, column.part) == (sum.group, sum.part);
    columns.iter().zip(0..).filter(|(column, _)| same(column)).map(|(_, place)| place).collect()
}

fn refused(reason: &str) -> GpuError {
    GpuError::Unsupported(reason.to_owned())
}

impl GpuShading {
    /// The pass of a table which the device itself makes of a sum over facets, and its making.
    ///
    /// # Errors
    /// [`GpuError::Unsupported`] for measured BRDFs and for sums of too many parts, and what the device refuses.
    pub(super) fn tabulated(
        &mut self,
        gpu: &Gpu,
        (sum, seen): (&FacetSum, &GpuVisibility),
        (nodes, interpolation): (crate::effective::Nodes, Interpolation),
        shadowed: bool,
    ) -> Result<(Pass, Making), GpuError> {
        let crate::effective::Nodes { grid, mirrors, facets: picked, .. } = nodes;
        let columns = Column::of(sum).ok_or_else(|| refused("the sum has too many parts for a table to pay"))?;
        let weights: Vec<Weight> = columns.iter().map(|column| column.weight(sum)).collect();
        let terms = ColumnTerms::of(&weights)?;
        let shape = TableShape { grid, mirrors: Weight::mirrors(&weights, mirrors), fours: terms.fours };
        let directions = ShadingTable::area_grid();
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        let values = gpu.buffer("table", 4 * shape.numbers() as u64, usage)?;
        let areas = gpu.buffer("projected areas", 4 * directions.len() as u64, usage)?;
        let held =
            Held { grid, interpolation, columns: terms, directions, values: values.clone(), areas: areas.clone() };
        let pass = self.held_table_pass(gpu, held, shadowed)?;
        let shared = Shared::of(gpu, sum, seen)?;
        let of = (sum, seen, &shared);
        let mut steps = self.area_steps(gpu, of, directions, &areas)?;
        steps.extend(self.column_steps(gpu, of, (&columns, picked), shape, &values)?);
        Ok((pass, Making { sums: vec![values, areas], steps }))
    }

    fn area_steps(
        &mut self,
        gpu: &Gpu,
        (sum, seen, shared): (&FacetSum, &GpuVisibility, &Shared),
        directions: PolarGrid,
        areas: &wgpu::Buffer,
    ) -> Result<Vec<Step>, GpuError> {
        let facets = sum.facet_count();
        let most = if gpu.tier == Tier::Software { SOFTWARE_FACETS } else { facets.max(1) };
        let at: Vec<Padded> = directions.directions().into_iter().map(padded).collect();
        let at = gpu.upload("directions", &at, wgpu::BufferUsages::STORAGE)?;
        let nodes = self.nodes_group(gpu, Nodes::zeroed(), &at, areas)?;
        let see = ("visibility_unblocked", seen.file());
        let variant = Variant { shader: "table_areas", entry_point: "add", swaps: vec![see], constants: Vec::new() };
        let layouts = [self.nodes.clone(), self.facets.clone()];
        let pipeline = self.pipeline_over(gpu, variant, &layouts.each_ref())?;
        let step = |range: Range<usize>| {
            let groups = vec![nodes.clone(), self.sum_group(gpu, shared, Sum::blank(sum, seen).over(&range))?];
            let lobes = (directions.len() * range.len()) as u64;
            Ok(Step { pipeline: pipeline.clone(), groups, workgroups: [directions.len() as u32, 1], lobes })
        };
        pieces(0..facets, most).map(step).collect()
    }

    fn column_steps(
        &mut self,
        gpu: &Gpu,
        (sum, seen, shared): (&FacetSum, &GpuVisibility, &Shared),
        (columns, picked): (&[Column], Option<usize>),
        shape: TableShape,
        values: &wgpu::Buffer,
    ) -> Result<Vec<Step>, GpuError> {
        // Less than half of them spares something; and to pick from very many is too much for a dispatch.
        let picked = picked.filter(|&count| sum.facet_count() >= 2 * count && sum.facet_count() <= MAX_TO_PICK_FROM);
        let angles = gpu.upload("angles", &shape.angles(), wgpu::BufferUsages::STORAGE)?;
        let see = seen.file();
        let layouts = [self.nodes.clone(), self.facets.clone()];
        let mut steps = Vec::new();
        // The first channel stands for all.
        for column in columns.iter().filter(|column| column.channel.is_none_or(|channel| channel == 0)) {
            if let (Some(count), Part::Lobe(lobe)) = (picked, column.part) {
                if lobe == 0 {
                    let of = OfGroup { sum, seen, shared, columns, group: column.group, count };
                    steps.extend(self.picked_steps(gpu, &of, shape, [&angles, values])?);
                }
                continue;
            }
            let blank = Sum::blank(sum, seen);
            let (summed, added) = match column.part {
                Part::Lobe(lobe) => {
                    let (file, added) = blank.of_lobe(sum.groups()[column.group].lobes[lobe].0);
                    (("lobe_lambertian", file), added)
                }
                Part::Area(_) => (("sum_facets", "sum_seen_areas"), blank),
                Part::Measured { .. } => return Err(refused("measured BRDFs are summed over facets on the CPU only")),
            };
            let swaps = vec![
                ("visibility_unblocked", see),
                summed,
                ("weights_area", if column.channel.is_some() { "weights_rgb" } else { "weights_area" }),
            ];
            let variant = Variant { shader: "table_of_sum", entry_point: "add", swaps, constants: Vec::new() };
            let pipeline = self.pipeline_over(gpu, variant, &layouts.each_ref())?;
            let nodes = self.nodes_group(gpu, shape.nodes(&columns_of(columns, column)), &angles, values)?;
            for range in pieces(column.facets(sum), shape.most_facets(gpu)) {
                let groups = vec![nodes.clone(), self.sum_group(gpu, shared, added.over(&range))?];
                let lobes = (shape.grid.originals(shape.mirrors) * range.len()) as u64;
                let workgroups = workgroups(shape.grid.nodes())?;
                steps.push(Step { pipeline: pipeline.clone(), groups, workgroups, lobes });
            }
        }
        let ends = Variant { shader: "table_ends", entry_point: "extend", swaps: Vec::new(), constants: Vec::new() };
        steps.push(Step {
            pipeline: self.pipeline_over(gpu, ends, &[&layouts[0]])?,
            groups: vec![self.nodes_group(gpu, shape.nodes(&[]), &angles, values)?],
            workgroups: workgroups(4 * shape.fours * shape.rows())?,
            lobes: shape.numbers() as u64,
        });
        Ok(steps)
    }

    pub(crate) fn nodes_group(
        &self,
        gpu: &Gpu,
        nodes: Nodes,
        at: &wgpu::Buffer,
        sums: &wgpu::Buffer,
    ) -> Result<wgpu::BindGroup, GpuError> {
        let uniform = gpu.upload("nodes", &[nodes], wgpu::BufferUsages::UNIFORM)?;
        gpu.group("nodes of a table", &self.nodes, &[&uniform, at, sums].map(|buffer| buffer.as_entire_binding()))
    }
}

#[cfg(test)]
#[path = "tabulate_tests.rs"]
mod tests;
