//! Opening a GPU without a window, and reporting its errors without panics.

use std::sync::{Arc, Mutex, PoisonError};

use crate::gpu::GpuError;

/// The capabilities of a machine. Each tier is a superset of the previous one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Tier {
    /// No adapter: everything runs on the CPU.
    None,
    /// An adapter that runs on the CPU (lavapipe, WARP): correct, but slower than the CPU twins.
    Software,
    /// A real GPU.
    Hardware,
}

impl Tier {
    /// Returns the tier of a machine from the result of [`Gpu::open`].
    pub fn of(gpu: Option<&Gpu>) -> Self {
        gpu.map_or(Self::None, |gpu| gpu.tier)
    }
}

/// Largest requested size of a storage buffer in bytes: a batch of shadow maps, or the corners of millions of
/// triangles.
const WANTED_BUFFER_BYTES: u64 = 1 << 30;

/// An open GPU: the wgpu device, its queue, and the properties of the adapter.
#[derive(Debug)]
pub struct Gpu {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    /// Name, driver, kind and back end of the adapter.
    pub adapter: wgpu::AdapterInfo,
    /// Granted limits: the requested ones, or those of the adapter if they are lower.
    pub limits: wgpu::Limits,
    pub tier: Tier,
    /// True if a window also draws with this device.
    pub(super) is_shared: bool,
    faults: Arc<Mutex<Faults>>,
}

/// Errors that the handlers of the device received.
#[derive(Debug, Default)]
struct Faults {
    lost: Option<String>,
    uncaptured: Option<String>,
}

impl Faults {
    fn mark_lost(&mut self, reason: wgpu::DeviceLostReason, message: &str) {
        self.lost.get_or_insert_with(|| format!("{reason:?}: {message}"));
    }
}

