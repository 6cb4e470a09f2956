//! Recording, submission and timing of the stages of an image.
//!
//! On a real GPU, all stages are one submission, and timestamps measure the share of each stage. On a software adapter,
//! whose timestamps are not reliable, each stage is a submission of its own.

use std::time::Instant;

use crate::gpu::{Gpu, GpuError, Tier};
use crate::render::image::render::RenderTimes;

/// Largest number of timed passes of a submission. If there are more, the first ones represent all.
const MAX_TIMED_PASSES: u32 = 1024;

/// Stages of [`RenderTimes`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum GpuPassKind {
    Product,
    GBuffer,
    Shadows,
    Shading,
}

const STAGE_COUNT: usize = 4;

/// Timestamps at the beginnings and ends of passes.
#[derive(Debug)]
pub(super) struct Clock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    read_back: wgpu::Buffer,
}

impl Clock {
    /// Returns `None` if the adapter has no timestamps or is a software adapter.
    pub fn new(gpu: &Gpu) -> Result<Option<Self>, GpuError> {
        if gpu.tier != Tier::Hardware || !gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return Ok(None);
        }
        use wgpu::BufferUsages as Usage;
        let bytes = u64::from(2 * MAX_TIMED_PASSES) * 8;
        let description = wgpu::QuerySetDescriptor {
            label: Some("stages"),
            ty: wgpu::QueryType::Timestamp,
            count: 2 * MAX_TIMED_PASSES,
        };
        Ok(Some(Self {
            queries: gpu.checked("setting up a clock", || Ok(gpu.device.create_query_set(&description)))?,
            resolved: gpu.buffer("times", bytes, Usage::QUERY_RESOLVE | Usage::COPY_SRC)?,
            read_back: gpu.buffer("times read back", bytes, Usage::COPY_DST | Usage::MAP_READ)?,
        }))
    }
}

/// Recorder of stages, in order.
pub(super) struct Recorder<'a> {
    gpu: &'a Gpu,
    clock: Option<&'a Clock>,
    by_stage: bool,
    encoder: wgpu::CommandEncoder,
    /// The stage of each timed pass of the current submission.
    timed_stages: Vec<GpuPassKind>,
    start: Instant,
    /// Time per stage of finished submissions [ms].
    times_ms: [f64; STAGE_COUNT],
}

impl<'a> Recorder<'a> {
    /// `by_stage`: whether each stage is a submission of its own.
    pub fn new(gpu: &'a Gpu, clock: Option<&'a Clock>, by_stage: bool) -> Self {
        let (encoder, timed_stages, times_ms) = (encoder(gpu), Vec::new(), [0.0; STAGE_COUNT]);
        Self { gpu, clock, by_stage, encoder, timed_stages, start: Instant::now(), times_ms }
    }

    /// Returns the indices of the timestamps of the next pass; `None` if it is not timed.
    fn next_pass(&mut self, stage: GpuPassKind) -> Option<(&'a Clock, [u32; 2])> {
        let (clock, k) = (self.clock?, self.timed_stages.len() as u32);
        (k < MAX_TIMED_PASSES).then(|| {
            self.timed_stages.push(stage);
            (clock, [2 * k, 2 * k + 1])
        })
    }

    /// Returns the encoder and the timestamps for a render pass of a stage.
    pub fn render_pass(
        &mut self,
        stage: GpuPassKind,
    ) -> (&mut wgpu::CommandEncoder, Option<wgpu::RenderPassTimestampWrites<'a>>) {
        let writes = self.next_pass(stage).map(|(clock, [begin, end])| wgpu::RenderPassTimestampWrites {
            query_set: &clock.queries,
            beginning_of_pass_write_index: Some(begin),
            end_of_pass_write_index: Some(end),
        });
        (&mut self.encoder, writes)
    }

    /// Clears buffers and begins a compute pass of a stage.
    pub fn compute_pass(&mut self, stage: GpuPassKind, cleared: &[&wgpu::Buffer]) -> wgpu::ComputePass<'_> {
        let timestamp_writes = self.next_pass(stage).map(|(clock, [begin, end])| wgpu::ComputePassTimestampWrites {
            query_set: &clock.queries,
            beginning_of_pass_write_index: Some(begin),
            end_of_pass_write_index: Some(end),
        });
        for buffer in cleared {
            self.encoder.clear_buffer(buffer, 0, None);
        }
        self.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes })
    }

    /// Ends a stage, or the part of a band in it.
    pub fn end_stage(&mut self, stage: GpuPassKind) -> Result<(), GpuError> {
        if self.by_stage {
            self.times_ms[stage as usize] += self.submit_and_wait()?;
        }
        Ok(())
    }

    /// Submits the recorded work and waits until it has finished.
    pub fn submit(&mut self) -> Result<(), GpuError> {
        if self.by_stage {
            return Ok(());
        }
        let count = 2 * self.timed_stages.len() as u32;
        if let (Some(clock), true) = (self.clock, count > 0) {
            self.encoder.resolve_query_set(&clock.queries, 0..count, &clock.resolved, 0);
            self.encoder.copy_buffer_to_buffer(&clock.resolved, 0, &clock.read_back, 0, 8 * u64::from(count));
        }
        let total_ms = self.submit_and_wait()?;
        let mut parts = [0.0; STAGE_COUNT];
        if let Some(clock) = self.clock {
            let ticks: Vec<u64> = self.gpu.map(&clock.read_back)?;
            for (stage, [begin, end]) in self.timed_stages.iter().zip(ticks.as_chunks::<2>().0) {
                parts[*stage as usize] += end.saturating_sub(*begin) as f64;
            }
        }
        self.timed_stages.clear();
        let total: f64 = parts.iter().sum();
        if total > 0.0 {
            (0..STAGE_COUNT).for_each(|k| self.times_ms[k] += total_ms * parts[k] / total);
        } else {
            // Without timestamps, all time counts as shading.
            self.times_ms[GpuPassKind::Shading as usize] += total_ms;
        }
        Ok(())
    }

    /// Submits the recorded work, waits until it has finished, and returns the time since the last run [ms].
    fn submit_and_wait(&mut self) -> Result<f64, GpuError> {
        let recorded = std::mem::replace(&mut self.encoder, encoder(self.gpu));
        self.gpu.checked("rendering", || {
            self.gpu.queue.submit([recorded.finish()]);
            Ok(())
        })?;
        self.gpu.wait("rendering")?;
        let start = std::mem::replace(&mut self.start, Instant::now());
        Ok((self.start - start).as_secs_f64() * 1e3)
    }

    /// Returns the times of all submitted work.
    pub fn times(&self) -> RenderTimes {
        let [product_ms, gbuffer_ms, shadows_ms, shading_ms] = self.times_ms;
        RenderTimes { product_ms, gbuffer_ms, shadows_ms, shading_ms }
    }
}

fn encoder(gpu: &Gpu) -> wgpu::CommandEncoder {
    gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
}
