//! Opening devices.

use std::sync::Arc;

use super::device::Device;
use super::devices::{self, Info};
use super::error::Error;

/// Open devices, that share the work. Clones stand for the same devices.
#[derive(Clone, Debug)]
pub struct OpenCl {
    pub(super) devices: Vec<Arc<Device>>,
}

impl OpenCl {
    /// Opens the devices of these platforms and numbers, or if none is named the one that [`devices::preferred`] names.
    ///
    /// # Errors
    /// [`Error::Missing`] if there is no OpenCL, [`Error::NoDevice`] if not such a device.
    pub fn open(places: &[(usize, usize)]) -> Result<Self, Error> {
        let open = |place| Ok(Arc::new(Device::open(devices::choose(place)?)?));
        let devices = match places {
            [] => vec![open(None)?],
            places => places.iter().map(|&place| open(Some(place))).collect::<Result<_, _>>()?,
        };
        Ok(Self { devices })
    }

    /// What they are.
    pub fn devices(&self) -> impl Iterator<Item = &Info> {
        self.devices.iter().map(|device| &device.info)
    }
}
