//! `waveform`: a texture that is read by the distance travelled.

use std::path::PathBuf;

use asperity_diagnostics::ron::Value;
use asperity_node::{
    Descriptor, Diagnostic, Fact, Input, Latency, Node, Param, Resume, Setup, ShapeSpec, State, Status, Tick,
    Unit,
};
use asperity_scene::effect::{self, Parts, WaveformTable};
use asperity_scene::{self, Texture};

use super::mix::Mix;
use super::texts::{self, Shared};
use super::track::Track;
use super::voices::{Voice, Voices};
use super::{acceleration, slot};

const SLOT: usize = 0;
const PLACE: usize = 1;
const STROKE: usize = 2;

/// A loop, drawn or recorded, that is read by distance: faster motion reads faster.
///
/// The path between ticks goes through the middles of places, along parabolas. A slot that comes on begins at its loop's beginning; the path goes on.
pub struct Waveform {
    loops: Voices<Loop>,
    track: Track,
    mix: Mix,
    rate_hz: u32,
    latency: Latency,
    lag_s: f64,
    tables: u64,
    /// Recordings.
    files: Vec<PathBuf>,
}

/// A loop as it is read.
#[derive(Clone)]
struct Loop {
    waveform: effect::Waveform,
    gain: f64,
}

impl Voice for Loop {
    fn reset(&mut self) {
        self.waveform.reset();
    }

    fn state(&mut self, state: &mut State<'_>) {
        self.waveform.state(state);
    }
}

/// The place of the stylus along the surface, and which stroke it is.
pub(super) fn place() -> [Input; 2] {
    [
        Input::new("place", ShapeSpec::Control(2), Unit::MILLIMETRE).doc("of the stylus along the surface"),
        Input::new("stroke", ShapeSpec::Control(1), Unit::NONE)
            .or(0.0)
            .doc("another number: the stylus was put down elsewhere, and what lies between is no motion"),
    ]
}

/// The low-pass for places.
pub(super) fn smooth_hz() -> Param {
    Param::number(
        "smooth_hz",
        0.0,
        0.0..=1000.0,
        "Cutoff of a low-pass of second order for places, such as 20 for a device that tells them in coarse steps; 0 for none.",
    )
    .unit("Hz")
}

fn read(
    value: &Value,
    tables: &mut Shared<Texture, WaveformTable>,
    files: &mut Vec<PathBuf>,
) -> Result<Loop, Diagnostic> {
    let other =
        || value.error("a texture of another kind").help("waveform(segments: [(0, 0), (0.5, 1), (1, 0)])");
    let Texture::Waveform { values, crossfade_mm, quantity, gain } = Texture::parse(value)? else {
        return Err(other());
    };
    if let asperity_scene::Loop::Recorded { file, .. } = &values {
        files.push(file.clone());
    }
    let plain = Texture::Waveform { values, crossfade_mm, quantity, gain: 1.0 };
    let made = || match plain.table() {
        Ok(table) => table.ok_or_else(other),
        // What is wrong in a file is said of the file.
        Err(e) if e.path().is_some() => Err(e),
        Err(e) => Err(value.error(e.message)),
    };
    let table = tables.get(plain.clone(), made)?;
    Ok(Loop { waveform: effect::Waveform::new(table), gain })
}

impl Node for Waveform {
    fn descriptor() -> Descriptor {
        let [place, stroke] = place();
        Descriptor::new("waveform", "A texture from a loop that is read by the distance travelled.")
            .input(slot("which of `loops`, from 0; below 0 none sounds"))
            .input(place)
            .input(stroke)
            .output(acceleration().doc("the vibration of gliding"))
            .param(Param::texts(
                "loops",
                "Loops, each a text as behind `texture` in a scene: `waveform(segments: [(0, 0), (0.5, 1), (1, 0)], spacing_mm: 0.05, crossfade_mm: 0, \
                 reference_speed_mm_s: 100, speed_exponent: 1, gain: 1)` with pairs of a distance in mm and an acceleration in m/s^2, or with \
                 `quantity: height` and heights in mm; `waveform(recording: (file: \"felt.wav\", speed_mm_s: 100, full_scale_m_s2: 50), crossfade_mm: 5)`; \
                 or a list of them, `[waveform(..), waveform(..)]`, whose sum is one entry.",
            ))
            .param(smooth_hz())
            .timing("a tick and a half less a sample; silent in the first tick after it wakes, which has no speed yet, and faded in over the second; smoothing at 20 Hz adds 11 ms")
            .resumes(Resume::Restart)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        let (mut tables, mut files) = (Shared::default(), Vec::new());
        let loops = texts::read_each(setup, "loops", |value| read(value, &mut tables, &mut files))?;
        let track = Track::new(setup, setup.params.number("smooth_hz"))?;
        Ok(Self {
            loops: Voices::new(loops),
            latency: track.latency(setup),
            lag_s: track.lag_s(),
            track,
            mix: Mix::new(setup),
            rate_hz: setup.audio_hz,
            tables: tables.count(),
            files,
        })
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let turned = self.loops.turn(tick.inputs.value(SLOT));
        let place = tick.inputs.control(PLACE).try_into().unwrap_or([f64::NAN; 2]);
        let path = self.track.advance(place, tick.inputs.value(STROKE)).copied();
        let loops = self.loops.on();
        let Some(path) = path.filter(|_| !loops.is_empty()) else { return Status::Quiet };
        if self.track.begins() {
            loops.iter_mut().for_each(|one| one.waveform.lift());
        }
        let span = tick.samples(self.rate_hz);
        let parts = Parts::new(tick.index, span.start, self.rate_hz, tick.tick_hz);
        self.mix.begin((span.end - span.start) as usize);
        for one in loops {
            self.mix.add(one.gain, |part| one.waveform.process(&path, &parts, part));
        }
        if turned || self.track.begins() {
            self.mix.fade_in(&parts);
        }
        self.mix.write(tick.outputs.audio(0));
        Status::Continue
    }

    fn reset(&mut self) {
        self.loops.reset();
        self.track.reset();
    }

    /// Where the stylus was, and where in its loop. Another loop goes on at the same distance.
    fn state(&mut self, state: &mut State<'_>) {
        self.track.state(state);
        self.loops.state(state);
    }

    fn latency(&self) -> Latency {
        self.latency
    }

    fn files(&self) -> Vec<PathBuf> {
        self.files.clone()
    }

    fn facts(&self) -> Vec<Fact> {
        let mut facts =
            vec![Fact::count("slots", self.loops.count() as u64), Fact::count("tables", self.tables)];
        if self.lag_s > 0.0 {
            facts.push(Fact::number("response_lag", 1e3 * self.lag_s, "ms"));
        }
        facts
    }
}
