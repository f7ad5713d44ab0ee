//! What goes wrong with OpenCL, in words.

use opencl3::error_codes::{self, ClError};

/// Why OpenCL can't do what it should.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// No loader, or no platform behind it.
    #[error(
        "there is no OpenCL here ({0}). Install the loader and a driver: for the processor Debian's and Ubuntu's \
         ocl-icd-libopencl1 and pocl-opencl-icd, for a GPU that of its maker. Or take --backend cpu"
    )]
    Missing(String),
    /// There is no such device.
    #[error("there is no OpenCL device {wanted}; `ao4d devices` lists those that are: {found}")]
    NoDevice {
        /// What was asked for.
        wanted: String,
        /// What there is.
        found: String,
    },
    /// A call fails.
    #[error("{device}: {action} failed: {reason}")]
    Call {
        /// On which device.
        device: String,
        /// What was tried.
        action: &'static str,
        /// The error code in words.
        reason: String,
    },
    /// The kernels don't compile.
    #[error("{device}: the kernels don't compile ({reason}):\n{log}")]
    Build {
        /// On which device.
        device: String,
        /// The error code in words.
        reason: String,
        /// What the compiler says.
        log: String,
    },
    /// The device's compiler lays structs out otherwise than the host's.
    #[error("{device}: structs are laid out as {found:?} instead of {expected:?}; this device can't be used")]
    Layout {
        /// On which device.
        device: String,
        /// Sizes and offsets there.
        found: Vec<u32>,
        /// Those of the host.
        expected: Vec<u32>,
    },
    /// Something is larger than the device takes.
    #[error("{device}: {what} take {needed} bytes, and the device takes {limit} in one piece; use --backend cpu")]
    TooLarge {
        /// On which device.
        device: String,
        /// What.
        what: &'static str,
        /// Its size.
        needed: u64,
        /// The largest size.
        limit: u64,
    },
}

/// The error code in words, with a remedy where there is a plain one.
pub(super) fn explain(error: &ClError) -> String {
    let code = error.0;
    let words = match code {
        error_codes::CL_OUT_OF_HOST_MEMORY => "the computer's memory is full",
        error_codes::CL_OUT_OF_RESOURCES => "the device's resources are exhausted, or it was reset",
        error_codes::CL_MEM_OBJECT_ALLOCATION_FAILURE => "the device's memory is full; use a smaller scene",
        error_codes::CL_DEVICE_NOT_AVAILABLE => "the device isn't available now",
        error_codes::CL_COMPILER_NOT_AVAILABLE => "the device has no compiler",
        error_codes::CL_INVALID_COMMAND_QUEUE | error_codes::CL_INVALID_CONTEXT => "the device was lost",
        error_codes::CL_INVALID_BUFFER_SIZE => "the device takes no piece of memory of this size",
        _ => error_codes::error_text(code),
    };
    format!("{words} ({}, {code})", error_codes::error_text(code))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_have_words() {
        for code in [-4, -5, -6, -2, -3, -36, -61, -9999] {
            let text = explain(&ClError(code));
            assert!(text.contains(&code.to_string()) && text.len() > 12, "{text}");
        }
        assert!(explain(&ClError(-4)).contains("memory is full"));
    }
}
