//! Instruction sets that kernels are compiled for, and which of them may be used.

use std::sync::atomic::{AtomicU8, Ordering};

/// An instruction set. Kernels give the same bits on each of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Isa {
    /// x86-64 with AVX-512F and VL: 16 lanes of f32.
    Avx512,
    /// x86-64 with AVX2, FMA and F16C: 8 lanes.
    Avx2,
    /// What the compiler makes of plain code: SSE2 on x86-64, NEON on AArch64.
    Portable,
}

/// The best that may be used.
static LIMIT: AtomicU8 = AtomicU8::new(0);

impl Isa {
    /// All, best first.
    pub const ALL: [Isa; 3] = [Isa::Avx512, Isa::Avx2, Isa::Portable];

    /// Those that this CPU has and that may be used, best first.
    pub fn available() -> impl Iterator<Item = Isa> {
        Self::ALL
            .into_iter()
            .skip(usize::from(LIMIT.load(Ordering::Relaxed)))
            .filter(|isa| isa.is_available())
    }

    /// The best of those.
    pub fn best() -> Isa {
        Self::available().next().unwrap_or(Isa::Portable)
    }

    /// From here on no kernel that is made in this process uses a better one.
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

    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Isa::Avx512 => "avx512",
            Isa::Avx2 => "avx2",
            Isa::Portable => "portable",
        }
    }
}
