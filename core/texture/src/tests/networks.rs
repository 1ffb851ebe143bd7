//! Makes test networks of the paper's layer sizes: ONNX bytes in several spellings, and a plain f64
//! evaluation.
#![allow(dead_code, missing_docs, unreachable_pub, clippy::unwrap_used)]

use crate::onnx::{
    AttributeProto, DataType, Dimension, DimensionValue, GraphProto, ModelProto, NodeProto,
    OperatorSetIdProto, TensorProto, TensorShapeProto, TensorTypeProto, TypeProto, ValueInfoProto,
};
use prost::Message;

/// Uniform numbers from a linear congruential generator (Knuth's MMIX constants), upper bits.
pub struct Random(pub u64);

impl Random {
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn within(&mut self, limit: f64) -> f64 {
        limit * (2.0 * self.unit() - 1.0)
    }

    pub fn vector(&mut self, n: usize, limit: f64) -> Vec<f32> {
        (0..n).map(|_| self.within(limit) as f32).collect()
    }

    pub fn layer(&mut self, inputs: usize, outputs: usize, weight: f64, bias: f64) -> Layer {
        Layer { weights: self.vector(inputs * outputs, weight), bias: self.vector(outputs, bias) }
    }
}

/// `weights[k * outputs + j]`, ReLU after.
#[derive(Clone)]
pub struct Layer {
    pub weights: Vec<f32>,
    pub bias: Vec<f32>,
}

#[derive(Clone)]
pub struct Net {
    pub force: Vec<Layer>,
    pub speed: Vec<Layer>,
    pub action: Vec<Layer>,
    pub predictor: Vec<Layer>,
    pub force_mean: Vec<f32>,
    pub force_deviation: Vec<f32>,
    pub speed_mean: Vec<f32>,
    pub speed_deviation: Vec<f32>,
    pub output_scale: Vec<f32>,
}

impl Net {
    /// The layer sizes of Heravi et al. 2024 with random weights of He's variance.
    pub fn random(seed: u64) -> Net {
        let mut r = Random(seed);
        let mut layers = |sizes: &[usize]| -> Vec<Layer> {
            sizes.windows(2).map(|s| r.layer(s[0], s[1], (6.0 / s[0] as f64).sqrt(), 0.2)).collect()
        };
        Net {
            force: layers(&[10, 10, 10, 10]),
            speed: layers(&[20, 20, 20, 20, 10]),
            action: layers(&[20, 400, 300, 200, 100]),
            predictor: layers(&[356, 300, 300, 200, 100, 100]),
            force_mean: vec![1.2; 10],
            force_deviation: (0..10).map(|i| 0.5 + 0.1 * i as f32).collect(),
            speed_mean: (0..20).map(|i| i as f32 - 10.0).collect(),
            speed_deviation: vec![80.0; 20],
            output_scale: (0..100).map(|i| 0.01 + 0.001 * i as f32).collect(),
        }
    }

    /// The network as defined, in f64, layer by layer.
    pub fn evaluate(&self, force: &[f32], speed: &[f32], texture: &[f32]) -> Vec<f64> {
        let normalise = |x: &[f32], mean: &[f32], deviation: &[f32]| -> Vec<f64> {
            (0..x.len()).map(|i| (f64::from(x[i]) - f64::from(mean[i])) / f64::from(deviation[i])).collect()
        };
        let run = |layers: &[Layer], mut x: Vec<f64>| -> Vec<f64> {
            for layer in layers {
                let n = layer.bias.len();
                x = (0..n)
                    .map(|j| {
                        let sum: f64 = (0..x.len()).map(|k| x[k] * f64::from(layer.weights[k * n + j])).sum();
                        (sum + f64::from(layer.bias[j])).max(0.0)
                    })
                    .collect();
            }
            x
        };
        let mut joined = run(&self.force, normalise(force, &self.force_mean, &self.force_deviation));
        joined.extend(run(&self.speed, normalise(speed, &self.speed_mean, &self.speed_deviation)));
        let mut all: Vec<f64> = texture.iter().map(|&x| f64::from(x)).collect();
        all.extend(run(&self.action, joined));
        let out = run(&self.predictor, all);
        out.iter().zip(&self.output_scale).map(|(y, &s)| y * f64::from(s)).collect()
    }
}

