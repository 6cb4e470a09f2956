//! What part of a submission's time each stage took, by the device's own clock.

use super::render::StageTimes;
use crate::gpu::{Gpu, GpuError};

/// Passes that are timed; of a picture of more bands the first ones speak for all.
const PASSES: u32 = 1024;
const STAGES: usize = 4;

/// Stages of [`StageTimes`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stage {
    Product,
    GBuffer,
    Shadows,
    Shading,
}

/// Timestamps at the beginnings and ends of passes; only where the adapter has them.
#[derive(Debug)]
pub(super) struct Clock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    read_back: wgpu::Buffer,
}

/// Which stage each timed pass of a submission belongs to.
#[derive(Debug, Default)]
pub(super) struct Timed(Vec<Stage>);

impl Clock {
    /// `None` where the adapter has no timestamps.
    pub fn new(gpu: &Gpu) -> Result<Option<Self>, GpuError> {
        if !gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
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

    /// The next pass, a stage's; `None` where no more can be timed.
    fn pass(&self, timed: &mut Timed, stage: Stage) -> Option<[u32; 2]> {
        let k = timed.0.len() as u32;
        (k < PASSES).then(|| {
            timed.0.push(stage);
            [2 * k, 2 * k + 1]
        })
    }

    pub fn render_pass(&self, timed: &mut Timed, stage: Stage) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        self.pass(timed, stage).map(|[begin, end]| wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(begin),
            end_of_pass_write_index: Some(end),
        })
    }

    pub fn compute_pass(&self, timed: &mut Timed, stage: Stage) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        self.pass(timed, stage).map(|[begin, end]| wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(begin),
            end_of_pass_write_index: Some(end),
        })
    }

    /// After the last pass of a submission.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder, timed: &Timed) {
        let count = 2 * timed.0.len() as u32;
        if count > 0 {
            encoder.resolve_query_set(&self.queries, 0..count, &self.resolved, 0);
            encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.read_back, 0, 8 * u64::from(count));
        }
    }

    /// Milliseconds of a submission that is done, divided among its stages.
    pub fn times(&self, gpu: &Gpu, timed: &Timed, whole_ms: f64) -> Result<StageTimes, GpuError> {
        let ticks: Vec<u64> = gpu.map(&self.read_back)?;
        let mut parts = [0.0; STAGES];
        for (stage, [begin, end]) in timed.0.iter().zip(ticks.as_chunks::<2>().0) {
            parts[*stage as usize] += end.saturating_sub(*begin) as f64;
        }
        let total: f64 = parts.iter().sum();
        // A clock that stands still tells nothing.
        let [product_ms, gbuffer_ms, shadows_ms, shading_ms] =
            if total > 0.0 { parts.map(|part| whole_ms * part / total) } else { [0.0, 0.0, 0.0, whole_ms] };
        Ok(StageTimes { product_ms, gbuffer_ms, shadows_ms, shading_ms })
    }
}
