//! `tap`: the transient of a contact.

mod transient;

use crate::prelude::*;
use asperity_diagnostics::ron::Value;

use super::{Renders, Samples, TRIED_HZ, acceleration, files, made, one_each, pick, samples, slot};
pub(crate) use transient::{DecayingSinusoid, Recording, Sound, TapSettings, Taps, Transient};

const SLOT: usize = 0;
const APPROACH: usize = 1;
const MOMENT: usize = 2;
/// Vibration of coming into contact: a transient for each contact, scaled by the speed of approach.
///
/// Taps of each slot ring out whatever is touched next.
pub struct Tap {
    taps: Taps,
    rate_hz: u32,
    contacts: u64,
    count: u64,
}

/// Time of a moment within a tick: a sample, and the part of this sample that has passed.
fn sample(tick: u64, moment: f64, rate_hz: u32, tick_hz: u32) -> (u64, f64) {
    let place = u128::from(tick) * u128::from(rate_hz);
    let (whole, rest) = (place / u128::from(tick_hz), place % u128::from(tick_hz));
    let moment = if moment.is_finite() { moment.clamp(0.0, 1.0) } else { 0.0 };
    let further = (rest as f64 + moment * f64::from(rate_hz)) / f64::from(tick_hz);
    (u64::try_from(whole).unwrap_or(u64::MAX).saturating_add(further as u64), further.fract())
}

/// Largest value of a recording.
const MOST_M_S2: f32 = 1e6;

fn effect() -> Effect {
    let usual = TapSettings::default();
    let speed = |name, usual, range, doc| number(name, usual, range, "mm/s").doc(doc);
    Effect::new("taps", Acts::Touching)
        .form(
            Form::new("", "(sinusoids: [(frequency_hz: 200, decay_ms: 10, gain: 30)])")
                .nested("sinusoids")
                .nested("recording")
                .field(speed(
                    "min_speed_mm_s",
                    usual.min_speed_mm_s,
                    0.0..=1000.0,
                    "contacts below this approach speed are silent",
                ))
                .field(speed(
                    "max_speed_mm_s",
                    usual.max_speed_mm_s,
                    1.0..=10_000.0,
                    "approach speed above which a tap becomes no louder",
                ))
                .field(number("debounce_ms", usual.debounce_ms, 2.0..=1000.0, "ms"))
                .doc("shortest time between two taps")
                .field(
                    number("floor_m_s2", usual.floor_m_s2, 1e-6..=1.0, "m/s^2")
                        .doc("amplitude below which a tap ends"),
                ),
        )
        .needs("approach", "approach")
        .needs("moment", "moment")
        .check(|settings| sound(settings, TRIED_HZ, false).map(drop))
}

/// Conditions under which a tap sounds.
fn of(settings: &Settings) -> Result<TapSettings, Diagnostic> {
    let [min_speed_mm_s, max_speed_mm_s, debounce_ms, floor_m_s2] =
        ["min_speed_mm_s", "max_speed_mm_s", "debounce_ms", "floor_m_s2"].map(|name| settings.number(name));
    if min_speed_mm_s > max_speed_mm_s {
        return Err(settings.node_error(format!(
            "`min_speed_mm_s` ({min_speed_mm_s}) must not be larger than `max_speed_mm_s` ({max_speed_mm_s})"
        )));
    }
    Ok(TapSettings { min_speed_mm_s, max_speed_mm_s, debounce_ms, floor_m_s2 })
}

fn sinusoid(item: &Value) -> Result<DecayingSinusoid, Diagnostic> {
    let mut one = item.record("sinusoid")?;
    let sinusoid = DecayingSinusoid {
        frequency_hz: one.required("frequency_hz")?.f64_in(1.0..=20_000.0, "Hz")?,
        decay_ms: one.required("decay_ms")?.f64_in(0.1..=1e5, "ms")?,
        gain: one.required("gain")?.f64_in(-1e5..=1e5, "(m/s^2)/(m/s)")?,
    };
    one.finish()?;
    Ok(sinusoid)
}

