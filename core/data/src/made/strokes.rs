use std::f64::consts::TAU;

use asperity_diagnostics::Diagnostic;
use asperity_dsp::frame::WINDOW_S;
use asperity_motion::{Shape, Stroke, StrokeParams};
use asperity_numbers::Random;
use asperity_surfaces::stylus::{Moment, SAMPLE_HZ, Stylus, Tool};
use asperity_surfaces::topography::{Contact, HeightField, MadeSurface};

use super::{Example, Settings};
use crate::felt::force_n;
use crate::frames::Spectrometer;
use crate::history::{MAX_FORCE_N, MAX_SPEED_MM_S, RATE_HZ, Recorder, STIFFNESS_N_PER_MM};

/// Ticks of 2 ms between two examples.
const EVERY: usize = 20;
/// Ticks between examples of a hand that goes on: they share no 0.1 s anyway.
const ALONE_EVERY: usize = 40;
/// Simulation samples in a tick.
const SAMPLES: usize = (SAMPLE_HZ as f64 / RATE_HZ) as usize;
/// Samples of a frame.
const FRAME: usize = (SAMPLE_HZ as f64 * WINDOW_S) as usize;
/// Slowest mean speed of a stroke in mm/s.
const SLOWEST_MM_S: f64 = 8.0;
/// Speeds of strokes within the range in mm/s.
const USUAL_MM_S: [f64; 2] = [SLOWEST_MM_S, 0.97 * MAX_SPEED_MM_S];
/// Peak speed of a minimum-jerk movement over its mean.
const PEAK: f64 = 1.875;
/// Mean forces of strokes [N].
const FORCES_N: [f64; 2] = [0.1, 2.2];
/// Largest tremor of a stroke in mm.
const TREMOR_MM: f64 = 0.08;
/// Largest swing of a stroke's force, as a part of its mean.
const SWING: f64 = 0.55;
/// Largest mean force of a stroke [beyond](Drawn::beyond) the range, over the range's largest.
const HARDER: f64 = 1.2;
/// Fastest strokes beyond the range [mm/s], plus tremor.
pub const BEYOND_SPEED_MM_S: f64 = 1.5 * MAX_SPEED_MM_S;
/// Largest force of strokes beyond the range [N], plus tremor.
pub const BEYOND_FORCE_N: f64 = HARDER * MAX_FORCE_N * (1.0 + SWING);

/// A stroke of some kind, speed, force and direction: the sensor's readings and the hand's motion.
pub struct Drawn {
    measured: Stroke,
    /// Without the sensor's step.
    pub(super) exact: Stroke,
    /// Sine and cosine of its direction.
    turn: (f64, f64),
}

impl Drawn {
    /// Draws one of `duration_s` seconds, with a hand's tremor unless it is a circle.
    ///
    /// # Errors
    /// A duration outside a [stroke's](StrokeParams) range.
    pub fn new(duration_s: f64, random: &mut Random) -> Result<Self, Diagnostic> {
        Self::within(USUAL_MM_S, FORCES_N, TREMOR_MM, duration_s, random)
    }

    /// Draws one without tremor.
    ///
    /// The last 20 ms do not tell what a tremor adds in the next 0.1 s. A network that never met tremor
    /// follows it as it comes. One that did answers the average effect of tremor at a speed.
    fn smooth(duration_s: f64, random: &mut Random) -> Result<Self, Diagnostic> {
        Self::within(USUAL_MM_S, FORCES_N, 0.0, duration_s, random)
    }

