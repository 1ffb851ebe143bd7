//! Small networks for the corpus, made here.

use harness::networks::{Layer, Random, Spelling, Writer, bytes, float, int};
use harness::onnx::AttributeProto;

fn layer(r: &mut Random, from: usize, to: usize) -> Layer {
    Layer { weights: r.vector(from * to, 0.5), bias: r.vector(to, 0.1) }
}

/// Two layers, as the shipped networks are written; and one of operators that only tract runs, written in
/// other ways.
pub(super) fn all() -> [(&'static str, Vec<u8>); 2] {
    let mut r = Random(7);
    let mut w = Writer::new(Spelling::default());
    let [force, speed, texture, _] = w.names();
    let joined = w.concat(&[force, speed, texture]);
    let out = [layer(&mut r, 286, 2), layer(&mut r, 2, 100)];
    let out = w.layers(joined, &out, false);
    let layers = bytes(&w.finish(&out));

    let spelling = Spelling {
        typed_data: true,
        constant_nodes: true,
        free_batch: true,
        other_names: true,
        clip: true,
        no_ops: true,
        ..Spelling::default()
    };
    let mut w = Writer::new(spelling);
    let [force, speed, texture, _] = w.names();
    let force = w.normalise(force, &[1.0; 10], &[2.0; 10]);
    let (from, to, axis) = (w.ints(&[100]), w.ints(&[110]), w.ints(&[1]));
    let part = w.node("Slice", &[texture, &from, &to, &axis], vec![]);
    let sum = w.node("Add", &[&force, &part], vec![]);
    let mean = w.node("ReduceMean", &[speed], vec![network_ints("axes", &[1]), int("keepdims", 1)]);
    let soft = w.node("Softmax", &[&sum], vec![int("axis", 1)]);
    let product = w.node("Mul", &[&soft, &mean], vec![]);
    let times = w.ints(&[1, 10]);
    let tiled = w.node("Tile", &[&product, &times], vec![]);
    let leaky = w.node("LeakyRelu", &[&tiled], vec![float("alpha", 0.1)]);
    let operators = bytes(&w.finish(&leaky));
    [("layers.onnx", layers), ("operators.onnx", operators)]
}

fn network_ints(name: &str, ints: &[i64]) -> AttributeProto {
    AttributeProto { name: name.into(), ints: ints.to_vec(), r#type: 7, ..Default::default() }
}

/// An encoder whose answer is the mean brightness of a picture, in steps.
pub(crate) fn encoder() -> Vec<u8> {
    bytes(&harness::networks::encoder(&[1.0 / 576.0; 576], 0.01))
}
