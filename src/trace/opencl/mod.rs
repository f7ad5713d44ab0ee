//! Ambient occlusion, and what voxels see, on any OpenCL device: the same bits as on the processor.
//!
//! What a ray hits is defined by exact signs. A device settles nearly all rays in single precision, beside a bound on the
//! rounding, some more in double precision if it has that, and leaves the rest to the host, which decides exactly. So the
//! device's arithmetic need not be like the host's, with one exception: the directions of the rays, which it makes from
//! integers by few, correctly rounded operations. Whether it does that right is tried when it is opened; if not, they
//! are made here and handed over.
//!
//! - [`devices()`]: what there is;
//! - `device`: an open device, the only file that calls OpenCL;
//! - `layout`, `program`: the structs and the text of the kernels (`kernels/*.cl`);
//! - [`Scene`]: a mesh with its hierarchy on a device;
//! - `points`: shading points, in batches short enough for watchdogs and for whoever wants to stop.
//!
//! libOpenCL is opened at run time; nothing of it is needed to build, or to run without it.

mod device;
mod devices;
mod error;
mod layout;
mod points;
mod program;
mod scene;

pub use devices::{Info, Kind, devices, preferred};
pub use error::Error;
pub use points::Point;
pub use scene::Scene;

use device::Device;

/// Open devices, that share the work.
#[derive(Debug)]
pub struct OpenCl {
    devices: Vec<Device>,
}

impl OpenCl {
    /// Opens the devices of these platforms and numbers, or if none is named the one that [`preferred`] names.
    ///
    /// # Errors
    /// [`Error::Missing`] if there is no OpenCL, [`Error::NoDevice`] if not such a device.
    pub fn open(places: &[(usize, usize)]) -> Result<Self, Error> {
        let open = |place| Device::open(devices::choose(place)?);
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
