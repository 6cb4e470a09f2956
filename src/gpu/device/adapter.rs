//! Opening a device without a window, and keeping its errors from becoming panics.

use std::sync::{Arc, Mutex, PoisonError};

use crate::gpu::GpuError;

/// What this machine can run, each tier a superset of the one before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Tier {
    /// No adapter: everything runs on the CPU.
    None,
    /// An adapter that is the CPU in disguise (lavapipe, WARP): right, but slower than our own CPU routes.
    Software,
    /// A graphics processor.
    Hardware,
}

impl Tier {
    /// The tier of a machine on which [`Gpu::open`] gave this.
    pub fn of(gpu: Option<&Gpu>) -> Self {
        gpu.map_or(Self::None, |gpu| gpu.tier)
    }
}

/// Bytes that one storage buffer may need: a batch of shadow maps, the corners of some millions of triangles.
const WANTED_BUFFER_BYTES: u64 = 1 << 30;

/// An open device. Cheap to pass by reference; pipelines borrow it and live beside it.
#[derive(Debug)]
pub struct Gpu {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    /// Name, driver, kind and back end of the adapter.
    pub adapter: wgpu::AdapterInfo,
    /// What was granted: what the buffers need, or what the adapter has where that is less.
    pub limits: wgpu::Limits,
    pub tier: Tier,
    /// Whether a window draws on it, too.
    pub(super) is_shared: bool,
    faults: Arc<Mutex<Faults>>,
}

/// What the device's handlers heard.
#[derive(Debug, Default)]
struct Faults {
    lost: Option<String>,
    uncaptured: Option<String>,
}

impl Faults {
    fn lose(&mut self, reason: wgpu::DeviceLostReason, message: &str) {
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

    /// What a device that is to be a [`Gpu`] must be asked for.
    pub fn request(adapter: &wgpu::Adapter) -> wgpu::DeviceDescriptor<'static> {
        let wanted = wgpu::Limits {
            max_storage_buffer_binding_size: WANTED_BUFFER_BYTES,
            max_buffer_size: WANTED_BUFFER_BYTES,
            ..wgpu::Limits::default()
        };
        wgpu::DeviceDescriptor {
            label: Some("biscale"),
            // Times of stages are told where the adapter has a clock.
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
        let heard = gpu.faults.clone();
        gpu.device.on_uncaptured_error(Arc::new(move |error| {
            let mut heard = heard.lock().unwrap_or_else(PoisonError::into_inner);
            heard.uncaptured.get_or_insert_with(|| error.to_string());
        }));
        Ok(gpu)
    }

    /// The device that a window draws on: what is made here can be shown without being read back. The window hears of
    /// uncaptured errors itself; `lost` is told when the device is gone.
    pub fn of_window(
        adapter: wgpu::AdapterInfo,
        device: wgpu::Device,
        queue: wgpu::Queue,
        lost: impl Fn() + Send + Sync + 'static,
    ) -> Self {
        let gpu = Self::new(device, queue, adapter, true);
        let heard = gpu.faults.clone();
        gpu.device.set_device_lost_callback(move |reason, message| {
            heard.lock().unwrap_or_else(PoisonError::into_inner).lose(reason, &message);
            lost();
        });
        gpu
    }

    fn new(device: wgpu::Device, queue: wgpu::Queue, adapter: wgpu::AdapterInfo, is_shared: bool) -> Self {
        let faults = Arc::new(Mutex::new(Faults::default()));
        let heard = faults.clone();
        device.set_device_lost_callback(move |reason, message| {
            heard.lock().unwrap_or_else(PoisonError::into_inner).lose(reason, &message);
        });
        let tier = match adapter.device_type {
            wgpu::DeviceType::Cpu => Tier::Software,
            _ => Tier::Hardware,
        };
        Self { limits: device.limits(), device, queue, adapter, tier, is_shared, faults }
    }

    /// The adapter and its driver on one line.
    pub fn description(&self) -> String {
        let info = &self.adapter;
        format!("{} ({:?}, {} {})", info.name, info.backend, info.driver, info.driver_info)
    }

    /// Runs `work` (creating resources, submitting commands) and gives back the device's complaints as an error.
    /// `during` names the work for the message: "drawing shadow maps".
    pub fn checked<T>(&self, during: &str, work: impl FnOnce() -> Result<T, GpuError>) -> Result<T, GpuError> {
        self.fault()?;
        let internal = self.device.push_error_scope(wgpu::ErrorFilter::Internal);
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let done = work();
        let complaints = [validation, memory, internal].map(|scope| pollster::block_on(scope.pop()));
        // A lost device makes every call invalid: say that first. Lack of memory makes what follows invalid too.
        self.fault()?;
        let memory_first = |error: &wgpu::Error| !matches!(error, wgpu::Error::OutOfMemory { .. });
        if let Some(error) = complaints.into_iter().flatten().min_by_key(memory_first) {
            return Err(match error {
                wgpu::Error::OutOfMemory { .. } => GpuError::OutOfMemory(during.to_owned()),
                other => GpuError::Refused { during: during.to_owned(), reason: other.to_string() },
            });
        }
        done
    }

    /// Whether the device was not lost.
    pub(super) fn is_there(&self) -> Result<(), GpuError> {
        let heard = self.faults.lock().unwrap_or_else(PoisonError::into_inner);
        heard.lost.clone().map_or(Ok(()), |reason| Err(GpuError::Lost(reason)))
    }

    /// Takes the device for lost, if it was not yet.
    pub(super) fn lose(&self, reason: &str) -> GpuError {
        let mut heard = self.faults.lock().unwrap_or_else(PoisonError::into_inner);
        GpuError::Lost(heard.lost.get_or_insert_with(|| reason.to_owned()).clone())
    }

    /// What the handlers have heard since the device was opened, as an error; an uncaptured one is reported once.
    fn fault(&self) -> Result<(), GpuError> {
        let mut heard = self.faults.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(reason) = &heard.lost {
            return Err(GpuError::Lost(reason.clone()));
        }
        match heard.uncaptured.take() {
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
    fn an_invalid_request_is_an_error_and_the_device_lives_on() {
        let Some(gpu) = open() else { return };
        eprintln!("adapter: {}, tier {:?}", gpu.description(), gpu.tier);
        let nonsense =
            wgpu::ShaderModuleDescriptor { label: None, source: wgpu::ShaderSource::Wgsl("fn main( {".into()) };
        let refused = gpu.checked("testing", || Ok(gpu.device.create_shader_module(nonsense.clone())));
        assert!(matches!(refused, Err(GpuError::Refused { .. })), "{refused:?}");
        // The same outside an error scope: the default handler would panic here.
        let _module = gpu.device.create_shader_module(nonsense);
        assert!(matches!(gpu.checked("testing", || Ok(())), Err(GpuError::Refused { .. })));
        gpu.checked("testing", || Ok(())).expect("reported once, the device works");
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
