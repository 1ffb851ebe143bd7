//! Rounding of a thread, and flushing of denormal numbers to zero: a decaying tail must not cost a
//! hundred times as much as a loud signal.

use arch::PARTS;

/// Rounding, denormal handling and exception traps of a thread. On an unknown CPU it never changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FloatControl(u64);

/// Bits of all parts.
const ALL: u64 = {
    let (mut all, mut part) = (0, 0);
    while part < PARTS.len() {
        all |= PARTS[part].1;
        part += 1;
    }
    all
};

impl FloatControl {
    /// Reads this thread's control.
    #[inline]
    pub fn now() -> Self {
        Self(arch::read() & ALL)
    }

    /// Sets this thread's control, and returns whether it differed.
    #[inline]
    pub fn restore(self) -> bool {
        let now = arch::read();
        let changed = now & ALL != self.0;
        if changed {
            arch::write(now & !ALL | self.0);
        }
        changed
    }

    /// Names of the parts that differ.
    pub fn differs(self, from: Self) -> Vec<String> {
        Self::parts(self.0 ^ from.0)
    }

    /// Bits that differ; [`parts`](Self::parts) names them.
    #[inline]
    pub fn bits(self, from: Self) -> u64 {
        self.0 ^ from.0
    }

    /// Names of the parts with these bits.
    pub fn parts(bits: u64) -> Vec<String> {
        PARTS.iter().filter(|part| bits & part.1 != 0).map(|part| part.0.to_owned()).collect()
    }
}

/// While this lives, denormal results and operands count as zero on this thread.
#[derive(Debug)]
pub struct Flushed {
    before: FloatControl,
}

impl Flushed {
    /// Starts flushing.
    #[allow(clippy::new_without_default)]
    pub fn new() -> Self {
        let before = FloatControl::now();
        FloatControl(before.0 | arch::FLUSH).restore();
        Self { before }
    }
}

impl Drop for Flushed {
    fn drop(&mut self) {
        self.before.restore();
    }
}

/// MXCSR.
#[cfg(target_arch = "x86_64")]
mod arch {
    use std::arch::asm;

    /// Names and bits of its parts.
    pub(super) const PARTS: [(&str, u64); 4] = [
        ("the rounding mode", 3 << 13),
        ("flush-to-zero", 1 << 15),
        ("denormals-are-zero", 1 << 6),
        ("the traps of floating-point exceptions", 0x3f << 7),
    ];
    pub(super) const FLUSH: u64 = (1 << 15) | (1 << 6);

    pub(super) fn read() -> u64 {
        let mut value = 0_u32;
        // SAFETY: stores MXCSR to a local of its size; SSE is part of x86-64.
        unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut value, options(nostack, preserves_flags)) };
        value.into()
    }

    pub(super) fn write(value: u64) {
        let value = value as u32;
        // SAFETY: `value` came from `read` with bits of its fields changed, so no reserved bit is set.
        // They change how numbers are rounded, and which exceptions are trapped: as a thread had them
        // before.
        unsafe {
            asm!("ldmxcsr [{}]", in(reg) &raw const value, options(nostack, preserves_flags, readonly))
        };
    }
}

/// FPCR.
#[cfg(target_arch = "aarch64")]
mod arch {
    use std::arch::asm;

    /// Names and bits of its parts.
    pub(super) const PARTS: [(&str, u64); 3] = [
        ("the rounding mode", 3 << 22),
        ("flush-to-zero", 1 << 24),
        ("the traps of floating-point exceptions", 0x9f00),
    ];
    pub(super) const FLUSH: u64 = 1 << 24;

    pub(super) fn read() -> u64 {
        let value: u64;
        // SAFETY: reads a register that every level may read.
        unsafe { asm!("mrs {}, fpcr", out(reg) value, options(nomem, nostack, preserves_flags)) };
        value
    }

    pub(super) fn write(value: u64) {
        // SAFETY: writes back what was read, with bits of its fields changed.
        unsafe { asm!("msr fpcr, {}", in(reg) value, options(nomem, nostack, preserves_flags)) };
    }
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
mod arch {
    pub(super) const PARTS: [(&str, u64); 0] = [];
    pub(super) const FLUSH: u64 = 0;

    pub(super) fn read() -> u64 {
        0
    }

    pub(super) fn write(_: u64) {}
}

#[cfg(all(test, any(target_arch = "x86_64", target_arch = "aarch64")))]
mod tests {
    use super::*;
    use std::hint::black_box;

    #[test]
    fn float_control_is_restored_and_named() {
        let before = FloatControl::now();
        assert!(!before.restore());
        let flushed = Flushed::new();
        let names = FloatControl::now().differs(before);
        assert!(
            names.iter().any(|n| n == "flush-to-zero") && names.iter().all(|n| n != "the rounding mode"),
            "{names:?}"
        );
        assert!(before.restore() && FloatControl::now() == before);
        drop(flushed);
        assert_eq!(FloatControl::now(), before);
    }

    #[test]
    fn denormals_are_flushed_inside_and_restored_outside() {
        let tiny = black_box(f32::MIN_POSITIVE);
        {
            let _flushed = Flushed::new();
            assert_eq!(black_box(tiny * black_box(0.5)), 0.0);
        }
        assert!(black_box(tiny * black_box(0.5)) > 0.0);
    }
}
