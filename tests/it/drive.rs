//! Calling one node by hand, tick by tick, and looking at the nodes of an engine.

use asperity_engine::Engine;
use asperity_node::{Buffer, InputRef, Inputs, Outputs, Processor, Status, Tick};

/// Audio of a tick, all of it heard.
pub fn audio(samples: &[f32], valid: bool) -> Buffer {
    Buffer::Audio { samples: samples.into(), len: samples.len(), valid, silent: false }
}

pub fn control(values: &[f64]) -> Buffer {
    Buffer::Control { values: values.into(), changed: true, valid: true }
}

pub fn samples(buffer: &Buffer) -> &[f32] {
    match buffer {
        Buffer::Audio { samples, len, .. } => &samples[..*len],
        _ => panic!("not audio"),
    }
}

pub fn values(buffer: &Buffer) -> &[f64] {
    match buffer {
        Buffer::Control { values, .. } => values,
        _ => panic!("not a control"),
    }
}

/// One tick at 500 Hz; every input is wired.
pub fn tick(p: &mut dyn Processor, index: u64, inputs: &[Buffer], outputs: &mut [Buffer]) -> Status {
    let map: Vec<InputRef> =
        (0..inputs.len()).map(|i| InputRef { buffer: i as u32, connected: true }).collect();
    let inputs = Inputs::new(inputs, &[], inputs.len(), &map);
    let mut tick = Tick { index, tick_hz: 500, inputs, outputs: Outputs::new(outputs) };
    p.run(&mut tick).expect("no fault")
}

/// Index of a node.
pub fn node(engine: &Engine, id: &str) -> usize {
    engine.schedule().index_of(id).unwrap_or_else(|| panic!("no node {id}"))
}

/// Samples that a node put out in this tick.
pub fn audio_of(engine: &Engine, id: &str, output: usize) -> Vec<f32> {
    samples(engine.output(node(engine, id), output).expect("an output")).to_vec()
}

/// Values that a node put out in this tick, and whether they are valid.
pub fn control_of(engine: &Engine, id: &str, output: usize) -> (Vec<f64>, bool) {
    let buffer = engine.output(node(engine, id), output).expect("an output");
    (values(buffer).to_vec(), buffer.is_valid())
}
