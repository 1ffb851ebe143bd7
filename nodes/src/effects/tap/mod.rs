//! `tap`: the transient of a contact.

mod transient;

use std::path::PathBuf;

use asperity_data::wav::Wav;
use asperity_diagnostics::ron::Value;
use asperity_node::{
    Acts, Descriptor, Diagnostic, Effect, Fact, Form, Input, Latency, Node, Param, Prepared, Processor,
    Settings, Setup, ShapeSpec, State, Status, Tick, Unit,
};

use super::mix::Mix;
use super::{TRIED_HZ, acceleration, files, made, one_each, pick, slot};
pub use transient::{DecayingSinusoid, Recording, TapSettings, Taps, Transient};

const SLOT: usize = 0;
const APPROACH: usize = 1;
const MOMENT: usize = 2;
/// Slots that sound at a time at full level.
const MOST: usize = 6;
/// Slots that are remembered: those that sound, those that fade, and others that were struck recently.
const ROOM: usize = 12;
/// Time without a sound after which a slot counts as never struck \[s\]. No tap holds the next off for
/// longer.
const FORGOTTEN_S: u64 = 1;

/// Vibration of coming into contact: a transient for each contact, scaled by the speed of approach.
///
/// Each slot has its taps, which ring out whatever is touched next. At most six slots sound at a time. At a
/// seventh, the one that was struck first fades out in a millisecond.
pub struct Tap {
    kernels: Vec<Taps>,
    /// Stands in the state for kernels that are not there.
    spare: Option<Taps>,
    struck: [Option<Struck>; ROOM],
    mix: Mix,
    rate_hz: u32,
    counts: [u64; 2],
}

/// A slot that was struck recently.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Struck {
    slot: usize,
    /// Sample of the strike.
    at: u64,
    /// Whether it fades.
    released: bool,
}

/// Time of a moment within a tick: a sample, and the part of this sample that has passed.
fn sample(tick: u64, moment: f64, rate_hz: u32, tick_hz: u32) -> (u64, f64) {
    let place = u128::from(tick) * u128::from(rate_hz);
    let (whole, rest) = (place / u128::from(tick_hz), place % u128::from(tick_hz));
    let moment = if moment.is_finite() { moment.clamp(0.0, 1.0) } else { 0.0 };
    let further = (rest as f64 + moment * f64::from(rate_hz)) / f64::from(tick_hz);
    (u64::try_from(whole).unwrap_or(u64::MAX).saturating_add(further as u64), further.fract())
}

impl Tap {
    /// Strikes a slot if there is room.
    fn strike(&mut self, slot: usize, (sample, part): (u64, f64), speed_mm_s: f64) {
        let forgotten = FORGOTTEN_S * u64::from(self.rate_hz);
        let Self { kernels, struck, .. } = self;
        for entry in struck.iter_mut() {
            *entry = entry.filter(|s| {
                let sounds = kernels.get(s.slot).is_some_and(Taps::sounds);
                sounds || sample.saturating_sub(s.at) <= forgotten
            });
        }
        let known = struck.iter().position(|s| s.is_some_and(|s| s.slot == slot));
        let place = known.or_else(|| struck.iter().position(Option::is_none)).or_else(|| {
            // A slot that is silent, but not forgotten yet.
            let silent = |s: &Struck| kernels.get(s.slot).is_none_or(|k| !k.sounds());
            let all = struck.iter().enumerate().filter_map(|(i, s)| Some((i, s.filter(silent)?)));
            all.min_by_key(|(_, s)| s.at).map(|(i, _)| i)
        });
        let (Some(place), Some(kernel)) = (place, kernels.get_mut(slot)) else { return };
        if known.is_none() {
            // As if it had never been struck.
            kernel.reset();
        }
        if !kernel.strike(sample, part, speed_mm_s) {
            return;
        }
        self.counts[0] += 1;
        struck[place] = Some(Struck { slot, at: sample, released: false });
        let full = |s: &&mut Struck| !s.released && kernels.get(s.slot).is_some_and(Taps::sounds);
        if struck.iter_mut().flatten().filter(full).count() > MOST
            && let Some(first) = struck.iter_mut().flatten().filter(full).min_by_key(|s| s.at)
        {
            first.released = true;
            let slot = first.slot;
            self.counts[1] += 1;
            kernels.get_mut(slot).into_iter().for_each(Taps::release);
        }
    }
}

/// Longest recording of a tap in samples: a minute and a half at 48 kHz.
const MAX_RECORDED: u32 = 1 << 22;
/// Largest value of a recording.
const MOST_M_S2: f32 = 1e6;

