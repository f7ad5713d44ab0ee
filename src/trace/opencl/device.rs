//! A device that is open: a context, a queue, and what is done with them, each call with its error in words.
//!
//! This is the only file that calls OpenCL. All transfers wait until they are done, so no buffer is dropped while
//! the device still uses it.

use std::ffi::c_void;
use std::marker::PhantomData;
use std::ptr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use bytemuck::Pod;
use opencl3::command_queue::{CL_QUEUE_PROFILING_ENABLE, CommandQueue};
use opencl3::context::Context;
use opencl3::error_codes::ClError;
use opencl3::event::Event;
use opencl3::kernel::Kernel;
use opencl3::memory::{Buffer, CL_MEM_READ_WRITE, ClMem};
use opencl3::program::Program;
use opencl3::types::{CL_TRUE, cl_device_id, cl_mem};

use super::devices::Info;
use super::error::{Error, explain};
use super::program::{self, GROUP, Shape};

/// An open device, with a queue of its own.
#[derive(Debug)]
pub(super) struct Device {
    pub info: Info,
    queue: CommandQueue,
    context: Arc<Context>,
    /// What has been started since results were read.
    started: Mutex<Vec<Event>>,
    /// Nanoseconds that kernels have taken.
    busy: AtomicU64,
}

/// The kernels for one dimension and hierarchy.
#[derive(Debug)]
pub(super) struct Kernels {
    program: Arc<Program>,
    pub layout: Kernel,
    pub directions: Kernel,
    pub stars: Kernel,
    pub aimed: Kernel,
    pub occluded: Kernel,
    pub occluded_again: Kernel,
    /// Instead of `occluded`, for sets of rays, if that is what the program is made for.
    pub occluded_sets: Option<Kernel>,
    pub packed: Kernel,
    pub first_hit: Kernel,
}

impl Kernels {
    fn of(program: Arc<Program>, sets: bool) -> Result<Self, (&'static str, ClError)> {
        let kernel = |name: &'static str| Kernel::create(&program, name).map_err(|error| (name, error));
        Ok(Self {
            layout: kernel("layout")?,
            directions: kernel("directions")?,
            stars: kernel("stars")?,
            aimed: kernel("aimed")?,
            occluded: kernel("occluded")?,
            occluded_again: kernel("occluded_again")?,
            occluded_sets: if sets { Some(kernel("occluded_sets")?) } else { None },
            packed: kernel("packed")?,
            first_hit: kernel("first_hit")?,
            program,
        })
    }
}

/// Memory of the device that holds values of a type.
#[derive(Debug)]
pub(super) struct Memory<T> {
    buffer: Buffer<u8>,
    /// How many values it has room for.
    pub room: usize,
    values: PhantomData<T>,
}

/// Memory that is used again for as long as it has room.
pub(super) type Kept<T> = Option<Memory<T>>;

/// An argument of a kernel.
pub(super) enum Argument<'a> {
    Memory(cl_mem, PhantomData<&'a ()>),
    U32(u32),
    U64(u64),
    F32(f32),
}

impl<T> Memory<T> {
    /// As an argument, for as long as it is borrowed.
    pub fn argument(&self) -> Argument<'_> {
        Argument::Memory(self.buffer.get(), PhantomData)
    }
}

impl Device {
    pub fn open(info: Info) -> Result<Self, Error> {
        let device = opencl3::device::Device::new(info.id as cl_device_id);
        let failed = |action| {
            let device = info.label();
            move |error: ClError| Error::Call { device, action, reason: explain(&error) }
        };
        let context = Arc::new(Context::from_device(&device).map_err(failed("opening the device"))?);
        Self::with_queue(info.clone(), context).map_err(failed("making a queue"))
    }

    /// The same device and memory, with another queue: what is in one does not wait for what is in the other.
    pub fn beside(&self) -> Result<Self, Error> {
        Self::with_queue(self.info.clone(), Arc::clone(&self.context)).map_err(self.failed("making a queue"))
    }

    fn with_queue(info: Info, context: Arc<Context>) -> Result<Self, ClError> {
        #[allow(deprecated)] // The newer call needs OpenCL 2.
        let queue = CommandQueue::create_default(&context, CL_QUEUE_PROFILING_ENABLE)?;
        Ok(Self { info, queue, context, started: Mutex::default(), busy: AtomicU64::new(0) })
    }

    /// How long kernels have run, of those whose results were read.
    pub fn busy(&self) -> Duration {
        Duration::from_nanos(self.busy.load(Ordering::Relaxed))
    }

