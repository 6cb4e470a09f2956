//! Images on the GPU on which the window draws: they are displayed without being read back.

use std::sync::Arc;

use crate::gpu::{Gpu, GpuError, Tier};
use eframe::egui::mutex::RwLock;
use eframe::egui::{ColorImage, TextureId};
use eframe::egui_wgpu::Renderer;

/// The window's GPU and the renderer of the interface.
#[derive(Clone)]
pub struct Screen {
    pub gpu: Arc<Gpu>,
    interface: Arc<RwLock<Renderer>>,
    /// False for a software adapter.
    pub is_hardware: bool,
}

/// An image that shaders write and the interface displays. Dropping it unregisters it from the interface.
pub struct GpuImage {
    screen: Screen,
    texture: wgpu::Texture,
    pub view: wgpu::TextureView,
    /// The interface's identifier of the image.
    pub id: TextureId,
    pub size: [usize; 2],
}

/// Images that are reused; a displayed image is never the one that is written.
#[derive(Default)]
pub struct ImagePool(Vec<Arc<GpuImage>>);

impl Screen {
    pub fn new(gpu: Arc<Gpu>, interface: Arc<RwLock<Renderer>>) -> Self {
        Self { is_hardware: gpu.tier == Tier::Hardware, gpu, interface }
    }

    fn image(&self, size: [usize; 2]) -> Result<GpuImage, GpuError> {
        let texture = crate::gpu::render::image::image(&self.gpu, size)?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        self.gpu.checked("displaying an image", || {
            let filter = wgpu::FilterMode::Linear;
            let id = self.interface.write().register_native_texture(&self.gpu.device, &view, filter);
            Ok(GpuImage { screen: self.clone(), texture, view, id, size })
        })
    }
}

impl GpuImage {
    /// Reads the image back into CPU memory.
    ///
    /// # Errors
    /// Returns an error if the GPU fails.
    pub fn read(&self) -> Result<ColorImage, GpuError> {
        let bytes = self.screen.gpu.read_image(&self.texture)?;
        Ok(ColorImage::from_rgba_unmultiplied(self.size, &bytes))
    }
}

impl Drop for GpuImage {
    fn drop(&mut self) {
        self.screen.interface.write().free_texture(&self.id);
    }
}

impl std::fmt::Debug for GpuImage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GpuImage").field("id", &self.id).field("size", &self.size).finish_non_exhaustive()
    }
}

impl ImagePool {
    /// An image of this size that is not displayed.
    ///
    /// # Errors
    /// Returns an error if the GPU fails.
    pub fn next(&mut self, screen: &Screen, size: [usize; 2]) -> Result<Arc<GpuImage>, GpuError> {
        let fits = |image: &Arc<GpuImage>| image.size == size && Arc::ptr_eq(&image.screen.gpu, &screen.gpu);
        self.0.retain(fits);
        // Earlier draws of the image precede the next write in the queue.
        if let Some(free) = self.0.iter().find(|image| Arc::strong_count(image) == 1) {
            return Ok(free.clone());
        }
        let image = Arc::new(screen.image(size)?);
        self.0.push(image.clone());
        Ok(image)
    }
}
