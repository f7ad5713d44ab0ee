//! First hits and open fractions on any OpenCL device: the same bits as on the processor.
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
//! - `wide`, `facet`: the hierarchy and the simplices as devices want them;
//! - `scene`: the mesh on devices, and who does what of the work;
//! - [`OpenClBackend`]: a mesh with its hierarchy on devices;
//! - `points`: shading points, in batches short enough for watchdogs and for whoever wants to stop;
//! - `stars`: what the simplices around them hide; `order`: which of their rays go side by side; `launch`, `bits`: a batch of
//!   rays, and what becomes of them.
//!
//! libOpenCL is opened at run time; nothing of it is needed to build, or to run without it.

mod backend;
mod bits;
mod device;
mod devices;
mod error;
mod facet;
mod launch;
mod layout;
mod open;
mod order;
mod points;
mod program;
mod scene;
mod stars;
mod wide;

pub use backend::OpenClBackend;
pub use devices::{Info, Kind, devices, preferred};
pub use error::Error;
pub use open::OpenCl;