    fn failed(&self, action: &'static str) -> impl FnOnce(ClError) -> Error + '_ {
        move |error| Error::Call { device: self.info.label(), action, reason: explain(&error) }
    }

    /// Compiles the kernels, and sees that structs are what they should be.
    pub fn build(&self, shape: Shape) -> Result<Kernels, Error> {
        self.compile(&program::text(shape, self.info.double), shape.sets)
    }

    fn most_of_group(&self, kernel: &Kernel) -> usize {
        kernel.get_work_group_size(self.info.id as cl_device_id).unwrap_or(1).max(1)
    }

    fn compile(&self, text: &str, sets: bool) -> Result<Kernels, Error> {
        let options =
            if self.info.rounded { "-cl-std=CL1.2 -cl-fp32-correctly-rounded-divide-sqrt" } else { "-cl-std=CL1.2" };
        let id = self.info.id as cl_device_id;
        let mut program =
            Program::create_from_source(&self.context, text).map_err(self.failed("handing over the kernels"))?;
        let built = program.build(&[id], options);
        let log = program.get_build_log(id).unwrap_or_default();
        let refuse = |reason: String| Error::Build { device: self.info.label(), reason, log: log.trim().to_owned() };
        built.map_err(|error| refuse(explain(&error)))?;
        // Some compilers report success and leave kernels out.
        let kernels = Kernels::of(Arc::new(program), sets)
            .map_err(|(name, error)| refuse(format!("no kernel `{name}`, {}", explain(&error))))?;
        let expected = program::expected_layout();
        let sizes = self.output::<u32>(expected.len(), "sizes of structs")?;
        self.launch(&kernels.layout, &[sizes.argument()], 1)?;
        let mut found = vec![0; expected.len()];
        self.read(&sizes, &mut found)?;
        if found != expected {
            return Err(Error::Layout { device: self.info.label(), found, expected });
        }
        Ok(kernels)
    }

    /// The same kernels again, as each can have only one set of arguments.
    pub fn again(&self, kernels: &Kernels) -> Result<Kernels, Error> {
        Kernels::of(Arc::clone(&kernels.program), kernels.occluded_sets.is_some())
            .map_err(|(_, error)| self.failed("making a kernel")(error))
    }

    /// Memory that holds these values.
    pub fn input<T: Pod>(&self, values: &[T], what: &'static str) -> Result<Memory<T>, Error> {
        let mut memory = self.output(values.len(), what)?;
        self.write(&mut memory, 0, values)?;
        Ok(memory)
    }

    /// As [`Self::output`], kept; what was there may be lost.
    pub fn room<'m, T: Pod>(
        &self,
        kept: &'m mut Kept<T>,
        room: usize,
        what: &'static str,
    ) -> Result<&'m mut Memory<T>, Error> {
        let found = kept.take().filter(|memory| memory.room >= room);
        Ok(kept.insert(found.map_or_else(|| self.output(room, what), Ok)?))
    }

    /// As [`Self::input`], kept.
    pub fn filled<'m, T: Pod>(
        &self,
        kept: &'m mut Kept<T>,
        values: &[T],
        what: &'static str,
    ) -> Result<&'m Memory<T>, Error> {
        let memory = self.room(kept, values.len(), what)?;
        self.write(memory, 0, values)?;
        Ok(memory)
    }

    /// Memory with room for so many values, at least one.
    pub fn output<T: Pod>(&self, room: usize, what: &'static str) -> Result<Memory<T>, Error> {
        let bytes = room.max(1) * size_of::<T>();
        if self.info.largest > 0 && bytes as u64 > self.info.largest {
            let (needed, limit) = (bytes as u64, self.info.largest);
            return Err(Error::TooLarge { device: self.info.label(), what, needed, limit });
        }
        // SAFETY: no host memory is handed over.
        let buffer =
            unsafe { Buffer::<u8>::create(&self.context, CL_MEM_READ_WRITE, bytes, ptr::null_mut::<c_void>()) };
        let buffer = buffer.map_err(self.failed("asking for memory"))?;
        Ok(Memory { buffer, room: room.max(1), values: PhantomData })
    }

    /// Writes values to the memory, from its value number `first` on.
    ///
    /// # Panics
    /// If it has no room for them.
    pub fn write<T: Pod>(&self, memory: &mut Memory<T>, first: usize, values: &[T]) -> Result<(), Error> {
        assert!(first + values.len() <= memory.room);
        if values.is_empty() {
            return Ok(());
        }
        let bytes = bytemuck::cast_slice(values);
        // SAFETY: the call waits until the bytes are read, and there is room for them.
        let offset = first * size_of::<T>();
        let done = unsafe { self.queue.enqueue_write_buffer(&mut memory.buffer, CL_TRUE, offset, bytes, &[]) };
        done.map(|_| ()).map_err(self.failed("writing to its memory"))
    }

    /// Reads values from the beginning of the memory, when all work before is done.
    ///
    /// # Panics
    /// If it has fewer.
    pub fn read<T: Pod>(&self, memory: &Memory<T>, values: &mut [T]) -> Result<(), Error> {
        assert!(values.len() <= memory.room);
        if values.is_empty() {
            return Ok(());
        }
        let bytes = bytemuck::cast_slice_mut(values);
        // SAFETY: the call waits until the bytes are written, and there are as many.
        let done = unsafe { self.queue.enqueue_read_buffer(&memory.buffer, CL_TRUE, 0, bytes, &[]) };
        done.map_err(self.failed("reading from its memory"))?;
        // The queue goes in order, so all of it is done.
        for event in self.started.lock().unwrap_or_else(PoisonError::into_inner).drain(..) {
            let time = event.profiling_command_end().ok().zip(event.profiling_command_start().ok());
            let nanoseconds = time.map_or(0, |(end, start)| end.saturating_sub(start));
            self.busy.fetch_add(nanoseconds, Ordering::Relaxed);
        }
        Ok(())
    }

    /// Starts a kernel with at least so many work-items; what is behind the last has to be seen to by the kernel.
    pub fn launch(&self, kernel: &Kernel, arguments: &[Argument], items: usize) -> Result<(), Error> {
        for (index, argument) in (0..).zip(arguments) {
            // SAFETY: each is handed over by reference to a value of the type that the kernel declares there.
            let set = unsafe {
                match argument {
                    Argument::Memory(memory, _) => kernel.set_arg(index, memory),
                    Argument::U32(number) => kernel.set_arg(index, number),
                    Argument::U64(number) => kernel.set_arg(index, number),
                    Argument::F32(number) => kernel.set_arg(index, number),
                }
            };
            set.map_err(self.failed("setting an argument"))?;
        }
        let group = GROUP.min(self.most_of_group(kernel));
        let global = items.next_multiple_of(group);
        // SAFETY: the kernels look at nothing beyond the memory they get, for as many items as they are told.
        let started = unsafe {
            self.queue.enqueue_nd_range_kernel(kernel.get(), 1, ptr::null(), &raw const global, &raw const group, &[])
        };
        let event = started.map_err(self.failed("starting a kernel"))?;
        self.started.lock().unwrap_or_else(PoisonError::into_inner).push(event);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::opencl::devices::choose;

    /// A device whose answers can be made up.
    fn open() -> Device {
        Device::open(choose(None).unwrap()).unwrap()
    }

    #[test]
    #[ignore = "needs an OpenCL device: run tests/all"]
    fn what_the_compiler_says_is_told() {
        let device = open();
        let shape = Shape { dimension: 4, depth: 20, sets: true, piece: None };
        let text = program::text(shape, device.info.double);
        let broken =
            device.compile(&text.replace("float4 position;", "flaot4 position;"), true).unwrap_err().to_string();
        assert!(broken.contains("don't compile") && broken.contains("flaot4"), "{broken}");
        let missing = device.compile(&text.replace("first_hit(", "last_hit("), true).unwrap_err().to_string();
        assert!(missing.contains("no kernel `first_hit`"), "{missing}");
        let other = device.compile(&text.replace("uint next;", "uint next, more[4];"), true).unwrap_err();
        assert!(matches!(other, Error::Layout { .. }), "{other}");
        assert!(device.compile(&text, true).is_ok());
    }

    #[test]
    #[ignore = "needs an OpenCL device: run tests/all"]
    fn what_does_not_fit_is_told() {
        let mut device = open();
        let room = device.info.largest as usize / 4 + 1;
        let error = device.output::<f32>(room, "the corners of the simplices").unwrap_err();
        assert!(matches!(error, Error::TooLarge { .. }) && error.to_string().contains("the corners"), "{error}");
        // A device that says it takes anything, and doesn't. NVIDIA's take anything, and fail when it is used.
        device.info.largest = 0;
        match device.output::<f32>(1 << 50, "results") {
            Ok(_) => assert!(device.info.label().contains("NVIDIA"), "{}", device.info.label()),
            Err(error) => {
                let error = error.to_string();
                assert!(
                    error.starts_with(&device.info.label()) && error.contains("asking for memory failed"),
                    "{error}"
                );
            }
        }
    }
}
