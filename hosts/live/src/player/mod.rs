//! The engine with its real-time inputs and outputs: one call runs a tick and passes its samples on.

mod mic;
mod node_meters;
mod stylus;
mod tape;
mod wiring;

pub use mic::{Listener, MicReader, MicWriter, mic};
pub(crate) use node_meters::NodeMeters;
pub(crate) use stylus::Stylus;
pub use stylus::{StylusReader, StylusRow};
pub use tape::TapeReader;
pub(crate) use tape::{TapeWriter, hand_tape, tape};
pub use wiring::HandInput;
pub(crate) use wiring::{Hand, Motion, Scope, Wiring};

use std::sync::Arc;

use asperity_engine::{Clock, Engine};
use asperity_node::{Buffer, Fact, time};
use ringbuf::traits::{Consumer, Producer};
use ringbuf::{HeapCons, HeapProd};

use crate::ForceModel;
use crate::driver::{Rates, Ticker};
use crate::now_ns;
use crate::output_limits::Seen;
use crate::run_control::RunControl;
use stylus::StylusWriter;
use tape::played_tape;

opaque_debug!(Player);

/// Inputs of a node with the role [`Hand`](asperity_node::Role::Hand) that the player feeds, by index.
pub mod place {
    /// x, y, z \[mm\].
    pub const POSITION: usize = 0;
    /// Force \[N\], or pressure from 0 to 1.
    pub const FORCE: usize = 1;
    /// Number of the touch.
    pub const STROKE: usize = 2;
}

/// Shortest time in which the strength of the output goes from nothing to all [s].
const STRENGTH_S: f32 = 0.02;

/// The program's clock for the engine during a tick; notes which node is called.
struct Now<'a> {
    meters: &'a NodeMeters,
    tick: u64,
}

impl Clock for Now<'_> {
    fn now_ns(&self) -> u64 {
        now_ns()
    }

    fn enters(&self, node: usize) {
        self.meters.enter(self.tick, node);
    }
}

impl Drop for Now<'_> {
    fn drop(&mut self) {
        self.meters.leave();
    }
}

/// An engine with its inputs, sinks and meters. [`prepare_live`](crate::prepare_live) makes it, a driver
/// runs it.
pub struct Player {
    engine: Engine,
    wiring: Box<Wiring>,
    mic: Option<MicReader>,
    /// Heat of the coils behind the device.
    coils: Arc<Seen>,
    /// Strength of the output after the last tick and the next, and who sets it.
    strength: [f32; 2],
    run_control: RunControl,
    wirings: HeapCons<Box<Wiring>>,
    retired: HeapProd<Box<Wiring>>,
    /// Replaced, and not yet returned to the control thread.
    over: Option<Box<Wiring>>,
    rates: Rates,
    /// Recordings that were asked for: the samples for the device, with the order of their channels, and the
    /// motion of the stylus.
    played: Option<(TapeWriter, Vec<usize>)>,
    stylus: Option<StylusWriter>,
}

impl Player {
    pub(crate) fn new(
        engine: Engine,
        wiring: Box<Wiring>,
        mic: Option<MicReader>,
        coils: Arc<Seen>,
        wirings: HeapCons<Box<Wiring>>,
        retired: HeapProd<Box<Wiring>>,
    ) -> Self {
        let schedule = engine.schedule();
        // A graph that only records has a device all the same, which plays silence.
        let channels = wiring.outs.len().max(1);
        let rates = Rates { tick_hz: schedule.tick_hz.max(1), rate_hz: schedule.audio_hz, channels };
        let (strength, run_control) = ([1.0; 2], RunControl::default());
        let (over, played, stylus) = (None, None, None);
        Self {
            engine,
            wiring,
            mic,
            coils,
            strength,
            run_control,
            wirings,
            retired,
            over,
            rates,
            played,
            stylus,
        }
    }

    /// Takes the strength of the output from a run's control. Before the run.
    pub(crate) fn obey(&mut self, run_control: &RunControl) {
        self.run_control = run_control.clone();
        run_control.ticks_at(self.rates.tick_hz);
        self.strength = [run_control.strength(); 2];
    }

    /// Records the samples of every tick for the device, before its fades. Channels are interleaved, in the
    /// order in which a render has them. Before the run.
    pub fn record_played(&mut self) -> TapeReader {
        let mut order: Vec<usize> = (0..self.wiring.outs.len()).collect();
        order.sort_by_key(|&channel| self.wiring.outs[channel]);
        let (to, from) = played_tape(self.rates);
        self.played = Some((to, order));
        from
    }

    /// Records the motion of the stylus in every tick. Before the run.
    pub fn record_stylus(&mut self) -> StylusReader {
        let (to, from) = stylus::tape(self.rates.tick_hz);
        self.stylus = Some(to);
        from
    }

    /// The engine, for reports after the run.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// Facts of each node now. Not for the tick thread.
    pub(crate) fn facts(&mut self) -> Vec<Vec<Fact>> {
        (0..self.engine.schedule().nodes.len()).map(|i| self.engine.facts(i)).collect()
    }

    /// Feeds the positions of hands at a time, and recorded samples.
    fn feed(&mut self, time_ns: u64) {
        let engine = &mut self.engine;
        let tick = engine.next_tick();
        for (node, hand, tape) in &mut self.wiring.hands {
            let Some(input) = hand.read(tick, time_ns) else { continue };
            engine.feed_control(*node, place::POSITION, &input.position.map(f64::from), input.valid);
            engine.feed_control(*node, place::FORCE, &[input.force.into()], input.valid);
            engine.feed_control(*node, place::STROKE, &[input.stroke.into()], input.valid);
            if let Some(tape) = tape {
                tape.note(tick, &input);
            }
        }
        if let Some(mic) = &mut self.mic {
            let span = time::samples(engine.next_tick(), self.rates.rate_hz, self.rates.tick_hz);
            let fresh = mic.advance((span.end - span.start) as usize);
            for &(node, channel) in &self.wiring.mics {
                engine.feed_audio(node, 0, fresh, |samples| mic.read(channel, samples));
            }
        }
    }