/// The transient of a slot. A recording is read from its file; `None` where files are not to be opened.
fn transient(settings: &Settings, opens: bool) -> Result<Option<Transient>, Diagnostic> {
    let example = "[(frequency_hz: 200, decay_ms: 10, gain: 30)]";
    match samples(settings, ("a tap", "sinusoids", example), (1e4, true))? {
        Samples::Listed(all) => {
            let sinusoids = all.iter().map(sinusoid).collect::<Result<_, _>>()?;
            Ok(Some(Transient::Sinusoids(sinusoids)))
        }
        Samples::Recorded(_) if !opens => Ok(None),
        Samples::Recorded(recorded) => {
            let (rate_hz, samples) = recorded.read()?;
            let samples: Vec<f32> = samples.into_iter().map(|x| x as f32).collect();
            if let Some(x) = samples.iter().find(|x| !x.is_finite() || x.abs() > MOST_M_S2) {
                return Err(Diagnostic::new(format!("a tap of {x:e} m/s^2 is out of range"))
                    .in_file(&recorded.file)
                    .help(format!("up to {MOST_M_S2:e} m/s^2")));
            }
            let speed_mm_s = recorded.speed_mm_s;
            Ok(Some(Transient::Recorded(Recording { samples, rate_hz, speed_mm_s })))
        }
    }
}

/// The sound of a slot at an audio rate; `None` as for [`transient`].
fn sound(settings: &Settings, rate_hz: u32, opens: bool) -> Result<Option<Sound>, Diagnostic> {
    let of = of(settings)?;
    let sound = transient(settings, opens)?.map(|transient| Sound::new(&transient, of, rate_hz));
    made(settings, sound.transpose())
}

impl Node for Tap {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "tap",
            "Renders the transient of each contact, scaled by approach speed: decaying sinusoids or a \
             recording.",
        )
        .input(slot("index into `taps`, from 0; below 0: silent"))
        .input(control("approach", 1, MM_S).wakes())
        .doc("approach speed in the tick in which contact begins, else 0")
        .input(control("moment", 1, ONE).or(0.0).doc("time of the contact within its tick, 0 to 1"))
        .output(acceleration().doc("transients"))
        .renders(effect())
        .timing("latency of one tick; sleeps while silent")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let rate_hz = setup.audio_hz;
        let sounds = one_each(setup, |settings| {
            sound(settings, rate_hz, true)?.ok_or_else(|| settings.node_error("a tap without a sound"))
        })?;
        let longest = sounds.iter().map(Sound::longest).max().unwrap_or(0);
        let tail = Latency::samples(i64::try_from(longest).unwrap_or(i64::MAX), rate_hz);
        let it = Self { taps: Taps::new(sounds, rate_hz), rate_hz, contacts: 0, count: 0 };
        let latency = Latency::ratio(1, i64::from(setup.tick_hz));
        Ok(Prepared::new(it).latency(latency).tail(tail).files(files(setup)))
    }
}

impl Processor for Tap {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let approach = if tick.inputs.valid(APPROACH) { tick.inputs.value(APPROACH) } else { 0.0 };
        let came = approach > 0.0;
        if came && let Some(slot) = pick(tick.inputs.value(SLOT), self.taps.sounds.len()) {
            self.contacts += 1;
            let (at, part) = sample(tick.index, tick.inputs.value(MOMENT), self.rate_hz, tick.tick_hz);
            self.count += u64::from(self.taps.strike(slot, at, part, approach));
        }
        if self.taps.sounds() {
            self.taps.process(tick.samples(self.rate_hz).start, tick.outputs.audio(0));
            return Status::Continue;
        }
        // Another contact of the very same speed would not be a change that wakes.
        if came { Status::Quiet } else { Status::Asleep }
    }

    fn reset(&mut self) {
        self.taps.reset();
    }

    /// Taps that sound, and recent strikes.
    fn state(&mut self, state: &mut State<'_>) {
        self.taps.state(state);
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![
            Fact::count("slots", self.taps.sounds.len() as u64),
            Fact::count("contacts", self.contacts),
            Fact::count("taps", self.count),
            Fact::count("cut_short", self.taps.cut_short),
        ]
    }
}
