//! The OpenCL devices of this computer.

use std::sync::{Mutex, PoisonError};

use opencl3::device::{CL_DEVICE_TYPE_ALL, CL_DEVICE_TYPE_CPU, CL_DEVICE_TYPE_GPU, Device};
use opencl3::platform::{Platform, get_platforms};
use opencl3::types::cl_device_id;

use super::error::{Error, explain};

/// CL_FP_CORRECTLY_ROUNDED_DIVIDE_SQRT.
const ROUNDED: u64 = 1 << 7;

/// What kind of device it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A graphics processor.
    Gpu,
    /// Something else.
    Other,
    /// The processor itself.
    Cpu,
}

/// A device.
#[derive(Clone, Debug)]
pub struct Info {
    /// The platform's number and the device's on it, as `--backend opencl:P.D` names it.
    pub place: (usize, usize),
    /// The platform's name.
    pub platform: String,
    /// The device's name.
    pub name: String,
    /// The version of OpenCL.
    pub version: String,
    /// The driver's version.
    pub driver: String,
    /// What it is.
    pub kind: Kind,
    /// Its compute units.
    pub units: u32,
    /// Bytes of memory.
    pub memory: u64,
    /// Bytes that it takes in one piece.
    pub largest: u64,
    /// Whether it has double precision.
    pub double: bool,
    /// Whether it can be used: it is there, has a compiler and the usual byte order.
    pub usable: bool,
    /// Whether it rounds divisions and roots correctly, if asked to.
    pub(super) rounded: bool,
    /// Bits of an address.
    pub(super) id: usize,
}

impl Info {
    fn of(platform: &Platform, place: (usize, usize), id: cl_device_id) -> Self {
        let device = Device::new(id);
        let kind = match device.dev_type().unwrap_or(0) {
            t if t & CL_DEVICE_TYPE_GPU != 0 => Kind::Gpu,
            t if t & CL_DEVICE_TYPE_CPU != 0 => Kind::Cpu,
            _ => Kind::Other,
        };
        let clean = |text: Result<String, _>| text.unwrap_or_default().trim().to_owned();
        let yes = |flag: Result<bool, _>| flag.unwrap_or(false);
        Self {
            place,
            platform: clean(platform.name()),
            name: clean(device.name()),
            version: clean(device.version()),
            driver: clean(device.driver_version()),
            kind,
            units: device.max_compute_units().unwrap_or(0),
            memory: device.global_mem_size().unwrap_or(0),
            largest: device.max_mem_alloc_size().unwrap_or(0),
            double: device.double_fp_config().unwrap_or(0) != 0,
            usable: yes(device.available()) && yes(device.compiler_available()) && yes(device.endian_little()),
            rounded: device.single_fp_config().unwrap_or(0) & ROUNDED != 0,
            id: id as usize,
        }
    }

    /// As messages name it.
    pub fn label(&self) -> String {
        format!("OpenCL device {}.{} ({})", self.place.0, self.place.1, self.name)
    }
}

/// All devices, platform by platform. One that can't be asked is left out.
///
/// # Errors
/// [`Error::Missing`] if there is no loader, or nothing behind it.
pub fn devices() -> Result<Vec<Info>, Error> {
    // Some drivers say that they have no device while another thread has them look.
    static LOOKING: Mutex<()> = Mutex::new(());
    let _alone = LOOKING.lock().unwrap_or_else(PoisonError::into_inner);
    let platforms = get_platforms().map_err(|error| Error::Missing(explain(&error)))?;
    let mut found = Vec::new();
    for (p, platform) in platforms.iter().enumerate() {
        // A platform without devices says so by an error.
        let ids = platform.get_devices(CL_DEVICE_TYPE_ALL).unwrap_or_default();
        found.extend(ids.into_iter().enumerate().map(|(d, id)| Info::of(platform, (p, d), id)));
    }
    if found.is_empty() { Err(Error::Missing("no platform has a device".to_owned())) } else { Ok(found) }
}

/// The one that is taken if nobody chooses: a GPU rather than anything else, the processor last.
pub fn preferred(devices: &[Info]) -> Option<&Info> {
    devices.iter().filter(|d| d.usable).min_by_key(|d| (d.kind, d.place))
}

/// The device of this platform and number, or the preferred one.
pub(super) fn choose(place: Option<(usize, usize)>) -> Result<Info, Error> {
    let devices = devices()?;
    let found = match place {
        Some(place) => devices.iter().find(|d| d.place == place && d.usable),
        None => preferred(&devices),
    };
    found.cloned().ok_or_else(|| Error::NoDevice {
        wanted: place.map_or_else(|| "that can be used".to_owned(), |(p, d)| format!("{p}.{d}")),
        found: devices.iter().map(|d| format!("{}.{} {}", d.place.0, d.place.1, d.name)).collect::<Vec<_>>().join(", "),
    })
}
