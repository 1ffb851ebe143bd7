//! The vibration law of one material; formulas and units stand in the module above.

use std::f64::consts::PI;

use asperity_source::Diagnostic;

/// Bins of a magnitude frame: `BIN_HZ`, 2 `BIN_HZ`, .. `BINS` `BIN_HZ`.
pub const BINS: usize = 100;
/// Distance of bins [Hz].
pub const BIN_HZ: f64 = 10.0;
/// Length of the Hann window [s].
pub const WINDOW_S: f64 = 0.1;

/// Speed at which `level` holds [mm/s].
const REFERENCE_MM_S: f64 = 100.0;
/// Corner of the hand's high-pass [Hz].
const HAND_HZ: f64 = 15.0;
/// Cells of the frequency grid on which a bin's expected power is integrated [Hz].
const CELL_HZ: f64 = 2.5;
/// How far from a bin the window's kernel is followed [Hz]; beyond, it is below -90 dB.
const REACH_HZ: f64 = 100.0;
const CELLS_REACH: usize = (REACH_HZ / CELL_HZ) as usize;
const CELLS: usize = ((BINS as f64 * BIN_HZ + REACH_HZ) / CELL_HZ) as usize;

/// One pitch of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Spatial frequency [1/mm].
    pub per_mm: f64,
    /// Half width at half power [1/mm].
    pub half_width_per_mm: f64,
    /// Power relative to the whole floor's.
    pub share: f64,
}

/// What the law of a material is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    /// r.m.s. acceleration over 0..1000 Hz at 100 mm/s and 1 N [m/s^2].
    pub level_m_s2: f64,
    /// Amplitude grows as speed to this power, before what the moving spectrum adds.
    pub speed_exponent: f64,
    /// Amplitude grows as force to this power.
    pub force_exponent: f64,
    /// Corner `q_c` of the floor [1/mm].
    pub floor_corner_per_mm: f64,
    /// Fall `p` of the floor's power above its corner, more than 1.
    pub floor_exponent: f64,
    /// Pitches.
    pub lines: Vec<Line>,
    /// Corner `q_tip` of the tip [1/mm].
    pub tip_per_mm: f64,
    /// Tool resonance on this material [Hz].
    pub resonance_hz: f64,
    /// Damping ratio `z` of the resonance.
    pub resonance_damping: f64,
    /// Gain `g` at the top of the resonance, at least 1.
    pub resonance_gain: f64,
}

/// The vibration law of one material.
#[derive(Clone, Debug)]
pub struct Law {
    parameters: Parameters,
    /// `C level^2`, [(m/s^2)^2].
    scale: f64,
    kernel: [f64; 2 * CELLS_REACH],
}

/// Mean magnitude of a Rayleigh-distributed amplitude whose mean square is `power`: sqrt(pi/4 power).
pub fn expected_amplitude(power: f64) -> f64 {
    (PI / 4.0 * power.max(0.0)).sqrt()
}

impl Law {
    /// A law from its parameters.
    ///
    /// # Errors
    /// A parameter that is not finite or outside its range, by name.
    pub fn new(parameters: Parameters) -> Result<Self, Diagnostic> {
        check(&parameters)?;
        let kernel =
            std::array::from_fn(|j| hann_kernel((j as f64 + 0.5 - CELLS_REACH as f64) * CELL_HZ * WINDOW_S));
        let mut law = Self { parameters, scale: 1.0, kernel };
        let cells = law.cell_powers(REFERENCE_MM_S, 1.0);
        let total: f64 = cells.iter().take((BINS as f64 * BIN_HZ / CELL_HZ) as usize).sum();
        law.scale = law.parameters.level_m_s2.powi(2) / total;
        Ok(law)
    }

    /// The parameters.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// `G(q)`, one-sided, of the roughness at `per_mm` cycles per mm [mm].
    pub fn roughness(&self, per_mm: f64) -> f64 {
        let p = &self.parameters;
        let lines: f64 = p
            .lines
            .iter()
            .map(|l| {
                let w = l.half_width_per_mm;
                let near = w / ((per_mm - l.per_mm).powi(2) + w * w);
                let mirrored = w / ((per_mm + l.per_mm).powi(2) + w * w);
                l.share * (near + mirrored) / PI
            })
            .sum();
        (self.floor(per_mm) + lines) * self.tip(per_mm)
    }

