use asperity_numbers::Elementary as _;
use std::f64::consts::PI;
use std::sync::LazyLock;

/// Values that are summed to one.
pub(super) const TAPS: usize = 16;
/// Values of these before the position.
pub(super) const BEFORE: usize = TAPS / 2 - 1;
/// Positions between two values for which weights are tabulated. Between these, weights are interpolated.
const PHASES: usize = 256;
/// Shape of the Kaiser window.
const BETA: f64 = 11.0;

/// Weights of a windowed sinc that reads between values. Their band ends at half of the highest possible
/// frequency.
#[derive(Clone, Debug)]
pub(super) struct Kernel {
    rows: Vec<[f32; TAPS]>,
}

/// The weights. Making them takes a millisecond; they take 16 KiB.
static KERNEL: LazyLock<Kernel> = LazyLock::new(Kernel::new);

impl Kernel {
    /// The only kernel, shared by all.
    pub(super) fn shared() -> &'static Self {
        &KERNEL
    }

    fn new() -> Self {
        let rows = (0..=PHASES).map(|phase| {
            let part = phase as f64 / PHASES as f64;
            let weight = |tap: usize| {
                let x = tap as f64 - BEFORE as f64 - part;
                let sinc = if x == 0.0 { 1.0 } else { (PI * x).sine() / (PI * x) };
                let edge = x / (TAPS as f64 / 2.0);
                sinc * bessel(BETA * (1.0 - edge * edge).max(0.0).sqrt()) / bessel(BETA)
            };
            let row: [f64; TAPS] = std::array::from_fn(weight);
            let sum: f64 = row.iter().sum();
            row.map(|w| (w / sum) as f32)
        });
        Self { rows: rows.collect() }
    }

    /// The value at a part of the way, 0 to below 1, from `values[BEFORE]` to the next.
    #[inline]
    pub(super) fn read(&self, values: &[f32; TAPS], part: f64) -> f64 {
        let place = part * PHASES as f64;
        let row = (place as usize).min(PHASES - 1);
        let between = (place - row as f64) as f32;
        let Some([low, high]) = self.rows.get(row..row + 2) else { return 0.0 };
        let (mut a, mut b) = (0.0_f32, 0.0_f32);
        for i in 0..TAPS {
            a += values[i] * low[i];
            b += values[i] * high[i];
        }
        f64::from(a + between * (b - a))
    }
}

/// The modified Bessel function of order 0, by its series.
fn bessel(x: f64) -> f64 {
    let quarter = 0.25 * x * x;
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..60 {
        term *= quarter / f64::from(k * k);
        sum += term;
    }
    sum
}
