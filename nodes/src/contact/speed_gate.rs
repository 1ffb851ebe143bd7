//! `speed_gate`: no texture without motion on a surface.

use asperity_node::{
    Descriptor, Diagnostic, Input, Latency, Node, Output, Param, Prepared, Processor, RateSpec, Setup,
    ShapeSpec, State, Status, Tick, Unit,
};

/// Places of the live parameters.
const SPEED_MM_S: usize = 0;
const FORCE_N: usize = 1;
const HYSTERESIS: usize = 2;

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
    open_mm_s: f64,
    touch_n: f64,
    /// Part of both thresholds at which it closes.
    hysteresis: f64,
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
            "Silence while the stylus rests or is off the surface, with hysteresis and a fade.",
        )
        .input(
            Input::new("in", ShapeSpec::Audio(RateSpec::Of('r')), Unit::NONE)
                .unit_of('u')
                .doc("what is gated"),
        )
        .input(
            Input::new("speed", ShapeSpec::Control(1), Unit::MILLIMETRE_PER_SECOND)
                .doc("speed along the surface"),
        )
        .input(
            Input::new("force", ShapeSpec::Control(1), Unit::NEWTON)
                .or(1e3)
                .doc("normal force; unconnected, the stylus counts as on the surface"),
        )
        .output(
            Output::new("out", ShapeSpec::Audio(RateSpec::Of('r')), Unit::NONE)
                .unit_of('u')
                .doc("what gets through"),
        )
        .output(
            Output::new("active", ShapeSpec::Control(1), Unit::NONE).doc("1 while open or fading, else 0"),
        )
        .param(
            Param::number("speed_mm_s", 5.0, 0.0..=1000.0, "The gate opens at this speed.")
                .unit("mm/s")
                .live(),
        )
        .param(
            Param::number("force_n", 0.02, 0.0..=100.0, "The stylus is on the surface from this force on.")
                .unit("N")
                .live(),
        )
        .param(
            Param::number("hysteresis", 0.4, 0.0..=1.0, "The gate closes at this part of speed and force.")
                .live(),
        )
        .param(Param::number("fade_ms", 10.0, 0.1..=1000.0, "How long it takes to open or close.").unit("ms"))
        .gates("in")
        .timing("opens and closes over `fade_ms`")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let p = setup.params;
        let samples = (p.number("fade_ms") * 1e-3 * f64::from(setup.input_rate(0))).max(1.0).round();
        let it = Self {
            open_mm_s: p.number("speed_mm_s"),
            touch_n: p.number("force_n"),
            hysteresis: p.number("hysteresis"),
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
        let part = |on: bool| if on { self.hysteresis } else { 1.0 };
        let (open, touch) = (self.open_mm_s * part(self.moving), self.touch_n * part(self.touching));
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
        match index {
            SPEED_MM_S => self.open_mm_s = value,
            FORCE_N => self.touch_n = value,
            HYSTERESIS => self.hysteresis = value,
            _ => {}
        }
    }

    /// Whether it is open, and the level of its fade.
    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.moving).keep(&mut self.touching).keep(&mut self.gain);
        state.require((0.0..=1.0).contains(&self.gain));
    }
}
