//! Denormal numbers flushed to zero: a decaying tail must not cost a hundred times what a loud signal does.

/// While this lives, denormal results and operands count as zero on this thread.
#[derive(Debug)]
pub struct Flushed {
    #[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
    before: Control,
}

#[cfg(target_arch = "x86_64")]
type Control = u32;
#[cfg(target_arch = "aarch64")]
type Control = u64;

#[cfg(target_arch = "x86_64")]
mod arch {
    use std::arch::asm;

    /// Flush-to-zero (bit 15) and denormals-are-zero (bit 6) of MXCSR.
    pub(super) const FLUSH: u32 = (1 << 15) | (1 << 6);

    pub(super) fn read() -> u32 {
        let mut value = 0_u32;
        // SAFETY: stores MXCSR to a local of its size; SSE is part of x86-64.
        unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut value, options(nostack, preserves_flags)) };
        value
    }

    pub(super) fn write(value: u32) {
        // SAFETY: `value` came from `read` with flush bits added, so no reserved bit is set, and exception
        // masks are as they were. The flush bits change rounding of denormals only.
        unsafe {
            asm!("ldmxcsr [{}]", in(reg) &raw const value, options(nostack, preserves_flags, readonly))
        };
    }
}

#[cfg(target_arch = "aarch64")]
mod arch {
    use std::arch::asm;

    /// Flush-to-zero (bit 24) of FPCR.
    pub(super) const FLUSH: u64 = 1 << 24;

    pub(super) fn read() -> u64 {
        let value: u64;
        // SAFETY: reads a register that every level may read.
        unsafe { asm!("mrs {}, fpcr", out(reg) value, options(nomem, nostack, preserves_flags)) };
        value
    }

    pub(super) fn write(value: u64) {
        // SAFETY: writes back what was read, with the flush bit added.
        unsafe { asm!("msr fpcr, {}", in(reg) value, options(nomem, nostack, preserves_flags)) };
    }
}

#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
impl Flushed {
    /// From here on.
    #[allow(clippy::new_without_default)]
    pub fn new() -> Self {
        let before = arch::read();
        if before & arch::FLUSH != arch::FLUSH {
            arch::write(before | arch::FLUSH);
        }
        Self { before }
    }
}

#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
impl Drop for Flushed {
    fn drop(&mut self) {
        if self.before & arch::FLUSH != arch::FLUSH {
            arch::write(self.before);
        }
    }
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
impl Flushed {
    /// From here on.
    #[allow(clippy::new_without_default)]
    pub fn new() -> Self {
        Self {}
    }
}

#[cfg(all(test, any(target_arch = "x86_64", target_arch = "aarch64")))]
mod tests {
    use super::*;
    use std::hint::black_box;

    #[test]
    fn denormals_are_zero_inside_and_are_back_outside() {
        let tiny = black_box(f32::MIN_POSITIVE);
        {
            let _flushed = Flushed::new();
            assert_eq!(black_box(tiny * black_box(0.5)), 0.0);
        }
        assert!(black_box(tiny * black_box(0.5)) > 0.0);
    }
}