/// Spelling of a network file.
#[derive(Clone, Copy, Debug, Default)]
pub struct Spelling {
    pub product: Product,
    /// Axis of concatenations: 1 or -1, and 0 for 1.
    pub concat_axis: i64,
    /// Weights in `float_data` instead of `raw_data`.
    pub typed_data: bool,
    /// Constants as Constant nodes instead of initializers.
    pub constant_nodes: bool,
    /// Identity, Flatten, Reshape and Dropout without effect.
    pub no_ops: bool,
    /// A free batch size.
    pub free_batch: bool,
    /// `Mul` by the inverse and `Add` of the negative instead of `Div` and `Sub`.
    pub multiply: bool,
    /// Clip instead of the last Relu.
    pub clip: bool,
    /// Inputs and outputs by other names, in another order.
    pub other_names: bool,
    /// Operator set; 0 for 17.
    pub opset: i64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Product {
    #[default]
    GemmTransB,
    Gemm,
    MatMulAdd,
}

/// Writes a graph node by node.
pub struct Writer {
    pub graph: GraphProto,
    pub spelling: Spelling,
    count: usize,
}

pub fn value_info(name: &str, dims: &[Option<i64>]) -> ValueInfoProto {
    let value = |d: &Option<i64>| d.map_or(DimensionValue::Name("batch".into()), DimensionValue::Size);
    let dim = dims.iter().map(|d| Dimension { value: Some(value(d)) }).collect();
    let tensor = TensorTypeProto { elem_type: DataType::Float as i32, shape: Some(TensorShapeProto { dim }) };
    ValueInfoProto { name: name.into(), r#type: Some(TypeProto { tensor_type: Some(tensor) }) }
}

pub fn tensor(name: &str, dims: &[usize], data: &[f32]) -> TensorProto {
    TensorProto {
        name: name.into(),
        dims: dims.iter().map(|&d| d as i64).collect(),
        data_type: DataType::Float as i32,
        raw_data: data.iter().flat_map(|x| x.to_le_bytes()).collect(),
        ..Default::default()
    }
}

pub fn int_tensor(name: &str, data: &[i64]) -> TensorProto {
    TensorProto {
        name: name.into(),
        dims: vec![data.len() as i64],
        data_type: DataType::Int64 as i32,
        int64_data: data.to_vec(),
        ..Default::default()
    }
}

/// A node with one output.
pub fn node(op: &str, inputs: &[&str], output: &str, attribute: Vec<AttributeProto>) -> NodeProto {
    NodeProto {
        name: format!("{op}_{output}"),
        op_type: op.into(),
        input: inputs.iter().map(|s| s.to_string()).collect(),
        output: vec![output.into()],
        attribute,
        ..Default::default()
    }
}

pub fn int(name: &str, i: i64) -> AttributeProto {
    AttributeProto { name: name.into(), i, r#type: 2, ..Default::default() }
}

pub fn ints(name: &str, ints: &[i64]) -> AttributeProto {
    AttributeProto { name: name.into(), ints: ints.to_vec(), r#type: 7, ..Default::default() }
}

pub fn float(name: &str, f: f32) -> AttributeProto {
    AttributeProto { name: name.into(), f, r#type: 1, ..Default::default() }
}

impl Writer {
    pub fn new(spelling: Spelling) -> Writer {
        let graph = GraphProto { name: "network".into(), ..Default::default() };
        let mut made = Writer { graph, spelling, count: 0 };
        let batch = if spelling.free_batch { None } else { Some(1) };
        let values = made.names().into_iter().zip([10, 20, 256, 100]);
        let mut values: Vec<_> = values.map(|(name, len)| value_info(name, &[batch, Some(len)])).collect();
        made.graph.output.extend(values.pop());
        if spelling.other_names {
            values.reverse();
        }
        made.graph.input = values;
        made
    }

    pub fn names(&self) -> [&'static str; 4] {
        if self.spelling.other_names {
            ["a", "b", "c", "d"]
        } else {
            ["force", "speed", "texture", "magnitudes"]
        }
    }

    fn fresh(&mut self) -> String {
        self.count += 1;
        format!("t{}", self.count)
    }

    pub fn constant(&mut self, dims: &[usize], data: &[f32]) -> String {
        let mut t = tensor(&self.fresh(), dims, data);
        if self.spelling.typed_data {
            t.raw_data.clear();
            t.float_data = data.to_vec();
        }
        self.add_constant(t)
    }

    pub fn ints(&mut self, data: &[i64]) -> String {
        let t = int_tensor(&self.fresh(), data);
        self.add_constant(t)
    }

    fn add_constant(&mut self, t: TensorProto) -> String {
        let name = t.name.clone();
        if self.spelling.constant_nodes {
            let value = AttributeProto { name: "value".into(), t: Some(t), r#type: 4, ..Default::default() };
            self.graph.node.push(node("Constant", &[], &name, vec![value]));
        } else {
            self.graph.initializer.push(t);
        }
        name
    }

    pub fn node(&mut self, op: &str, inputs: &[&str], attribute: Vec<AttributeProto>) -> String {
        let name = self.fresh();
        self.graph.node.push(node(op, inputs, &name, attribute));
        name
    }

    pub fn normalise(&mut self, x: &str, mean: &[f32], deviation: &[f32]) -> String {
        let n = mean.len();
        let each = |x: &[f32], f: fn(f32) -> f32| x.iter().map(|x| f(*x)).collect::<Vec<f32>>();
        if self.spelling.multiply {
            let m = self.constant(&[1, n], &each(mean, |m| -m));
            let d = self.constant(&[n], &each(deviation, |d| 1.0 / d));
            let centred = self.node("Add", &[&m, x], vec![]);
            self.node("Mul", &[&centred, &d], vec![])
        } else {
            let (m, d) = (self.constant(&[n], mean), self.constant(&[1, n], deviation));
            let centred = self.node("Sub", &[x, &m], vec![]);
            self.node("Div", &[&centred, &d], vec![])
        }
    }

    pub fn product(&mut self, x: &str, layer: &Layer) -> String {
        let n = layer.bias.len();
        let k = layer.weights.len() / n;
        match self.spelling.product {
            Product::GemmTransB => {
                let turned: Vec<f32> =
                    (0..n).flat_map(|j| (0..k).map(move |i| layer.weights[i * n + j])).collect();
                let (w, b) = (self.constant(&[n, k], &turned), self.constant(&[n], &layer.bias));
                self.node("Gemm", &[x, &w, &b], vec![int("transB", 1)])
            }
            Product::Gemm => {
                // The stored numbers undo alpha and beta; powers of two, so exactly.
                let w: Vec<f32> = layer.weights.iter().map(|w| w * 2.0).collect();
                let b: Vec<f32> = layer.bias.iter().map(|b| b * 0.25).collect();
                let (w, b) = (self.constant(&[k, n], &w), self.constant(&[1, n], &b));
                self.node("Gemm", &[x, &w, &b], vec![float("alpha", 0.5), float("beta", 4.0)])
            }
            Product::MatMulAdd => {
                let (w, b) = (self.constant(&[k, n], &layer.weights), self.constant(&[n], &layer.bias));
                let y = self.node("MatMul", &[x, &w], vec![]);
                self.node("Add", &[&y, &b], vec![])
            }
        }
    }

    pub fn layers(&mut self, mut x: String, layers: &[Layer], last_clip: bool) -> String {
        for (i, layer) in layers.iter().enumerate() {
            x = self.product(&x, layer);
            if last_clip && i + 1 == layers.len() {
                x = if (1..11).contains(&self.spelling.opset) {
                    self.node("Clip", &[&x], vec![float("min", 0.0), float("max", 1e30)])
                } else {
                    let zero = self.constant(&[], &[0.0]);
                    self.node("Clip", &[&x, &zero], vec![])
                };
            } else {
                x = self.node("Relu", &[&x], vec![]);
            }
            if self.spelling.no_ops {
                x = match i % 4 {
                    0 => self.node("Identity", &[&x], vec![]),
                    1 => self.node("Flatten", &[&x], vec![int("axis", 1)]),
                    2 => {
                        let shape = self.ints(&[1, -1]);
                        self.node("Reshape", &[&x, &shape], vec![])
                    }
                    _ => self.node("Dropout", &[&x], vec![]),
                };
            }
        }
        x
    }

    pub fn concat(&mut self, parts: &[&str]) -> String {
        let axis = if self.spelling.concat_axis == 0 { 1 } else { self.spelling.concat_axis };
        self.node("Concat", parts, vec![int("axis", axis)])
    }

    pub fn finish(mut self, last: &str) -> ModelProto {
        let output = self.names()[3];
        self.graph.node.push(node("Identity", &[last], output, vec![]));
        self.model()
    }

    fn model(self) -> ModelProto {
        let version = if self.spelling.opset == 0 { 17 } else { self.spelling.opset };
        ModelProto {
            ir_version: 8,
            opset_import: vec![OperatorSetIdProto { domain: String::new(), version }],
            graph: Some(self.graph),
            ..Default::default()
        }
    }
}

/// The network as an ONNX model.
pub fn model(net: &Net, spelling: Spelling) -> ModelProto {
    scattering(net, spelling, &[])
}

/// Layers with ratios of 0.2 to 0.9 and variances of about 1, for hidden values as in `Net::random`.
pub fn heads(seed: u64) -> [(&'static str, Layer); 2] {
    let mut r = Random(seed);
    let mut layer = |outputs: usize, size: f64, bias: f32| Layer {
        weights: r.vector(100 * outputs, size),
        bias: vec![bias; outputs],
    };
    [("ratio", layer(100, 2e-3, 0.5)), ("variance", layer(1, 1e-2, 1.0))]
}

/// The network with named extra outputs from its last hidden layer.
pub fn scattering(net: &Net, spelling: Spelling, heads: &[(&str, Layer)]) -> ModelProto {
    let mut w = Writer::new(spelling);
    let [force, speed, texture, _] = w.names();
    let force = w.normalise(force, &net.force_mean, &net.force_deviation);
    let speed = w.normalise(speed, &net.speed_mean, &net.speed_deviation);
    let force = w.layers(force, &net.force, false);
    let speed = w.layers(speed, &net.speed, false);
    let joined = w.concat(&[&force, &speed]);
    let action = w.layers(joined, &net.action, false);
    let all = w.concat(&[texture, &action]);
    let (last, hidden) = net.predictor.split_last().unwrap();
    let hidden = w.layers(all, hidden, false);
    for (name, head) in heads {
        let out = w.layers(hidden.clone(), std::slice::from_ref(head), false);
        w.graph.node.push(node("Identity", &[&out], name, vec![]));
        let batch = if spelling.free_batch { None } else { Some(1) };
        w.graph.output.push(value_info(name, &[batch, Some(head.bias.len() as i64)]));
    }
    let out = w.layers(hidden, std::slice::from_ref(last), spelling.clip);
    let scale = w.constant(&[100], &net.output_scale);
    let out = w.node("Mul", &[&out, &scale], vec![]);
    w.finish(&out)
}

pub fn bytes(model: &ModelProto) -> Vec<u8> {
    model.encode_to_vec()
}

/// Textures, forces and speeds of ordinary size.
pub fn textures(count: usize, seed: u64) -> Vec<Vec<f32>> {
    let mut r = Random(seed);
    (0..count).map(|_| r.vector(256, 1.0)).collect()
}

pub fn motions(count: usize, seed: u64) -> Vec<(Vec<f32>, Vec<f32>)> {
    let mut r = Random(seed);
    let mut all = vec![(vec![0.0; 10], vec![0.0; 20]), (vec![50.0; 10], vec![2000.0; 20])];
    all.extend((0..count).map(|_| (r.vector(10, 3.0), r.vector(20, 200.0))));
    all
}

/// An encoder: means over tiles of 16 x 16 pixels, red's 12 rows of 16, then green's, then blue's,
/// weighted and summed to s. Number n of the result is s (1 + n / 256) + n step.
pub fn encoder(weights: &[f32], step: f32) -> ModelProto {
    let mut w = Writer::new(Spelling::default());
    w.graph.input = vec![value_info("image", &[Some(1), Some(3), Some(192), Some(256)])];
    w.graph.output = vec![value_info("texture", &[Some(1), Some(256)])];
    let pool = vec![ints("kernel_shape", &[16; 2]), ints("strides", &[16; 2])];
    let tiles = w.node("AveragePool", &["image"], pool);
    let flat = w.node("Flatten", &[&tiles], vec![int("axis", 1)]);
    let layer = Layer {
        weights: weights.iter().flat_map(|x| (0..256).map(move |n| x * (1.0 + n as f32 / 256.0))).collect(),
        bias: (0..256).map(|n| n as f32 * step).collect(),
    };
    w.product(&flat, &layer);
    w.graph.node.last_mut().expect("the product").output[0] = "texture".into();
    w.model()
}