impl Gpu {
    /// Opens the fastest adapter through Vulkan, Metal or DirectX 12, without a surface.
    pub fn open() -> Result<Self, GpuError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12,
            flags: wgpu::InstanceFlags::empty(),
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let request = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..wgpu::RequestAdapterOptions::default()
        };
        let adapter =
            pollster::block_on(instance.request_adapter(&request)).map_err(|e| GpuError::NoAdapter(e.to_string()))?;
        Self::from_adapter(&adapter)
    }

    /// Returns the description of the device that a [`Gpu`] needs.
    pub fn request(adapter: &wgpu::Adapter) -> wgpu::DeviceDescriptor<'static> {
        let wanted = wgpu::Limits {
            max_storage_buffer_binding_size: WANTED_BUFFER_BYTES,
            max_buffer_size: WANTED_BUFFER_BYTES,
            ..wgpu::Limits::default()
        };
        wgpu::DeviceDescriptor {
            label: Some("biscale"),
            // Stages are timed if the adapter has timestamps.
            required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
            required_limits: wanted.or_worse_values_from(&adapter.limits()),
            memory_hints: wgpu::MemoryHints::Performance,
            ..wgpu::DeviceDescriptor::default()
        }
    }

    fn from_adapter(adapter: &wgpu::Adapter) -> Result<Self, GpuError> {
        let info = adapter.get_info();
        let (device, queue) = pollster::block_on(adapter.request_device(&Self::request(adapter)))
            .map_err(|e| GpuError::NoDevice { adapter: info.name.clone(), reason: e.to_string() })?;
        let gpu = Self::new(device, queue, info, false);
        let faults = gpu.faults.clone();
        gpu.device.on_uncaptured_error(Arc::new(move |error| {
            let mut faults = faults.lock().unwrap_or_else(PoisonError::into_inner);
            faults.uncaptured.get_or_insert_with(|| error.to_string());
        }));
        Ok(gpu)
    }

    /// Wraps the device that a window draws with, so that results can be shown without being read back. The window
    /// handles uncaptured errors itself. `lost` is called when the device is lost.
    pub fn from_window(
        adapter: wgpu::AdapterInfo,
        device: wgpu::Device,
        queue: wgpu::Queue,
        lost: impl Fn() + Send + Sync + 'static,
    ) -> Self {
        let gpu = Self::new(device, queue, adapter, true);
        let faults = gpu.faults.clone();
        gpu.device.set_device_lost_callback(move |reason, message| {
            faults.lock().unwrap_or_else(PoisonError::into_inner).mark_lost(reason, &message);
            lost();
        });
        gpu
    }

    fn new(device: wgpu::Device, queue: wgpu::Queue, adapter: wgpu::AdapterInfo, is_shared: bool) -> Self {
        let faults = Arc::new(Mutex::new(Faults::default()));
        let handler_faults = faults.clone();
        device.set_device_lost_callback(move |reason, message| {
            handler_faults.lock().unwrap_or_else(PoisonError::into_inner).mark_lost(reason, &message);
        });
        let tier = match adapter.device_type {
            wgpu::DeviceType::Cpu => Tier::Software,
            _ => Tier::Hardware,
        };
        Self { limits: device.limits(), device, queue, adapter, tier, is_shared, faults }
    }

    /// Returns the adapter and its driver on one line.
    pub fn description(&self) -> String {
        let info = &self.adapter;
        format!("{} ({:?}, {} {})", info.name, info.backend, info.driver, info.driver_info)
    }

    /// Runs `work` (creating resources, submitting commands) and returns errors of the device. `during` names the work
    /// for the message, such as "drawing shadow maps".
    pub fn checked<T>(&self, during: &str, work: impl FnOnce() -> Result<T, GpuError>) -> Result<T, GpuError> {
        self.take_fault()?;
        let internal = self.device.push_error_scope(wgpu::ErrorFilter::Internal);
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let result = work();
        let errors = [validation, memory, internal].map(|scope| pollster::block_on(scope.pop()));
        // A lost device makes every call invalid, so the loss is reported first. Lack of memory also makes later calls
        // invalid.
        self.take_fault()?;
        let memory_first = |error: &wgpu::Error| !matches!(error, wgpu::Error::OutOfMemory { .. });
        if let Some(error) = errors.into_iter().flatten().min_by_key(memory_first) {
            return Err(match error {
                wgpu::Error::OutOfMemory { .. } => GpuError::OutOfMemory(during.to_owned()),
                other => GpuError::Refused { during: during.to_owned(), reason: other.to_string() },
            });
        }
        result
    }

    /// Returns an error if the device was lost.
    pub(super) fn check_not_lost(&self) -> Result<(), GpuError> {
        let faults = self.faults.lock().unwrap_or_else(PoisonError::into_inner);
        faults.lost.clone().map_or(Ok(()), |reason| Err(GpuError::Lost(reason)))
    }

    /// Marks the device as lost and returns the error.
    pub(super) fn mark_lost(&self, reason: &str) -> GpuError {
        let mut faults = self.faults.lock().unwrap_or_else(PoisonError::into_inner);
        GpuError::Lost(faults.lost.get_or_insert_with(|| reason.to_owned()).clone())
    }

    /// Returns the errors that the handlers received, as an error. An uncaptured error is reported once.
    fn take_fault(&self) -> Result<(), GpuError> {
        let mut faults = self.faults.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(reason) = &faults.lost {
            return Err(GpuError::Lost(reason.clone()));
        }
        match faults.uncaptured.take() {
            Some(reason) => Err(GpuError::Refused { during: "an earlier submission".to_owned(), reason }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open() -> Option<Gpu> {
        match Gpu::open() {
            Ok(gpu) => Some(gpu),
            Err(error) => {
                eprintln!("SKIPPED: {error}");
                None
            }
        }
    }

    #[test]
    fn tiers_are_ordered_and_no_adapter_is_the_lowest() {
        assert!(Tier::None < Tier::Software && Tier::Software < Tier::Hardware);
        assert_eq!(Tier::of(None), Tier::None);
        let message = GpuError::NoAdapter("nothing".to_owned()).to_string();
        assert!(message.contains("mesa-vulkan-drivers") && message.contains("--backend cpu"), "{message}");
    }

    #[test]
    fn after_an_invalid_request_the_device_still_works() {
        let Some(gpu) = open() else { return };
        eprintln!("adapter: {}, tier {:?}", gpu.description(), gpu.tier);
        let invalid =
            wgpu::ShaderModuleDescriptor { label: None, source: wgpu::ShaderSource::Wgsl("fn main( {".into()) };
        let refused = gpu.checked("testing", || Ok(gpu.device.create_shader_module(invalid.clone())));
        assert!(matches!(refused, Err(GpuError::Refused { .. })), "{refused:?}");
        // A second request outside of an error scope, where the default handler of wgpu would panic.
        let _module = gpu.device.create_shader_module(invalid);
        assert!(matches!(gpu.checked("testing", || Ok(())), Err(GpuError::Refused { .. })));
        gpu.checked("testing", || Ok(())).expect("reported once, the GPU works");
    }

    #[test]
    fn a_destroyed_device_reports_its_loss_and_does_not_panic() {
        let Some(gpu) = open() else { return };
        gpu.device.destroy();
        let data = vec![1.0f32; 16];
        let result =
            gpu.upload("test data", &data, wgpu::BufferUsages::COPY_SRC).and_then(|buffer| gpu.read::<f32>(&buffer));
        assert!(result.is_err());
    }
}