fn effect() -> Effect {
    let usual = TapSettings::default();
    let speed = |name, usual, range, doc| Param::number(name, usual, range, doc).unit("mm/s");
    Effect::new("taps", Acts::Touching)
        .form(
            Form::new("", "(sinusoids: [(frequency_hz: 200, decay_ms: 10, gain: 30)])")
                .nested("sinusoids")
                .nested("recording")
                .field(speed("min_speed_mm_s", usual.min_speed_mm_s, 0.0..=1000.0, "slower is silent"))
                .field(speed("max_speed_mm_s", usual.max_speed_mm_s, 1.0..=10_000.0, "loudest from here on"))
                .field(
                    Param::number("debounce_ms", usual.debounce_ms, 2.0..=1000.0, "from one tap to the next")
                        .unit("ms"),
                )
                .field(
                    Param::number("floor_m_s2", usual.floor_m_s2, 1e-6..=1.0, "quieter is over")
                        .unit("m/s^2"),
                ),
        )
        .needs("approach", "approach")
        .needs("moment", "moment")
        .check(|settings| match sound(settings)? {
            Sound::Sinusoids(all) => {
                let taps = Taps::new(&Transient::Sinusoids(all), of(settings), TRIED_HZ);
                made(settings, taps).map(drop)
            }
            Sound::Recorded { .. } => Ok(()),
        })
}

/// Conditions under which a tap sounds.
fn of(settings: &Settings) -> TapSettings {
    TapSettings {
        min_speed_mm_s: settings.number("min_speed_mm_s"),
        max_speed_mm_s: settings.number("max_speed_mm_s"),
        debounce_ms: settings.number("debounce_ms"),
        floor_m_s2: settings.number("floor_m_s2"),
    }
}

/// Sinusoids, or a recording whose file is not read yet.
enum Sound {
    Sinusoids(Vec<DecayingSinusoid>),
    Recorded { file: PathBuf, speed_mm_s: f64, full_scale_m_s2: f64, gain: f64 },
}

fn sound(settings: &Settings) -> Result<Sound, Diagnostic> {
    let TapSettings { min_speed_mm_s: least, max_speed_mm_s: most, .. } = of(settings);
    if least > most {
        let message = format!("`min_speed_mm_s` ({least}) must not be larger than `max_speed_mm_s` ({most})");
        return Err(settings.node_error(message));
    }
    match (settings.nested("sinusoids"), settings.nested("recording")) {
        (Some(list), None) => {
            list.list()?.iter().map(sinusoid).collect::<Result<_, _>>().map(Sound::Sinusoids)
        }
        (None, Some(value)) => recording(value),
        (Some(_), Some(second)) => {
            Err(second.error("a tap has both `sinusoids` and a `recording`").help("leave one of the two out"))
        }
        (None, None) => Err(settings.node_error("a tap needs `sinusoids` or a `recording`").help(
            "sinusoids: [(frequency_hz: 200, decay_ms: 10, gain: 30)], or recording: (file: \"tap.wav\", \
             speed_mm_s: 100, full_scale_m_s2: 50)",
        )),
    }
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

fn recording(value: &Value) -> Result<Sound, Diagnostic> {
    let mut record = value.record("recording")?;
    let file = record.required("file")?.path()?;
    let speed_mm_s = record.required("speed_mm_s")?.f64_in(0.1..=1e4, "mm/s")?;
    let full_scale_m_s2 = record.required("full_scale_m_s2")?.f64_in(1e-3..=1e5, "m/s^2")?;
    let gain = record.optional("gain").map_or(Ok(1.0), |gain| gain.f64_in(0.0..=100.0, ""))?;
    record.finish()?;
    Ok(Sound::Recorded { file, speed_mm_s, full_scale_m_s2, gain })
}

/// The transient of a slot. A recording is read from its file: of several channels the first.
fn transient(settings: &Settings) -> Result<Transient, Diagnostic> {
    match sound(settings)? {
        Sound::Sinusoids(sinusoids) => Ok(Transient::Sinusoids(sinusoids)),
        Sound::Recorded { file, speed_mm_s, full_scale_m_s2, gain } => {
            let wav = Wav::read(&file, MAX_RECORDED)?;
            let samples: Vec<f32> = wav.channel(0).map(|x| (gain * full_scale_m_s2 * x) as f32).collect();
            if let Some(x) = samples.iter().find(|x| !x.is_finite() || x.abs() > MOST_M_S2) {
                return Err(Diagnostic::new(format!("a tap of {x:e} m/s^2 is out of range"))
                    .in_file(&file)
                    .help(format!("up to {MOST_M_S2:e} m/s^2")));
            }
            let rate_hz = f64::from(wav.rate_hz);
            Ok(Transient::Recorded(Recording { samples, rate_hz, speed_mm_s }))
        }
    }
}

impl Node for Tap {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "tap",
            "The transient of each contact, scaled by the speed of approach: decaying sinusoids, or \
             recorded.",
        )
        .input(slot("which of `taps` is struck, from 0; below 0 none"))
        .input(
            Input::new("approach", ShapeSpec::Control(1), Unit::MILLIMETRE_PER_SECOND)
                .wakes()
                .doc("speed of approach in the tick of a contact, 0 in others"),
        )
        .input(
            Input::new("moment", ShapeSpec::Control(1), Unit::NONE)
                .or(0.0)
                .doc("the part of the tick at which the contact was, 0 to 1"),
        )
        .output(acceleration().doc("the transients"))
        .param(Param::texts(
            "taps",
            "Taps, each a text as behind `tap` in a scene. Quotes within a text are written r#\"..\"#.",
        ))
        .effect(effect())
        .timing(
            "one tick: a contact sounds as late in the tick after it was as it was in its own; not called \
             while nothing sounds",
        )
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let rate_hz = setup.audio_hz;
        let kernels = one_each(setup, |settings| {
            made(settings, Taps::new(&transient(settings)?, of(settings), rate_hz))
        })?;
        let longest = kernels.iter().map(Taps::longest).max().unwrap_or(0);
        let tail = Latency::samples(i64::try_from(longest).unwrap_or(i64::MAX), rate_hz);
        let it = Self {
            spare: kernels.first().cloned(),
            struck: [None; ROOM],
            mix: Mix::new(setup),
            rate_hz,
            kernels,
            counts: [0; 2],
        };
        let latency = Latency::ratio(1, i64::from(setup.tick_hz));
        Ok(Prepared::new(it).latency(latency).tail(tail).files(files(setup)))
    }
}

