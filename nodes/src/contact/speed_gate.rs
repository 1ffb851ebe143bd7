//! `speed_gate`: no texture without motion on a surface.

use crate::prelude::*;

/// The live parameters.
const LIVE: [&str; 3] = ["speed_mm_s", "force_n", "hysteresis"];

/// Lets audio through while the stylus moves on a surface; fades in and out.
///
/// It opens at `open_mm_s` and `contact_n` and closes at `hysteresis` times these. While it is closed and has
/// faded out, the nodes that serve only its audio input sleep. While speed or force is invalid, it closes.
///
/// The usual hysteresis opens at 5 mm/s and closes at 2 mm/s. Devices that report positions in steps need it:
/// behind a low-pass of 20 Hz, steps of 0.055 mm make the speed ripple by up to 3 mm/s from crest to crest,
/// at every tick rate.
///
/// New thresholds and a new hysteresis count from the next tick on. If they open or close the gate, it fades
/// as usual.
pub struct SpeedGate {
    /// Values of [`LIVE`]: thresholds of speed and force, and the part of both at which it closes.
    live: [f64; 3],
    /// Change of gain per sample.
    step: f32,
    moving: bool,
    touching: bool,
    gain: f32,
}

impl Node for SpeedGate {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "speed_gate",
            "Mutes audio while the stylus rests or is off the surface, with hysteresis and a fade.",
        )
        .input(audio("in").doc("audio to gate"))
        .input(control("speed", 1, MM_S).doc("speed along the surface"))
        .input(control("force", 1, N).or(1e3))
        .doc("normal force; if unconnected, the stylus counts as touching")
        .output(audio_out("out").doc("gated audio"))
        .output(control_out("active", 1, ONE).doc("1 while the gate is open or fades, else 0"))
        .param(number("speed_mm_s", 5.0, 0.0..=1000.0, "mm/s").live().doc("The gate opens above this speed."))
        .param(number("force_n", 0.02, 0.0..=100.0, "N").live())
        .doc("The gate opens above this normal force.")
        .param(number("hysteresis", 0.4, 0.0..=1.0, "").live())
        .doc("The gate closes below this fraction of `speed_mm_s` and `force_n`.")
        .param(
            number("fade_ms", 10.0, 0.1..=1000.0, "ms")
                .doc("Duration of the fade when the gate opens or closes."),
        )
        .gates("in")
        .timing("no latency; the gate opens and closes over `fade_ms`")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let p = setup.params;
        let samples = (p.number("fade_ms") * 1e-3 * f64::from(setup.input_rate(0))).max(1.0).round();
        let it = Self {
            live: LIVE.map(|name| p.number(name)),
            step: (1.0 / samples) as f32,
            moving: false,
            touching: false,
            gain: 0.0,
        };
        Ok(Prepared::new(it).tail(Latency::samples(samples as i64, setup.input_rate(0))))
    }
}

impl Processor for SpeedGate {
    fn wants(&mut self, tick: &mut Tick<'_>) -> bool {
        if !(tick.inputs.valid(1) && tick.inputs.valid(2)) {
            // The position of the stylus is unknown.
            (self.moving, self.touching) = (false, false);
            return self.gain > 0.0;
        }
        let (speed, force) = (tick.inputs.value(1), tick.inputs.value(2));
        let [open, touch, hysteresis] = self.live;
        let part = |on: bool| if on { hysteresis } else { 1.0 };
        let (open, touch) = (open * part(self.moving), touch * part(self.touching));
        self.moving = speed >= open;
        // At a threshold of 0 a stylus in the air, whose force is 0, must still count as off.
        self.touching = force > 0.0 && force >= touch;
        (self.moving && self.touching) || self.gain > 0.0
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let open = self.moving && self.touching;
        if !open && self.gain == 0.0 {
            tick.outputs.set(1, 0.0);
            return Status::Quiet;
        }
        tick.outputs.set(1, 1.0);
        let step = if open { self.step } else { -self.step };
        for (y, x) in tick.outputs.audio(0).iter_mut().zip(tick.inputs.audio(0)) {
            self.gain = (self.gain + step).clamp(0.0, 1.0);
            // Smoothstep: no corner where the fade begins or ends.
            *y = x * (self.gain * self.gain * (3.0 - 2.0 * self.gain));
        }
        Status::Continue
    }

    fn reset(&mut self) {
        (self.moving, self.touching, self.gain) = (false, false, 0.0);
    }

    fn set_parameter(&mut self, index: usize, value: f64) {
        self.live.get_mut(index).into_iter().for_each(|parameter| *parameter = value);
    }

    /// Whether it is open, and the level of its fade.
    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.moving).keep(&mut self.touching).keep(&mut self.gain);
        state.require((0.0..=1.0).contains(&self.gain));
    }
}
