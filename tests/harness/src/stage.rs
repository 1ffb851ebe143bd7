//! A graph on the simulated sound card.

use std::time::{Duration, Instant};

use asperity_audio::Request;
use asperity_audio::simulated::{Params, Simulated};
use asperity_engine::{Engine, Options};
use asperity_graph::{Compiled, GraphFile};
use asperity_live::driver::Clock;
use asperity_live::{
    DeviceQueues, Ended, MicReader, MicWriter, RunControl, Session, SessionOptions, prepare_live,
};
use asperity_node::{Buffer, Registry, Role};

/// A graph from its rates, nodes and wires.
pub fn graph(
    registry: &Registry,
    (tick_hz, audio_hz): (u32, u32),
    nodes: &str,
    wires: &str,
) -> (GraphFile, Compiled) {
    let text = format!(
        "Graph(version: 1, tick_hz: {tick_hz}, audio_hz: {audio_hz}, nodes: {{{nodes}}}, wires: [{wires}])"
    );
    let file = crate::graph::parsed(text);
    let compiled = crate::graph::compiled(&file, registry);
    (file, compiled)
}

/// Nodes and wires of a sine [Hz, A] that reaches channel `id` of a card.
pub fn voice(id: &str, hz: f64, amps: f64) -> (String, String) {
    let nodes = format!(
        r#""{id} tone": (kind: "sine", params: (frequency_hz: {hz:?}, amplitude: {amps:?})),
           "{id} limiter": (kind: "limiter", params: (profile: "hapcoil_one")),
           "{id}": (kind: "audio_out"),"#
    );
    (nodes, format!(r#"("{id} tone", "{id} limiter"), ("{id} limiter", "{id}"),"#))
}

/// One sine of 80 Hz, at 500 ticks/s and 48 kHz.
pub fn one_voice() -> (GraphFile, Compiled) {
    let (nodes, wires) = voice("out", 80.0, 0.1);
    graph(&crate::registry(), (500, 48_000), &nodes, &wires)
}

/// Samples of every `audio_out` of a graph, run by the engine alone: at least so many of each.
pub fn offline(compiled: Compiled, samples: usize) -> Vec<Vec<f32>> {
    let mut engine = Engine::new(compiled, Options::default());
    let outs: Vec<usize> = engine.schedule().with_role(Role::AudioOutput).map(|(i, _)| i).collect();
    let mut heard = vec![Vec::new(); outs.len()];
    while heard[0].len() < samples {
        engine.tick();
        for (heard, &out) in heard.iter_mut().zip(&outs) {
            if let Some(Buffer::Audio { samples, len, .. }) = engine.output(out, 0) {
                heard.extend_from_slice(&samples[..*len]);
            }
        }
    }
    heard
}

/// A card that calls when it is told to, and keeps what it hears.
pub fn by_hand() -> Params {
    Params { speed: 0.0, keep: true, ..Params::default() }
}

/// A card that calls in real time, and keeps what it hears.
pub fn timed(frames: u32) -> Params {
    Params { frames: vec![frames], keep: true, ..Params::default() }
}

/// At once at full level, on a card's first channel.
pub fn options(card: &Simulated, clock: Clock) -> SessionOptions {
    let device = Some(Request { device: Some(card.id()), ..Request::default() });
    SessionOptions {
        device,
        clock: Some(clock),
        reconnect: true,
        start_s: 0.0,
        realtime: false,
        run_control: RunControl::default(),
        coil_monitor: None,
    }
}

pub fn start(graph: (GraphFile, Compiled), options: SessionOptions) -> Session {
    start_with(graph, DeviceQueues::default(), None, options)
}

pub fn start_with(
    (file, compiled): (GraphFile, Compiled),
    queues: DeviceQueues,
    mic: Option<(MicWriter, MicReader)>,
    options: SessionOptions,
) -> Session {
    let (writer, reader) = mic.unzip();
    let (graph_controller, player) =
        prepare_live(compiled, &file, Options::default(), queues, reader, Vec::new());
    Session::start(graph_controller, player, writer, options).expect("it starts")
}

/// Sends a graph to the tick thread.
pub fn swap(session: &mut Session, (file, compiled): (GraphFile, Compiled)) {
    let graph_controller = session.graph_controller();
    graph_controller.collect();
    graph_controller.swap(compiled, &file, &[], DeviceQueues::default(), Vec::new()).expect("it is sent");
}

/// Polls a session until it is so, at most 30 s; answers what was said.
pub fn poll(session: &mut Session, what: &str, mut is_so: impl FnMut(&mut Session) -> bool) -> Vec<String> {
    let began = Instant::now();
    let mut said = Vec::new();
    while !is_so(session) {
        assert!(began.elapsed() < Duration::from_secs(30), "waited in vain for {what}; it said {said:?}");
        said.extend(session.poll().expect("a thread"));
        std::thread::sleep(Duration::from_millis(2));
    }
    said
}

/// Stops a session on a card that has to be told to call.
pub fn stop(session: Session, card: &Simulated) -> Ended {
    std::thread::scope(|scope| {
        let end = scope.spawn(move || session.stop());
        while !end.is_finished() {
            card.step(64);
        }
        end.join().expect("it stops")
    })
}

/// One channel (from 0) of what a card of so many played.
pub fn channel(played: &[f64], channels: usize, channel: usize) -> Vec<f64> {
    played.chunks_exact(channels).map(|frame| frame[channel]).collect()
}

/// The largest step from one sample to the next.
pub fn largest_step(samples: &[f64]) -> f64 {
    samples.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max)
}

/// The largest step of [`one_voice`] with a ramp of 10 ms upon it.
pub const STEP: f64 = 0.1 * (std::f64::consts::TAU * 80.0 / 48_000.0 + std::f64::consts::PI / 2.0 / 240.0);