    /// Draws one beyond the range by half: above 300 mm/s, 3.5 N or both.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn beyond(duration_s: f64, random: &mut Random) -> Result<Self, Diagnostic> {
        let fast = random.chance(0.67);
        let strong = !fast || random.chance(0.5);
        let speed_mm_s = if fast { [150.0, BEYOND_SPEED_MM_S] } else { [SLOWEST_MM_S, MAX_SPEED_MM_S] };
        let force_n = if strong { [MAX_FORCE_N, HARDER * MAX_FORCE_N] } else { FORCES_N };
        Self::within(speed_mm_s, force_n, TREMOR_MM, duration_s, random)
    }

    fn within(
        [slowest, fastest]: [f64; 2],
        force_n: [f64; 2],
        tremor_mm: f64,
        duration_s: f64,
        random: &mut Random,
    ) -> Result<Self, Diagnostic> {
        // Half are circles: a steady hand is a case of its own.
        let shape = [Shape::Line, Shape::Zigzag, Shape::Circle, Shape::Circle][random.below(4)];
        let steady = shape == Shape::Circle;
        let fastest = fastest / if steady { 1.0 } else { PEAK };
        // Others also slow down, so most of them are fast.
        let part = if steady { random.unit() } else { random.unit().sqrt() };
        let params = StrokeParams {
            shape,
            extent_mm: random.range(20.0, 120.0),
            mean_speed_mm_s: slowest * (fastest / slowest).powf(part),
            force_n: random.range(force_n[0], force_n[1]),
            force_swing: random.range(0.1, SWING),
            force_swing_hz: random.range(0.2, 1.2),
            stiffness_n_per_mm: STIFFNESS_N_PER_MM,
            clearance_mm: 3.0,
            approach_s: 0.2,
            duration_s,
            tremor_mm: if steady { 0.0 } else { random.range(0.0, tremor_mm) },
            seed: random.bits(),
            ..StrokeParams::default()
        };
        let exact = Stroke::new(StrokeParams { quantum_mm: 0.0, ..params.clone() })?;
        Ok(Self { measured: Stroke::new(params)?, exact, turn: (TAU * random.unit()).sin_cos() })
    }

    /// Place and height in mm of the hand at a sample of the simulation.
    pub(super) fn hand(&self, sample: usize) -> ([f64; 2], f64) {
        self.at(&self.exact, sample as f64 / f64::from(SAMPLE_HZ))
    }

    /// Place of the sensor or the hand: along the surface, and over it, in mm.
    pub(super) fn at(&self, stroke: &Stroke, t: f64) -> ([f64; 2], f64) {
        let ([x, y, z], (sin, cos)) = (stroke.sample(t).position, self.turn);
        ([x * cos - y * sin, x * sin + y * cos], z)
    }
}

/// Acceleration in m/s^2 along the normal and the surface, at [`SAMPLE_HZ`], of a pen on its
/// [track](Tool::track) over a piece, for a stroke that begins at a place in mm. `at` gives place and height
/// in mm at each sample from 0 to `samples`.
pub(super) fn along(
    envelope: &HeightField,
    contact: Contact,
    samples: usize,
    at: impl Fn(usize) -> ([f64; 2], f64),
    place_mm: [f64; 2],
) -> [Vec<f64>; 3] {
    let (mut before, _) = at(0);
    let mut stylus = Stylus::new(Tool::PEN, envelope, contact, place_mm, 0.0);
    let mut felt = [0; 3].map(|_| Vec::with_capacity(samples));
    for sample in 0..samples {
        let (here, z) = at(sample + 1);
        let velocity_mm_s = std::array::from_fn(|i| (here[i] - before[i]) * f64::from(SAMPLE_HZ));
        before = here;
        let axes = moved(&mut stylus, velocity_mm_s, force_n(z));
        felt.iter_mut().zip(axes).for_each(|(felt, a)| felt.push(a));
    }
    felt
}

/// Acceleration felt during a sample; none in the air.
fn moved(stylus: &mut Stylus<'_>, velocity_mm_s: [f64; 2], force_n: f64) -> [f64; 3] {
    let touches = f64::from(u8::from(force_n > 0.0));
    stylus.next(&Moment { velocity_mm_s, force_n }).axes().map(|a| touches * a)
}

/// An example every 80 ms of a stroke that begins at a place in mm. Its magnitudes are those of the
/// next 0.1 s if the hand goes on as it does there.
///
/// The last 20 ms do not tell how a hand will turn. A network trained on real continuations answers a
/// mean over all turns. Where a spectrum is steep and level grows with speed, that is 2 to 5 dB too
/// loud for a hand that goes on.
fn going_on(
    envelope: &HeightField,
    contact: Contact,
    drawn: &Drawn,
    place_mm: [f64; 2],
    spectrometer: &mut Spectrometer,
) -> Vec<Example> {
    let moment = |sample: usize| {
        let ((before, _), (here, z)) = (drawn.hand(sample), drawn.hand(sample + 1));
        (std::array::from_fn(|i| (here[i] - before[i]) * f64::from(SAMPLE_HZ)), force_n(z))
    };
    let mut recorder = Recorder::default();
    let mut stylus = Stylus::new(Tool::PEN, envelope, contact, place_mm, 0.0);
    let mut examples = Vec::new();
    for tick in 0..(drawn.exact.duration_s() * RATE_HZ) as usize {
        let (place, z) = drawn.at(&drawn.measured, tick as f64 / RATE_HZ);
        let history = recorder.observe(place, force_n(z));
        if tick % ALONE_EVERY == 0 {
            let (velocity, force) = moment(tick * SAMPLES);
            let mut ahead = stylus.clone();
            let mut felt = [0; 3].map(|_| Vec::with_capacity(FRAME));
            for _ in 0..FRAME {
                let axes = moved(&mut ahead, velocity, force);
                felt.iter_mut().zip(axes).for_each(|(felt, a)| felt.push(a));
            }
            examples.push(history.example(spectrometer.magnitudes(&felt.each_ref().map(Vec::as_slice))));
        }
        for sample in tick * SAMPLES..(tick + 1) * SAMPLES {
            let (velocity, force) = moment(sample);
            moved(&mut stylus, velocity, force);
        }
    }
    examples
}