    fn floor(&self, per_mm: f64) -> f64 {
        let p = &self.parameters;
        let norm = p.floor_exponent * (PI / p.floor_exponent).sin() / (PI * p.floor_corner_per_mm);
        norm / (1.0 + (per_mm / p.floor_corner_per_mm).powf(p.floor_exponent))
    }

    fn tip(&self, per_mm: f64) -> f64 {
        1.0 / (1.0 + (per_mm / self.parameters.tip_per_mm).powi(4))
    }

    /// `|H(f)|^2`: hand and tool.
    pub fn transfer_power(&self, hz: f64) -> f64 {
        let p = &self.parameters;
        let hand = (hz / HAND_HZ).powi(4);
        let r = hz / p.resonance_hz;
        let spring = (1.0 - r * r).powi(2);
        let damping = (2.0 * p.resonance_damping * r).powi(2);
        hand / (1.0 + hand) * (spring + p.resonance_gain.powi(2) * damping) / (spring + damping)
    }

    /// Level^2 with its growth, [(m/s^2)^2]; 0 without speed or force.
    pub(super) fn strength(&self, speed_mm_s: f64, force_n: f64) -> f64 {
        if !(speed_mm_s > 0.0 && force_n > 0.0) {
            return 0.0;
        }
        let p = &self.parameters;
        self.scale
            * (speed_mm_s / REFERENCE_MM_S).powf(2.0 * p.speed_exponent)
            * force_n.powf(2.0 * p.force_exponent)
    }

    /// One-sided PSD of acceleration `S(f; v, F)` [(m/s^2)^2/Hz] at a planar speed [mm/s], a normal force [N] and a
    /// frequency [Hz]; 0 where one of them is not positive.
    pub fn psd(&self, speed_mm_s: f64, force_n: f64, hz: f64) -> f64 {
        let strength = self.strength(speed_mm_s, force_n);
        if strength == 0.0 || hz.is_nan() || hz <= 0.0 {
            return 0.0;
        }
        strength * self.roughness(hz / speed_mm_s) / speed_mm_s * self.transfer_power(hz)
    }

    /// Power in each cell of `CELL_HZ`, from 0 Hz. Lines are integrated in closed form, as they may be narrower
    /// than a cell; what else there is, is smooth.
    fn cell_powers(&self, speed_mm_s: f64, force_n: f64) -> [f64; CELLS] {
        let strength = self.strength(speed_mm_s, force_n);
        let mut cells = [0.0; CELLS];
        if strength == 0.0 {
            return cells;
        }
        let dq = CELL_HZ / speed_mm_s;
        for (j, cell) in cells.iter_mut().enumerate() {
            let (low, q) = (j as f64 * dq, (j as f64 + 0.5) * dq);
            let mut power = self.floor(q) * dq;
            for l in &self.parameters.lines {
                let step = |a: f64| {
                    ((low + dq - a) / l.half_width_per_mm).atan() - ((low - a) / l.half_width_per_mm).atan()
                };
                power += l.share * (step(l.per_mm) + step(-l.per_mm)) / PI;
            }
            *cell = strength * power * self.tip(q) * self.transfer_power((j as f64 + 0.5) * CELL_HZ);
        }
        cells
    }

    /// `E[A_k^2]` [(m/s^2)^2] of the bins at constant speed [mm/s] and force [N].
    pub fn expected_power(&self, speed_mm_s: f64, force_n: f64) -> [f64; BINS] {
        let cells = self.cell_powers(speed_mm_s, force_n);
        std::array::from_fn(|bin| {
            let centre = ((bin + 1) as f64 * BIN_HZ / CELL_HZ) as isize;
            let sum: f64 = self
                .kernel
                .iter()
                .enumerate()
                .map(|(j, k)| {
                    let cell = centre - CELLS_REACH as isize + j as isize;
                    // below 0 Hz: the mirrored half of a real signal's spectrum
                    let cell = if cell < 0 { -1 - cell } else { cell } as usize;
                    k * cells.get(cell).copied().unwrap_or(0.0)
                })
                .sum();
            2.0 * sum
        })
    }

    /// `E[A_k]` [m/s^2] of the bins at constant speed [mm/s] and force [N].
    pub fn expected_magnitudes(&self, speed_mm_s: f64, force_n: f64) -> [f64; BINS] {
        self.expected_power(speed_mm_s, force_n).map(expected_amplitude)
    }