impl Processor for Tap {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let approach = if tick.inputs.valid(APPROACH) { tick.inputs.value(APPROACH) } else { 0.0 };
        let came = approach > 0.0;
        if came && let Some(slot) = pick(tick.inputs.value(SLOT), self.kernels.len()) {
            let place = sample(tick.index, tick.inputs.value(MOMENT), self.rate_hz, tick.tick_hz);
            self.strike(slot, place, approach);
        }
        let span = tick.samples(self.rate_hz);
        let Self { kernels, struck, mix, .. } = self;
        let mut any = false;
        for s in struck.iter().flatten() {
            let Some(kernel) = kernels.get_mut(s.slot).filter(|k| k.sounds()) else { continue };
            if !any {
                mix.begin((span.end - span.start) as usize);
            }
            any = true;
            mix.add(1.0, |part| _ = kernel.process(span.start, part));
        }
        if any {
            mix.write(tick.outputs.audio(0));
        }
        match (any, came) {
            (true, _) => Status::Continue,
            // Another contact of the very same speed would not be a change that wakes.
            (false, true) => Status::Quiet,
            (false, false) => Status::Asleep,
        }
    }

    fn reset(&mut self) {
        for s in self.struck.iter_mut().filter_map(Option::take) {
            self.kernels.get_mut(s.slot).into_iter().for_each(Taps::reset);
        }
    }

    /// Taps that sound, and recent strikes. A slot that is no longer there falls silent.
    fn state(&mut self, state: &mut State<'_>) {
        if state.restores() {
            self.reset();
        }
        for entry in &mut self.struck {
            let mut there = entry.is_some();
            let mut s = entry.unwrap_or_default();
            state.keep(&mut there).keep(&mut s.slot).keep(&mut s.at).keep(&mut s.released);
            *entry = there.then_some(s);
        }
        let Self { kernels, spare, struck, .. } = self;
        let Some(spare) = spare else { return };
        for i in 0..ROOM {
            let slot = struck[i].map(|s| s.slot);
            let again = struck[..i].iter().flatten().any(|s| Some(s.slot) == slot);
            state.require(!again || slot.is_none());
            match slot.and_then(|slot| kernels.get_mut(slot)).filter(|_| !again) {
                Some(kernel) => kernel.state(state),
                None => {
                    spare.state(state);
                    spare.reset();
                    struck[i] = None;
                }
            }
        }
        if state.restores() && state.failed() {
            self.reset();
        }
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![
            Fact::count("slots", self.kernels.len() as u64),
            Fact::count("taps", self.counts[0]),
            Fact::count("cut_short", self.counts[1]),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_diagnostics::{Source, ron};

    #[test]
    fn recording_is_scaled_and_read_from_its_first_channel() {
        let dir = tempfile::tempdir().unwrap();
        let spec = hound::WavSpec {
            channels: 2,
            sample_rate: 8000,
            bits_per_sample: 16,
            sample_format: hound::SampleFormat::Int,
        };
        let mut writer = hound::WavWriter::create(dir.path().join("tap.wav"), spec).unwrap();
        [8192_i16, 1, -16_384, 1].iter().for_each(|x| writer.write_sample(*x).unwrap());
        writer.finalize().unwrap();
        let settings = |file: &str| {
            let text = format!(
                "(recording: (file: \"{file}\", speed_mm_s: 80, full_scale_m_s2: 50, gain: 2), debounce_ms: \
                 30)"
            );
            let value = ron::parse(&Source::new(dir.path().join("g.ron"), text)).unwrap();
            effect().read("tap", &value).unwrap()
        };
        assert_eq!(of(&settings("tap.wav")).debounce_ms, 30.0);
        let Transient::Recorded(found) = transient(&settings("tap.wav")).unwrap() else { panic!() };
        assert_eq!((found.samples, found.rate_hz, found.speed_mm_s), (vec![25.0, -50.0], 8000.0, 80.0));
        let e = transient(&settings("none.wav")).unwrap_err().to_string();
        assert!(e.contains("none.wav: cannot read this file: No such file"), "{e}");
    }
}
