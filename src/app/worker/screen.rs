//! Images on the device that the window draws on: what is made there is shown without being read back.

use std::sync::Arc;

use crate::gpu::{Gpu, GpuError, Tier};
use eframe::egui::mutex::RwLock;
use eframe::egui::{ColorImage, TextureId};
use eframe::egui_wgpu::Renderer;

/// The window's device, and what draws the interface there.
#[derive(Clone)]
pub struct Screen {
    pub gpu: Arc<Gpu>,
    interface: Arc<RwLock<Renderer>>,
    /// Whether this is a graphics processor.
    pub is_fast: bool,
}

/// An image that shaders write and the interface shows. Dropping it takes it off the interface.
pub struct DeviceImage {
    screen: Screen,
    texture: wgpu::Texture,
    pub view: wgpu::TextureView,
    /// What the interface calls it.
    pub id: TextureId,
    pub size: [usize; 2],
}

/// Images in turn: the one that is shown is not the one that is written.
#[derive(Default)]
pub struct Turns(Vec<Arc<DeviceImage>>);

impl Screen {
    pub fn new(gpu: Arc<Gpu>, interface: Arc<RwLock<Renderer>>) -> Self {
        Self { is_fast: gpu.tier == Tier::Hardware, gpu, interface }
    }

    fn image(&self, size: [usize; 2]) -> Result<DeviceImage, GpuError> {
        let texture = crate::gpu::render::image::image(&self.gpu, size)?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        self.gpu.checked("showing a picture", || {
            let filter = wgpu::FilterMode::Linear;
            let id = self.interface.write().register_native_texture(&self.gpu.device, &view, filter);
            Ok(DeviceImage { screen: self.clone(), texture, view, id, size })
        })
    }
}

impl DeviceImage {
    /// Reads it back, for what outlives the window.
    ///
    /// # Errors
    /// What the device refuses.
    pub fn read(&self) -> Result<ColorImage, GpuError> {
        let bytes = self.screen.gpu.read_image(&self.texture)?;
        Ok(ColorImage::from_rgba_unmultiplied(self.size, &bytes))
    }
}

impl Drop for DeviceImage {
    fn drop(&mut self) {
        self.screen.interface.write().free_texture(&self.id);
    }
}

impl std::fmt::Debug for DeviceImage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DeviceImage").field("id", &self.id).field("size", &self.size).finish_non_exhaustive()
    }
}

impl Turns {
    /// An image of this size that nobody looks at.
    ///
    /// # Errors
    /// What the device refuses.
    pub fn next(&mut self, screen: &Screen, size: [usize; 2]) -> Result<Arc<DeviceImage>, GpuError> {
        let serves = |image: &Arc<DeviceImage>| image.size == size && Arc::ptr_eq(&image.screen.gpu, &screen.gpu);
        self.0.retain(serves);
        // What was drawn with it before is in the queue ahead of what writes it.
        if let Some(free) = self.0.iter().find(|image| Arc::strong_count(image) == 1) {
            return Ok(free.clone());
        }
        let image = Arc::new(screen.image(size)?);
        self.0.push(image.clone());
        Ok(image)
    }
}