    /// `E[A_k]` [m/s^2] of the 0.1 s that follow a history of (speed [mm/s], force [N]), oldest first.
    pub fn expected_after(&self, history: &[(f64, f64)]) -> [f64; BINS] {
        let mut power = [0.0; BINS];
        for (i, &(speed, force)) in history.iter().enumerate() {
            let weight = history_weight(i, history.len());
            for (sum, p) in power.iter_mut().zip(self.expected_power(speed, force)) {
                *sum += weight * p;
            }
        }
        power.map(expected_amplitude)
    }
}

/// Weight of sample `i` of a history of `n`, oldest first; the weights sum to 1.
pub fn history_weight(i: usize, n: usize) -> f64 {
    2.0 * (i + 1) as f64 / (n * (n + 1)) as f64
}

/// |W(x / T) / W(0)|^2 of a Hann window of length `T`.
fn hann_kernel(x: f64) -> f64 {
    let x = x.abs();
    let w = if x < 1e-6 {
        1.0
    } else if (x - 1.0).abs() < 1e-6 {
        0.5
    } else {
        (PI * x).sin() / (PI * x) / (1.0 - x * x)
    };
    w * w
}

fn check(p: &Parameters) -> Result<(), Diagnostic> {
    let ranged = |name: &str, value: f64, low: f64, high: f64| {
        if value.is_finite() && value >= low && value <= high {
            Ok(())
        } else {
            Err(Diagnostic::new(format!("`{name}` is {value}")).help(format!("it lies in {low} to {high}")))
        }
    };
    ranged("level_m_s2", p.level_m_s2, 0.0, 1000.0)?;
    ranged("speed_exponent", p.speed_exponent, 0.0, 4.0)?;
    ranged("force_exponent", p.force_exponent, 0.0, 4.0)?;
    ranged("floor_corner_per_mm", p.floor_corner_per_mm, 1e-3, 100.0)?;
    ranged("floor_exponent", p.floor_exponent, 1.1, 8.0)?;
    ranged("tip_per_mm", p.tip_per_mm, 1e-2, 1000.0)?;
    ranged("resonance_hz", p.resonance_hz, 1.0, 1e4)?;
    ranged("resonance_damping", p.resonance_damping, 1e-2, 10.0)?;
    ranged("resonance_gain", p.resonance_gain, 1.0, 100.0)?;
    for l in &p.lines {
        ranged("per_mm", l.per_mm, 1e-3, 1000.0)?;
        ranged("half_width_per_mm", l.half_width_per_mm, 1e-4, 100.0)?;
        ranged("share", l.share, 0.0, 1e3)?;
    }
    Ok(())
}

/// A law tabulated over speed, for many predictions: linear in `E[A_k^2]` between steps of 0.5 mm/s, exact in
/// force.
#[derive(Clone, Debug)]
pub struct LawTable {
    force_exponent: f64,
    rows: Vec<[f32; BINS]>,
}

/// Distance of a table's rows [mm/s].
const TABLE_STEP_MM_S: f64 = 0.5;

impl LawTable {
    /// Tabulates speeds 0 to `max_mm_s`; faster strokes are answered as `max_mm_s`.
    pub fn new(law: &Law, max_mm_s: f64) -> Self {
        let last = (max_mm_s.clamp(1.0, 1e4) / TABLE_STEP_MM_S).ceil() as usize;
        let row = |i: usize| law.expected_power(i as f64 * TABLE_STEP_MM_S, 1.0).map(|p| p as f32);
        Self { force_exponent: law.parameters.force_exponent, rows: (0..=last).map(row).collect() }
    }

    /// As [`Law::expected_after`], written as f32.
    pub fn expected_after(&self, history: &[(f64, f64)], out: &mut [f32; BINS]) {
        out.fill(0.0);
        for (i, &(speed, force)) in history.iter().enumerate() {
            if !(speed > 0.0 && force > 0.0) {
                continue;
            }
            let at = (speed / TABLE_STEP_MM_S).min((self.rows.len() - 1) as f64);
            let low = (at as usize).min(self.rows.len().saturating_sub(2));
            let part = at - low as f64;
            let weight = history_weight(i, history.len()) * force.powf(2.0 * self.force_exponent);
            let (a, b) = ((weight * (1.0 - part)) as f32, (weight * part) as f32);
            for ((sum, x), y) in out.iter_mut().zip(&self.rows[low]).zip(&self.rows[low + 1]) {
                *sum += a * x + b * y;
            }
        }
        for x in out {
            *x = (std::f32::consts::FRAC_PI_4 * *x).sqrt();
        }
    }
}

#[cfg(test)]
#[path = "law_tests.rs"]
mod tests;
