//! Colours of pixels under a colour map on the GPU: the twin of [`ColorReads`](crate::color_map::reads::ColorReads).

use bytemuck::{Pod, Zeroable};
use exr::prelude::f16;
use glam::{Vec2, Vec3};

use super::device::pipelines::{READ, UNIFORM, WRITE};
use super::{Gpu, GpuError};
use crate::color_map::reads::{self, Within};
use crate::color_map::{DEVIATIONS, MEANS, PrefilteredTable};

/// A prefiltered table on the GPU (16-bit floats, 512 kB), and the pipeline that reads it.
#[derive(Debug)]
pub struct GpuColorReads {
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
    table: wgpu::TextureView,
    directions: wgpu::Buffer,
    heights: wgpu::Buffer,
    axis: wgpu::Buffer,
}

/// The driver of a pixel's colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PixelDriver {
    Texture,
    /// ν of viewer and light, and the difference of their azimuths from 0 to π.
    Height {
        nu: Vec2,
        apart: f32,
    },
    /// ν of the viewer, and the correlation of the slopes towards it and along the driver's azimuth.
    Slope {
        nu: f32,
        correlation: f32,
    },
}

/// `Pixel` in `color_pixels.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
struct Pixel {
    within: [f32; 2],
    nu: [f32; 2],
    apart: f32,
    correlation: f32,
    driver: u32,
    pad: u32,
}

impl Pixel {
    fn new(within: Within, driver: &PixelDriver) -> Self {
        let pixel = Self { within: [within.mean, within.deviation], ..Self::default() };
        match *driver {
            PixelDriver::Texture => pixel,
            PixelDriver::Height { nu, apart } => Self { nu: nu.to_array(), apart, driver: 1, ..pixel },
            PixelDriver::Slope { nu, correlation } => Self { nu: [nu, 0.0], correlation, driver: 2, ..pixel },
        }
    }
}

impl GpuColorReads {
    /// Uploads a table.
    ///
    /// # Errors
    /// Errors of the GPU.
    pub fn new(gpu: &Gpu, table: &PrefilteredTable) -> Result<Self, GpuError> {
        use wgpu::BufferUsages as Usage;
        let texture = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: false },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let bindings = [texture, READ, READ, UNIFORM, READ, WRITE];
        let layout = gpu.layout("color map", wgpu::ShaderStages::COMPUTE, &bindings)?;
        let module = gpu.module("color_pixels")?;
        let (low, per_mean) = table.mean_axis();
        Ok(Self {
            pipeline: gpu.compute_pipeline(&module, "color_pixels", &[&layout])?,
            table: upload(gpu, table)?,
            directions: gpu.upload("directions", reads::directions(), Usage::STORAGE)?,
            heights: gpu.upload("heights", reads::heights(), Usage::STORAGE)?,
            axis: gpu.upload("color axis", &[[low, per_mean, 0.0, 0.0]], Usage::UNIFORM)?,
            layout,
        })
    }

    /// The colours of pixels.
    ///
    /// # Errors
    /// Errors of the GPU; more pixels than one dispatch takes.
    pub fn colors(&self, gpu: &Gpu, pixels: &[(Within, PixelDriver)]) -> Result<Vec<Vec3>, GpuError> {
        use wgpu::BufferUsages as Usage;
        if pixels.is_empty() {
            return Ok(Vec::new());
        }
        let rows: Vec<Pixel> = pixels.iter().map(|(within, driver)| Pixel::new(*within, driver)).collect();
        let colors = gpu.buffer("colors", 16 * rows.len() as u64, Usage::STORAGE | Usage::COPY_SRC)?;
        let rows = gpu.upload("pixels", &rows, Usage::STORAGE)?;
        let buffers = [&self.directions, &self.heights, &self.axis, &rows, &colors];
        let table = std::iter::once(wgpu::BindingResource::TextureView(&self.table));
        let bound: Vec<_> = table.chain(buffers.map(wgpu::Buffer::as_entire_binding)).collect();
        let group = gpu.group("color map", &self.layout, &bound)?;
        gpu.run_over(pixels.len() as u32, &self.pipeline, &group, "reading a color map")?;
        let colors: Vec<[f32; 4]> = gpu.read(&colors)?;
        Ok(colors.iter().map(|color| Vec3::from_slice(color)).collect())
    }
}

fn upload(gpu: &Gpu, table: &PrefilteredTable) -> Result<wgpu::TextureView, GpuError> {
    let size = wgpu::Extent3d { width: MEANS as u32, height: DEVIATIONS as u32, depth_or_array_layers: 1 };
    let texels: Vec<[u16; 4]> = table
        .colors()
        .iter()
        .map(|color| color.extend(1.0).to_array().map(|value| f16::from_f32(value).to_bits()))
        .collect();
    gpu.checked("uploading a color map", || {
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("color map"),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba16Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(8 * MEANS as u32), rows_per_image: None };
        gpu.queue.write_texture(texture.as_image_copy(), bytemuck::cast_slice(&texels), layout, size);
        Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color_map::reads::ColorReads;
    use crate::color_map::{Stop, StopMap};

    #[test]
    fn the_gpu_reads_the_colours_of_textures_heights_and_slopes_as_the_cpu_does() {
        let Some(gpu) = Gpu::open().map_err(|error| eprintln!("SKIPPED: {error}")).ok() else { return };
        let stop = |value: f64, color: [f64; 3]| Stop { value, color: color.into() };
        let map = StopMap::new(vec![
            stop(-1.2, [0.6, 0.3, 0.1]),
            stop(-0.4, [0.05, 0.05, 0.05]),
            stop(0.3, [0.9, 0.8, 0.2]),
            stop(0.3, [0.1, 0.4, 0.7]),
            stop(1.0, [0.95, 0.95, 0.95]),
        ]);
        let table = PrefilteredTable::new(&map);
        let reads = ColorReads::new(&table);
        let mut pixels = Vec::new();
        for k in 0..3000_u32 {
            let part =
                |salt: u32| (k.wrapping_mul(2_654_435_761).wrapping_add(salt * 977_771) >> 8) as f32 / 16_777_216.0;
            // Wide enough that neighbouring columns of a jump differ little.
            let within = Within { mean: 8.0 * part(1) - 4.0, deviation: 0.05 + 1.6 * part(2) };
            let nu = Vec2::new(0.03 + 5.0 * part(3) * part(3), 4.0 * part(4));
            pixels.push((within, PixelDriver::Texture));
            pixels.push((within, PixelDriver::Height { nu, apart: std::f32::consts::PI * part(5) }));
            pixels.push((within, PixelDriver::Slope { nu: nu.x, correlation: 2.0 * part(6) - 1.0 }));
        }
        let ours = GpuColorReads::new(&gpu, &table).unwrap().colors(&gpu, &pixels).unwrap();
        let mut worst = 0.0_f32;
        for ((within, driver), color) in pixels.iter().zip(&ours) {
            let exact = match *driver {
                PixelDriver::Texture => reads.texture(*within),
                PixelDriver::Height { nu, apart } => reads.height(nu, apart, *within),
                PixelDriver::Slope { nu, correlation } => reads.slope(nu, correlation, *within),
            };
            worst = worst.max((*color - exact).abs().max_element());
        }
        println!("colours of the GPU: worst difference {worst:.5}");
        assert!(worst < 0.002, "{worst}");
    }
}
