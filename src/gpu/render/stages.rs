//! The stages of a picture as they are recorded, submitted and timed.
//!
//! On a graphics processor all go in one submission, and the device's own clock tells what part of its time each took. On
//! software, whose clock runs ahead of its work and which nobody hands a frame's budget, each stage is a submission.

use std::time::Instant;

use crate::gpu::{Gpu, GpuError, Tier};
use crate::render::image::render::RenderTimes;

/// Passes of a submission that are timed; of more the first ones speak for all.
const PASSES: u32 = 1024;

/// Stages of [`RenderTimes`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum GpuPassKind {
    Product,
    GBuffer,
    Shadows,
    Shading,
}

const STAGES: usize = 4;

/// Timestamps at the beginnings and ends of passes.
#[derive(Debug)]
pub(super) struct Clock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    read_back: wgpu::Buffer,
}

impl Clock {
    /// `None` where the adapter has no timestamps, or is software.
    pub fn new(gpu: &Gpu) -> Result<Option<Self>, GpuError> {
        if gpu.tier != Tier::Hardware || !gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return Ok(None);
        }
        use wgpu::BufferUsages as Usage;
        let bytes = u64::from(2 * PASSES) * 8;
        let description =
            wgpu::QuerySetDescriptor { label: Some("stages"), ty: wgpu::QueryType::Timestamp, count: 2 * PASSES };
        Ok(Some(Self {
            queries: gpu.checked("setting up a clock", || Ok(gpu.device.create_query_set(&description)))?,
            resolved: gpu.buffer("times", bytes, Usage::QUERY_RESOLVE | Usage::COPY_SRC)?,
            read_back: gpu.buffer("times read back", bytes, Usage::COPY_DST | Usage::MAP_READ)?,
        }))
    }
}

/// Records stages in order.
pub(super) struct Recorder<'a> {
    gpu: &'a Gpu,
    clock: Option<&'a Clock>,
    by_stage: bool,
    encoder: wgpu::CommandEncoder,
    /// Of each timed pass of the submission that is recorded.
    timed: Vec<GpuPassKind>,
    begun: Instant,
    /// Milliseconds of what was submitted.
    spent: [f64; STAGES],
}

impl<'a> Recorder<'a> {
    /// `by_stage`: a submission for each stage.
    pub fn new(gpu: &'a Gpu, clock: Option<&'a Clock>, by_stage: bool) -> Self {
        let (encoder, timed, spent) = (encoder(gpu), Vec::new(), [0.0; STAGES]);
        Self { gpu, clock, by_stage, encoder, timed, begun: Instant::now(), spent }
    }

    /// Where the next pass writes its times; `None` where it is not timed.
    fn next_pass(&mut self, stage: GpuPassKind) -> Option<(&'a Clock, [u32; 2])> {
        let (clock, k) = (self.clock?, self.timed.len() as u32);
        (k < PASSES).then(|| {
            self.timed.push(stage);
            (clock, [2 * k, 2 * k + 1])
        })
    }

    /// What a render pass of a stage is recorded with.
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

    /// A compute pass of a stage, after these buffers were set to zeros.
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

    /// A stage, or a band's part of it, is recorded.
    pub fn stage_ends(&mut self, stage: GpuPassKind) -> Result<(), GpuError> {
        if self.by_stage {
            self.spent[stage as usize] += self.run()?;
        }
        Ok(())
    }

    /// Submits what is recorded and waits until it is done.
    pub fn submit(&mut self) -> Result<(), GpuError> {
        if self.by_stage {
            return Ok(());
        }
        let count = 2 * self.timed.len() as u32;
        if let (Some(clock), true) = (self.clock, count > 0) {
            self.encoder.resolve_query_set(&clock.queries, 0..count, &clock.resolved, 0);
            self.encoder.copy_buffer_to_buffer(&clock.resolved, 0, &clock.read_back, 0, 8 * u64::from(count));
        }
        let whole = self.run()?;
        let mut parts = [0.0; STAGES];
        if let Some(clock) = self.clock {
            let ticks: Vec<u64> = self.gpu.map(&clock.read_back)?;
            for (stage, [begin, end]) in self.timed.iter().zip(ticks.as_chunks::<2>().0) {
                parts[*stage as usize] += end.saturating_sub(*begin) as f64;
            }
        }
        self.timed.clear();
        let total: f64 = parts.iter().sum();
        if total > 0.0 {
            (0..STAGES).for_each(|k| self.spent[k] += whole * parts[k] / total);
        } else {
            // Without a clock nobody knows.
            self.spent[GpuPassKind::Shading as usize] += whole;
        }
        Ok(())
    }

    /// Milliseconds since the last run, once the device has done what is recorded.
    fn run(&mut self) -> Result<f64, GpuError> {
        let recorded = std::mem::replace(&mut self.encoder, encoder(self.gpu));
        self.gpu.checked("rendering", || {
            self.gpu.queue.submit([recorded.finish()]);
            Ok(())
        })?;
        self.gpu.wait("rendering")?;
        let begun = std::mem::replace(&mut self.begun, Instant::now());
        Ok((self.begun - begun).as_secs_f64() * 1e3)
    }

    /// Of all that was submitted.
    pub fn times(&self) -> RenderTimes {
        let [product_ms, gbuffer_ms, shadows_ms, shading_ms] = self.spent;
        RenderTimes { product_ms, gbuffer_ms, shadows_ms, shading_ms }
    }
}

fn encoder(gpu: &Gpu) -> wgpu::CommandEncoder {
    gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
}