    /// Tells the limiters the heat of the device's coils, and the strength of the output.
    fn prepare_limiters(&mut self) {
        let step = 1.0 / (STRENGTH_S * self.rates.tick_hz as f32);
        let now = self.strength[1];
        self.strength = [now, now + (self.run_control.strength() - now).clamp(-step, step)];
        if self.wired() {
            for (limiter, heat) in self.wiring.limiters.iter().zip(self.coils.heat()) {
                if let Some(node) = *limiter {
                    self.engine.warm(node, heat);
                    self.engine.attenuate(node, self.strength[1]);
                }
            }
        }
    }

    /// Takes over the wiring of a graph that the engine has just taken over.
    fn rewire(&mut self) {
        while self.over.is_none() && self.wiring.swap < self.engine.swaps() {
            let Some(next) = self.wirings.try_pop() else { break };
            self.over = Some(std::mem::replace(&mut self.wiring, next));
            self.give_back();
        }
    }

    fn give_back(&mut self) {
        if let Some(over) = self.over.take() {
            self.over = self.retired.try_push(over).err();
        }
    }

    /// Whether the wiring belongs to the running graph.
    fn wired(&self) -> bool {
        self.wiring.swap == self.engine.swaps()
    }

    /// Samples for the device of this tick.
    fn samples(&self, out: &mut [f32]) {
        let channels = self.rates.channels;
        for (channel, &node) in self.wiring.outs.iter().enumerate().take(channels) {
            let Some(Buffer::Audio { samples, len, .. }) = self.engine.output(node, 0) else { continue };
            for (frame, x) in out.chunks_exact_mut(channels).zip(&samples[..*len]) {
                frame[channel] = *x;
            }
        }
    }

    /// Passes the outputs of a tick on.
    fn hand_on(&mut self, out: &mut [f32]) {
        if !self.wired() {
            // The indices are those of another graph. Only a signal behind a limiter may reach a device,
            // and only its own plane a stylus.
            for mut writer in self.wiring.forces.iter().filter_map(|(.., writer)| writer.try_lock()) {
                writer.write(ForceModel { time_ns: now_ns(), ..ForceModel::default() });
            }
            return;
        }
        self.samples(out);
        let tick = self.engine.next_tick().saturating_sub(1);
        if let Some((tape, order)) = &mut self.played {
            tape.note_frames(self.rates.first_sample(tick), out, order);
        }
        if let (Some(tape), Some(stylus)) = (&mut self.stylus, &self.wiring.stylus) {
            tape.take(&self.engine, stylus);
        }
        self.push_back();
        for scope in &mut self.wiring.scopes {
            scope.take(&self.engine, self.strength);
        }
        for tape in &mut self.wiring.tapes {
            tape.take(&self.engine);
        }
    }

    fn push_back(&mut self) {
        for (node, max_force_n, writer) in &self.wiring.forces {
            let Some(mut writer) = writer.try_lock() else { continue };
            let model = ForceModel::of(&self.engine, *node, *max_force_n);
            writer.write(ForceModel { time_ns: now_ns(), ..model });
        }
    }
}

impl ForceModel {
    /// The surface that a node with the role [`Force`](asperity_node::Role::Force) had in the last tick,
    /// without its time. `max_force_n`: its largest force \[N\].
    pub fn of(engine: &Engine, node: usize, max_force_n: f64) -> Self {
        let control = |input| match engine.input(node, input) {
            Some(Buffer::Control { values, valid, .. }) => (&values[..], *valid),
            _ => (&[][..], false),
        };
        let vector = |values: &[f64]| <[f64; 3]>::try_from(values).unwrap_or_default();
        let (plane, normal, stiffness, damping) = (control(0), control(1), control(2), control(3));
        let beside = control(4);
        Self {
            point: vector(plane.0),
            normal: vector(normal.0),
            stiffness_n_per_mm: stiffness.0.first().copied().unwrap_or(0.0),
            damping_ns_per_m: damping.0.first().copied().unwrap_or(0.0),
            // An invalid force beside the wall leaves the wall valid.
            beside_n: if beside.1 { vector(beside.0) } else { [0.0; 3] },
            max_force_n,
            valid: plane.1 && normal.1 && stiffness.1 && damping.1,
            time_ns: 0,
        }
    }
}

impl Ticker for Player {
    fn rates(&self) -> Rates {
        self.rates
    }

    fn next_tick(&self) -> u64 {
        self.engine.next_tick()
    }

    fn tick(&mut self, time_ns: u64, out: &mut [f32]) {
        self.give_back();
        self.feed(time_ns);
        self.prepare_limiters();
        let Wiring { spent, meters, .. } = &mut *self.wiring;
        spent.fill(0);
        let tick = self.engine.next_tick();
        self.engine.tick_timed(&Now { meters, tick }, spent);
        if self.wired() {
            self.wiring.meters.take(&self.engine, &self.wiring.spent);
        } else {
            // The times of this tick have the new graph's indices; the old meters skip them.
            self.rewire();
        }
        self.hand_on(out);
        self.run_control.comes_to(self.engine.next_tick());
    }

    fn skip(&mut self, n: u64) {
        if let Some(mic) = &mut self.mic {
            let next = self.engine.next_tick();
            let first = |tick| self.rates.first_sample(tick);
            mic.skip((first(next + n) - first(next)) as usize);
        }
        self.engine.skip(n);
        self.run_control.comes_to(self.engine.next_tick());
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