/// An example every 40 ms of a stroke, as long as 0.1 s follow, with those 0.1 s.
pub(super) fn examples(drawn: &Drawn, felt: &[Vec<f64>; 3], spectrometer: &mut Spectrometer) -> Vec<Example> {
    let mut examples = Vec::new();
    let mut recorder = Recorder::default();
    for tick in 0..felt[0].len() / SAMPLES {
        let (place, z) = drawn.at(&drawn.measured, tick as f64 / RATE_HZ);
        let history = recorder.observe(place, force_n(z));
        let frame = tick * SAMPLES..tick * SAMPLES + FRAME;
        let axes = felt.each_ref().map(|axis| axis.get(frame.clone()));
        if let ([Some(a), Some(b), Some(c)], 0) = (axes, tick % EVERY) {
            examples.push(history.example(spectrometer.magnitudes(&[a, b, c])));
        }
    }
    examples
}

/// Adds the examples of as many strokes over a piece as the settings say.
pub(super) fn add(
    surface: &MadeSurface,
    piece: &HeightField,
    settings: &Settings,
    random: &mut Random,
    all: &mut Vec<Example>,
) -> Result<(), Diagnostic> {
    let envelope = Tool::PEN.track(piece, &surface.contact);
    let mut spectrometer = Spectrometer::new(f64::from(SAMPLE_HZ));
    for _ in 0..settings.strokes {
        let drawn = Drawn::smooth(settings.stroke_s, random)?;
        let length = piece.length_mm();
        let mut at_a_place = || {
            let place = [random.range(0.0, length), random.range(0.0, length)];
            going_on(&envelope, surface.contact, &drawn, place, &mut spectrometer)
        };
        let (here, there) = (at_a_place(), at_a_place());
        all.extend(
            here.into_iter().zip(there).map(|(e, other)| Example { other: Some(other.magnitudes), ..e }),
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest force in N and speed in mm/s of many strokes, as the hand makes them.
    fn reach(draw: impl Fn(&mut Random) -> Result<Drawn, Diagnostic>) -> (f64, f64) {
        let random = &mut Random::new(9);
        let (mut most, mut fastest) = (0.0, 0.0);
        for _ in 0..300 {
            let drawn = draw(random).unwrap();
            let at = |tick: usize| drawn.at(&drawn.exact, tick as f64 / RATE_HZ);
            for tick in 1..1500 {
                let ((before, _), (here, z)) = (at(tick - 1), at(tick));
                most = f64::max(most, force_n(z));
                let way = (here[0] - before[0]).hypot(here[1] - before[1]);
                fastest = f64::max(fastest, way * RATE_HZ);
            }
        }
        (most, fastest)
    }

    #[test]
    fn strokes_fill_the_range_and_exceed_it_only_as_asked() {
        // At the turns of a zigzag both directions are fast at once, and tremor adds.
        let near = |found: f64, most: f64, above: f64| (0.9..=above).contains(&(found / most));
        let (force_n, speed_mm_s) = reach(|random| Drawn::new(3.0, random));
        let (force, speed) = (near(force_n, MAX_FORCE_N, 1.01), near(speed_mm_s, MAX_SPEED_MM_S, 1.2));
        assert!(force && speed, "{force_n} {speed_mm_s}");
        let (force_n, speed_mm_s) = reach(|random| Drawn::beyond(3.0, random));
        let (force, speed) = (near(force_n, BEYOND_FORCE_N, 1.02), near(speed_mm_s, BEYOND_SPEED_MM_S, 1.25));
        assert!(force && speed, "{force_n} {speed_mm_s}");
    }
}
