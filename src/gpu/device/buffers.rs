//! Plain data to the device and back.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use bytemuck::Pod;

use crate::gpu::{Gpu, GpuError};

/// How long to wait for the device before it is given up.
const PATIENCE: Duration = Duration::from_secs(300);

/// How often a device is asked that a window uses, too, once it takes longer than this.
const GLANCE: Duration = Duration::from_micros(200);
const FRAME: Duration = Duration::from_millis(3);

/// Enough for one element of any of our arrays: a binding holds at least one.
const MIN_BYTES: u64 = 256;

impl Gpu {
    /// A buffer without contents (zeros), of `bytes` rounded up to a multiple of 4; never empty, as bindings cannot be.
    pub fn buffer(&self, label: &str, bytes: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer, GpuError> {
        let size = bytes.max(MIN_BYTES).next_multiple_of(4);
        let bound = usage.intersects(wgpu::BufferUsages::STORAGE);
        let allowed =
            if bound { self.limits.max_storage_buffer_binding_size } else { u64::MAX }.min(self.limits.max_buffer_size);
        if size > allowed {
            return Err(GpuError::TooLarge { what: label.to_owned(), needed: size, allowed });
        }
        let description = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        self.checked(&format!("making room for {label}"), || Ok(self.device.create_buffer(&description)))
    }

    /// A buffer that holds `data`; `COPY_DST` is added to the usage.
    pub fn upload<T: Pod>(&self, label: &str, data: &[T], usage: wgpu::BufferUsages) -> Result<wgpu::Buffer, GpuError> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let buffer = self.buffer(label, bytes.len() as u64, usage | wgpu::BufferUsages::COPY_DST)?;
        self.write(&buffer, data)?;
        Ok(buffer)
    }

    /// Overwrites the start of a buffer. A size that is not a multiple of 4 is refused.
    pub fn write<T: Pod>(&self, buffer: &wgpu::Buffer, data: &[T]) -> Result<(), GpuError> {
        self.checked("uploading", || {
            self.queue.write_buffer(buffer, 0, bytemuck::cast_slice(data));
            Ok(())
        })
    }

    /// Waits for the device and copies a whole buffer (usage `COPY_SRC`) back.
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

    /// Waits for the device and copies an image of four bytes a pixel (usage `COPY_SRC`) back, row by row.
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

    /// Waits until the device has done all that was submitted.
    pub fn wait(&self, during: &str) -> Result<(), GpuError> {
        let (sender, receiver) = mpsc::channel();
        self.queue.on_submitted_work_done(move || {
            // Whoever waited may have lost patience.
            let _ = sender.send(());
        });
        self.hear(&receiver, during)
    }

    /// Waits for what a callback of the device says.
    fn hear<T>(&self, told: &mpsc::Receiver<T>, during: &str) -> Result<T, GpuError> {
        let refused = |reason: String| GpuError::Refused { during: during.to_owned(), reason };
        let timeout = || GpuError::Timeout { during: during.to_owned(), seconds: PATIENCE.as_secs() };
        if !self.is_shared {
            if !self.poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(PATIENCE) })? {
                return Err(timeout());
            }
            return told.try_recv().map_err(|e| refused(e.to_string()));
        }
        // A wait inside the driver would hold up what the window submits meanwhile.
        let start = Instant::now();
        while start.elapsed() < PATIENCE {
            self.poll(wgpu::PollType::Poll)?;
            match told.try_recv() {
                Ok(answer) => return Ok(answer),
                Err(mpsc::TryRecvError::Empty) => {}
                Err(error) => return Err(refused(error.to_string())),
            }
            // A frame is worth some turns of a core; longer work is not.
            if start.elapsed() < FRAME { std::thread::yield_now() } else { std::thread::sleep(GLANCE) }
        }
        Err(timeout())
    }

    /// Lets the device tell what it has done; whether it did in time. A device that is gone is an error here, where wgpu
    /// panics.
    ///
    /// # Errors
    /// [`GpuError::Lost`], [`GpuError::Refused`].
    pub fn poll(&self, how: wgpu::PollType) -> Result<bool, GpuError> {
        self.is_there()?;
        match catch_unwind(AssertUnwindSafe(|| self.device.poll(how))) {
            Ok(Ok(_)) => self.is_there().map(|()| true),
            Ok(Err(wgpu::PollError::Timeout)) => Ok(false),
            Ok(Err(other)) => Err(GpuError::Refused { during: "waiting".to_owned(), reason: other.to_string() }),
            Err(_) => Err(self.lose("its driver gave it up")),
        }
    }

    /// Waits for the device and copies a mappable buffer's contents out.
    pub fn map<T: Pod>(&self, staging: &wgpu::Buffer) -> Result<Vec<T>, GpuError> {
        let refused = |reason: String| GpuError::Refused { during: "reading back".to_owned(), reason };
        let (sender, receiver) = mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, .., move |answer| drop(sender.send(answer)));
        self.hear(&receiver, "reading back")?.map_err(|error| refused(error.to_string()))?;
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
    fn what_goes_up_comes_back() {
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
