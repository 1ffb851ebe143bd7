//! Instruction sets of the kernels.

use std::sync::atomic::{AtomicU8, Ordering};

/// Instruction set. Kernels give the same bits on each of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Isa {
    /// x86-64 with AVX-512F and VL: 16 lanes of f32.
    Avx512,
    /// x86-64 with AVX2, FMA and F16C: 8 lanes.
    Avx2,
    /// Plain code: the compiler uses SSE2 on x86-64 and NEON on AArch64.
    Portable,
}

/// Index in [`Isa::ALL`] of the best allowed one.
static LIMIT: AtomicU8 = AtomicU8::new(0);

impl Isa {
    /// All instruction sets, best first.
    pub const ALL: [Isa; 3] = [Isa::Avx512, Isa::Avx2, Isa::Portable];

    /// Allowed instruction sets that this CPU has, best first.
    pub fn available() -> impl Iterator<Item = Isa> {
        Self::ALL
            .into_iter()
            .skip(usize::from(LIMIT.load(Ordering::Relaxed)))
            .filter(|isa| isa.is_available())
    }

    /// Best available instruction set.
    pub fn best() -> Isa {
        Self::available().next().unwrap_or(Isa::Portable)
    }

    /// Forbids better instruction sets to all kernels made in this process from now on.
    pub fn limit(most: Isa) {
        LIMIT.store(most as u8, Ordering::Relaxed);
    }

    /// Whether this CPU has it.
    pub fn is_available(self) -> bool {
        match self {
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512 => is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl"),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 => {
                is_x86_feature_detected!("avx2")
                    && is_x86_feature_detected!("fma")
                    && is_x86_feature_detected!("f16c")
            }
            #[cfg(not(target_arch = "x86_64"))]
            Isa::Avx512 | Isa::Avx2 => false,
            Isa::Portable => true,
        }
    }

    /// Name in reports.
    pub fn name(self) -> &'static str {
        ["avx512", "avx2", "portable"][self as usize]
    }
}
