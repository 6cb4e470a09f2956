//! Transfers of plain data to the GPU and back.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use bytemuck::Pod;

use crate::gpu::{Gpu, GpuError};

/// Time after which a wait for the GPU fails.
const WAIT_TIMEOUT: Duration = Duration::from_secs(300);

/// Interval between polls of a device that is shared with a window.
const POLL_INTERVAL: Duration = Duration::from_micros(200);
/// Time during which a wait for a shared device polls without sleeping.
const BUSY_POLL_TIME: Duration = Duration::from_millis(3);

/// Smallest buffer in bytes: one element of any array in a shader, because a binding holds at least one.
const MIN_BYTES: u64 = 256;

impl Gpu {
    /// Creates a zeroed buffer of `bytes`, rounded up to a multiple of 4. It is never empty, because bindings cannot
    /// be.
    pub fn buffer(&self, label: &str, bytes: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer, GpuError> {
        let size = bytes.max(MIN_BYTES).next_multiple_of(4);
        let bound = usage.intersects(wgpu::BufferUsages::STORAGE);
        let allowed =
            if bound { self.limits.max_storage_buffer_binding_size } else { u64::MAX }.min(self.limits.max_buffer_size);
        if size > allowed {
            return Err(GpuError::TooLarge { what: label.to_owned(), needed: size, allowed });
        }
        let description = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        self.checked(&format!("allocating {label}"), || Ok(self.device.create_buffer(&description)))
    }

    /// Creates a buffer that holds `data`; `COPY_DST` is added to the usage.
    pub fn upload<T: Pod>(&self, label: &str, data: &[T], usage: wgpu::BufferUsages) -> Result<wgpu::Buffer, GpuError> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let buffer = self.buffer(label, bytes.len() as u64, usage | wgpu::BufferUsages::COPY_DST)?;
        self.write(&buffer, data)?;
        Ok(buffer)
    }

    /// Overwrites the start of a buffer. The size must be a multiple of 4.
    pub fn write<T: Pod>(&self, buffer: &wgpu::Buffer, data: &[T]) -> Result<(), GpuError> {
        self.checked("uploading", || {
            self.queue.write_buffer(buffer, 0, bytemuck::cast_slice(data));
            Ok(())
        })
    }

    /// Waits for the GPU and copies a whole buffer (usage `COPY_SRC`) back.
    pub fn read<T: Pod>(&self, buffer: &wgpu::Buffer) -> Result<Vec<T>, GpuError> {
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
        let staging = self.buffer("read-back", buffer.size(), usage)?;
        self.checked("reading back", || {
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
            self.queue.submit([encoder.finish()]);
            self.map(&staging)
        })
    }

    /// Waits for the GPU and copies an image of four bytes per pixel (usage `COPY_SRC`) back, row by row.
    pub fn read_image(&self, image: &wgpu::Texture) -> Result<Vec<u8>, GpuError> {
        let size = image.size();
        let row = 4 * size.width;
        let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
        let staging = self.buffer("read-back", u64::from(padded) * u64::from(size.height), usage)?;
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: None };
        let bytes: Vec<u8> = self.checked("reading back", || {
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encoder.copy_texture_to_buffer(
                image.as_image_copy(),
                wgpu::TexelCopyBufferInfo { buffer: &staging, layout },
                size,
            );
            self.queue.submit([encoder.finish()]);
            self.map(&staging)
        })?;
        let rows = bytes.chunks(padded as usize).take(size.height as usize);
        Ok(rows.flat_map(|bytes| &bytes[..row as usize]).copied().collect())
    }

    /// Waits until the GPU has finished all submitted work.
    pub fn wait(&self, during: &str) -> Result<(), GpuError> {
        let (sender, receiver) = mpsc::channel();
        self.queue.on_submitted_work_done(move || {
            // The waiting thread may have timed out.
            let _ = sender.send(());
        });
        self.receive(&receiver, during)
    }

    /// Waits for the value that a callback of the device sends.
    fn receive<T>(&self, receiver: &mpsc::Receiver<T>, during: &str) -> Result<T, GpuError> {
        let refused = |reason: String| GpuError::Refused { during: during.to_owned(), reason };
        let timeout = || GpuError::Timeout { during: during.to_owned(), seconds: WAIT_TIMEOUT.as_secs() };
        if !self.is_shared {
            if !self.poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(WAIT_TIMEOUT) })? {
                return Err(timeout());
            }
            return receiver.try_recv().map_err(|e| refused(e.to_string()));
        }
        // A wait inside the driver would delay submissions of the window.
        let start = Instant::now();
        while start.elapsed() < WAIT_TIMEOUT {
            self.poll(wgpu::PollType::Poll)?;
            match receiver.try_recv() {
                Ok(value) => return Ok(value),
                Err(mpsc::TryRecvError::Empty) => {}
                Err(error) => return Err(refused(error.to_string())),
            }
            // Polling without sleep costs a core, so only short work is waited for in this way.
            if start.elapsed() < BUSY_POLL_TIME { std::thread::yield_now() } else { std::thread::sleep(POLL_INTERVAL) }
        }
        Err(timeout())
    }

    /// Polls the device for finished work and returns whether it finished in time. A lost device is an error here,
    /// while wgpu panics.
    ///
    /// # Errors
    /// [`GpuError::Lost`], [`GpuError::Refused`].
    pub fn poll(&self, poll_type: wgpu::PollType) -> Result<bool, GpuError> {
        self.check_not_lost()?;
        match catch_unwind(AssertUnwindSafe(|| self.device.poll(poll_type))) {
            Ok(Ok(_)) => self.check_not_lost().map(|()| true),
            Ok(Err(wgpu::PollError::Timeout)) => Ok(false),
            Ok(Err(other)) => Err(GpuError::Refused { during: "waiting".to_owned(), reason: other.to_string() }),
            Err(_) => Err(self.mark_lost("its driver stopped")),
        }
    }

    /// Waits for the GPU and returns the contents of a mappable buffer.
    pub fn map<T: Pod>(&self, staging: &wgpu::Buffer) -> Result<Vec<T>, GpuError> {
        let refused = |reason: String| GpuError::Refused { during: "reading back".to_owned(), reason };
        let (sender, receiver) = mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, .., move |value| drop(sender.send(value)));
        self.receive(&receiver, "reading back")?.map_err(|error| refused(error.to_string()))?;
        let view = staging.get_mapped_range(..).map_err(|e| refused(e.to_string()))?;
        let values = bytemuck::pod_collect_to_vec(&view[..view.len() / size_of::<T>() * size_of::<T>()]);
        drop(view);
        staging.unmap();
        Ok(values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uploaded_data_reads_back_unchanged() {
        let gpu = match Gpu::open() {
            Ok(gpu) => gpu,
            Err(error) => return eprintln!("SKIPPED: {error}"),
        };
        let data: Vec<f32> = (0..1000).map(|k| k as f32 * 0.25).collect();
        let buffer = gpu.upload("numbers", &data, wgpu::BufferUsages::COPY_SRC).unwrap();
        assert_eq!(gpu.read::<f32>(&buffer).unwrap(), data);
        let too_large = gpu.buffer("everything", u64::MAX / 2, wgpu::BufferUsages::STORAGE);
        assert!(matches!(too_large, Err(GpuError::TooLarge { .. })), "{too_large:?}");
    }
}
