//! Writes networks as ONNX with only Conv, MaxPool, Flatten, Gemm, Relu, Exp, Concat, Mul and Add.

use asperity_data::HISTORY;
use asperity_texture::VECTOR_LEN;
use asperity_texture::picture::IMAGE;
use prost::Message;
use tract_onnx::pb;

use crate::data::Reach;
use crate::encoder::{GEOMETRY, Kernel, PIXEL_SCALE, POOL};
use crate::layer::Weights;
use crate::loss::Target;
use crate::network::NetworkWeights;

/// Version of the file format: ONNX 1.8, known to every current reader.
const IR_VERSION: i64 = 7;
const OPSET: i64 = 13;

/// Keys and values of a file's metadata.
pub(crate) type About<'a> = &'a [(&'a str, String)];

/// Bytes of the tick network.
///
/// Inputs are `force` \[1, 10\] in N, `speed` \[1, 20\] in mm/s and `texture` \[1, 256\]. The first
/// output is `magnitudes` \[1, 100\] in m/s^2. A network for root mean squares also has `ratio` \[1,
/// 100\] and `variance` \[1, 1\]. The metadata hold the trained range, the target, and `about`.
pub(crate) fn network(network: &NetworkWeights, target: Target, reach: Reach, about: About<'_>) -> Vec<u8> {
    let mut graph = Graph::default();
    let force = graph.chain("force", "force", &network.force, Some("force_features"));
    let speed = graph.chain("speed", "speed", &network.speed, Some("speed_features"));
    let joined = graph.concat("action_input", [force, speed]);
    let action = graph.chain("action", &joined, &network.action, Some("action_features"));
    let joined = graph.concat("predictor_input", ["texture".to_owned(), action]);
    let hidden = graph.chain("predictor", &joined, &network.predictor, None);
    // One layer for each output: in f16 and int8 networks layers of this size keep f32 weights.
    let mut outputs = Vec::new();
    let mut head = |op: &str, name: &'static str, layer: &Weights| {
        let gemm = format!("{name}.gemm");
        graph.gemm(name, hidden.clone(), layer, &gemm);
        graph.node(op, &format!("{name}.out"), vec![gemm], name);
        outputs.push(value(name, &[1, layer.outputs]));
    };
    head("Exp", "magnitudes", &network.magnitudes);
    if target == Target::Rms {
        head("Relu", "ratio", &network.ratio);
        head("Relu", "variance", &network.variance);
    }
    let mut known = vec![
        ("force_max_n", reach.force_n.to_string()),
        ("speed_max_mm_s", reach.speed_mm_s.to_string()),
        ("target", target.name().to_owned()),
    ];
    known.extend_from_slice(about);
    graph.file(
        "texture_network",
        "10 forces [N], 10 vx and 10 vy [mm/s], a material's vector, to the amplitudes [m/s^2] of the \
         next 0.1 s of acceleration at 10, 20, .. 1000 Hz. `ratio` is mean over root mean square of each \
         amplitude, `variance` is the variance of the sum of their squares over its squared mean.",
        [("force", HISTORY), ("speed", 2 * HISTORY), ("texture", VECTOR_LEN)]
            .map(|(name, len)| value(name, &[1, len]))
            .into(),
        outputs,
        &known,
    )
}

/// Bytes of image encoder and texture encoder in one model: from `image` \[1, 3, 192, 256\] of 0 to 1
/// to `texture` \[1, 256\].
pub(crate) fn encoder(kernels: &[Kernel], head: &[Weights], about: About<'_>) -> Vec<u8> {
    let mut graph = Graph::default();
    let (scale, offset) = PIXEL_SCALE;
    graph.tensor("scale".to_owned(), &[1], &[scale]);
    graph.tensor("offset".to_owned(), &[1], &[-scale * offset]);
    let mut x = graph.step("Mul", "scaled", vec!["image".to_owned(), "scale".to_owned()], &[]);
    x = graph.step("Add", "centred", vec![x, "offset".to_owned()], &[]);
    for (i, (kernel, geometry)) in kernels.iter().zip(GEOMETRY).enumerate() {
        let part = |what: &str| format!("image.{i}.{what}");
        graph.tensor(part("weight"), &kernel.shape, &kernel.weight);
        graph.tensor(part("bias"), &kernel.shape[..1], &kernel.bias);
        let inputs = vec![x, part("weight"), part("bias")];
        x = graph.step(
            "Conv",
            &part("conv"),
            inputs,
            &[
                ("kernel_shape", &[geometry.kernel; 2]),
                ("strides", &[geometry.stride; 2]),
                ("pads", &[geometry.padding; 4]),
            ],
        );
        x = graph.step("Relu", &part("relu"), vec![x], &[]);
        if geometry.pooled {
            let shape: [(&str, &[usize]); 2] = [("kernel_shape", &[POOL.0; 2]), ("strides", &[POOL.1; 2])];
            x = graph.step("MaxPool", &part("pool"), vec![x], &shape);
        }
    }
    x = graph.step("Flatten", "features", vec![x], &[]);
    let (hidden, last) = head.split_at(head.len().saturating_sub(1));
    x = graph.chain("head", &x, hidden, None);
    for layer in last {
        graph.gemm("head.last", x.clone(), layer, "texture");
    }
    graph.file(
        "tactile_encoder",
        "From a tactile image, red, green and blue from 0 to 1, to a material's vector.",
        vec![value("image", &[1, 3, IMAGE[0], IMAGE[1]])],
        vec![value("texture", &[1, VECTOR_LEN])],
        about,
    )
}

#[derive(Default)]
struct Graph {
    nodes: Vec<pb::NodeProto>,
    tensors: Vec<pb::TensorProto>,
}

impl Graph {
    fn node(&mut self, op: &str, name: &str, inputs: Vec<String>, output: &str) -> &mut pb::NodeProto {
        self.nodes.push(pb::NodeProto {
            input: inputs,
            output: vec![output.to_owned()],
            name: name.to_owned(),
            op_type: op.to_owned(),
            ..Default::default()
        });
        let last = self.nodes.len() - 1;
        &mut self.nodes[last]
    }

    /// A node with its output's name and integer-list attributes.
    fn step(&mut self, op: &str, name: &str, inputs: Vec<String>, lists: &[(&str, &[usize])]) -> String {
        let node = self.node(op, name, inputs, name);
        node.attribute.extend(lists.iter().map(|(key, numbers)| pb::AttributeProto {
            name: (*key).to_owned(),
            r#type: pb::attribute_proto::AttributeType::Ints as i32,
            ints: numbers.iter().map(|n| *n as i64).collect(),
            ..Default::default()
        }));
        name.to_owned()
    }

    fn concat(&mut self, name: &str, inputs: [String; 2]) -> String {
        let node = self.node("Concat", name, inputs.to_vec(), name);
        node.attribute.push(pb::AttributeProto {
            name: "axis".to_owned(),
            r#type: pb::attribute_proto::AttributeType::Int as i32,
            i: 1,
            ..Default::default()
        });
        name.to_owned()
    }

    fn gemm(&mut self, name: &str, input: String, layer: &Weights, output: &str) {
        let (weight, bias) = (format!("{name}.weight"), format!("{name}.bias"));
        self.tensor(weight.clone(), &[layer.inputs, layer.outputs], &layer.weight);
        self.tensor(bias.clone(), &[layer.outputs], &layer.bias);
        self.node("Gemm", &format!("{name}.gemm"), vec![input, weight, bias], output);
    }

    /// Layers with a ReLU after each; `output` names the last value if given.
    fn chain(&mut self, name: &str, input: &str, layers: &[Weights], output: Option<&str>) -> String {
        let mut x = input.to_owned();
        for (i, layer) in layers.iter().enumerate() {
            let (part, gemm, relu) =
                (format!("{name}.{i}"), format!("{name}.{i}.gemm"), format!("{name}.{i}.relu"));
            self.gemm(&part, x, layer, &gemm);
            x = match output {
                Some(output) if i + 1 == layers.len() => output.to_owned(),
                _ => relu.clone(),
            };
            self.node("Relu", &relu, vec![gemm], &x);
        }
        x
    }

    fn tensor(&mut self, name: String, shape: &[usize], numbers: &[f32]) {
        self.tensors.push(pb::TensorProto {
            dims: shape.iter().map(|&n| n as i64).collect(),
            data_type: pb::tensor_proto::DataType::Float as i32,
            name,
            raw_data: numbers.iter().flat_map(|x| x.to_le_bytes()).collect(),
            ..Default::default()
        });
    }

    fn file(
        self,
        name: &str,
        doc: &str,
        inputs: Vec<pb::ValueInfoProto>,
        outputs: Vec<pb::ValueInfoProto>,
        about: About<'_>,
    ) -> Vec<u8> {
        let model = pb::ModelProto {
            ir_version: IR_VERSION,
            opset_import: vec![pb::OperatorSetIdProto { domain: String::new(), version: OPSET }],
            producer_name: "asperity-train".to_owned(),
            producer_version: env!("CARGO_PKG_VERSION").to_owned(),
            doc_string: doc.to_owned(),
            metadata_props: about
                .iter()
                .map(|(key, value)| pb::StringStringEntryProto {
                    key: (*key).to_owned(),
                    value: value.clone(),
                })
                .collect(),
            graph: Some(pb::GraphProto {
                name: name.to_owned(),
                node: self.nodes,
                initializer: self.tensors,
                input: inputs,
                output: outputs,
                ..Default::default()
            }),
            ..Default::default()
        };
        model.encode_to_vec()
    }
}

fn value(name: &str, shape: &[usize]) -> pb::ValueInfoProto {
    use pb::tensor_shape_proto::{Dimension, dimension::Value};
    let dim = |n: &usize| Dimension { value: Some(Value::DimValue(*n as i64)), ..Default::default() };
    let tensor = pb::type_proto::Tensor {
        elem_type: pb::tensor_proto::DataType::Float as i32,
        shape: Some(pb::TensorShapeProto { dim: shape.iter().map(dim).collect() }),
    };
    pb::ValueInfoProto {
        name: name.to_owned(),
        r#type: Some(pb::TypeProto {
            value: Some(pb::type_proto::Value::TensorType(tensor)),
            ..Default::default()
        }),
        ..Default::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encoder::{FEATURES, Head, ImageEncoder, PIXELS, Preset, features};
    use crate::layer::{all_relu, numbers, rows};
    use crate::network::{Network, Scaling};
    use asperity_numbers::Random;
    use asperity_texture::picture::Image;
    use asperity_texture::{Answer, Choice, Encoder, Model, Precision};
    use burn::tensor::Device;

    fn apart(a: &[f32], b: &[f32]) -> f32 {
        let most = b.iter().fold(1e-6_f32, |most, x| most.max(x.abs()));
        a.iter().zip(b).fold(0.0_f32, |far, (a, b)| far.max((a - b).abs())) / most
    }

    #[test]
    fn written_encoder_answers_as_trained_one_at_both_sizes() {
        asperity_texture::run_graphs_by(asperity_tract::compile);
        let (device, random) = (Device::flex(), &mut Random::new(8));
        let image = Image { size: IMAGE, pixels: (0..PIXELS).map(|_| random.below(256) as u8).collect() };
        for preset in [Preset::Compact, Preset::Paper] {
            let images = ImageEncoder::new(preset, random, &device);
            // Stage two's scale of features is folded in.
            let scale = 0.7;
            let plain = features(&images, &[&image], &device);
            let looks: Vec<f32> = plain.iter().map(|x| scale * x).collect();
            let classifier = Head::classifier(preset, 3, random, &device);
            let head = Head::texture(&classifier, (std::slice::from_ref(&looks), scale), random, &device);
            let widths: Vec<usize> = head.weights(1.0, 1.0).iter().map(|w| w.outputs).collect();
            assert_eq!(widths, if preset == Preset::Paper { [4096, 512, 256] } else { [192, 512, 256] });
            let row = |x: Vec<f32>| rows(x, FEATURES, &device);
            // It starts as the classifier, with components of about 1.
            let hidden = |head: &Head, x: Vec<f32>| numbers(all_relu(&head.layers[..2], row(x)));
            let (hidden, begun) = (hidden(&head, looks.clone()), hidden(&classifier, plain));
            assert!(apart(&hidden, &begun) < 1e-4, "{preset:?}: {}", apart(&hidden, &begun));
            let trained: Vec<f32> = numbers(head.forward(row(looks))).into_iter().map(|x| 0.5 * x).collect();
            let rms = (trained.iter().map(|x| x * x).sum::<f32>() / 256.0).sqrt();
            assert!((0.25..1.0).contains(&rms), "{preset:?}: {rms}");
            let bytes = encoder(&images.kernels(), &head.weights(scale, 0.5), &[]);
            let written = Encoder::from_bytes(&bytes, "e.onnx").unwrap().encode(&image).unwrap();
            assert!(apart(&written, &trained) < 1e-4, "{preset:?}: {}", apart(&written, &trained));
        }
    }

    #[test]
    fn written_network_answers_as_trained_one_and_has_its_range() {
        let (device, random) = (Device::flex(), &mut Random::new(9));
        let reach = Reach { force_n: 6.0, speed_mm_s: 500.0 };
        let scaling = Scaling::of(reach);
        let trained = Network::new(random, &device).scattered(random, &device);
        let about = [("settings", "{}".to_owned())];
        let write = |target| network(&trained.weights(scaling), target, reach, &about);
        let written = Model::from_bytes(&write(Target::Rms), "t.onnx").unwrap();
        assert_eq!(written.target(), asperity_texture::Target::RootMeanSquare);
        let mean = Model::from_bytes(&write(Target::Mean), "m.onnx").unwrap();
        assert_eq!((mean.target(), mean.answers_scatter()), (asperity_texture::Target::Mean, false));
        assert_eq!(written.trained().force_max_n.zip(written.trained().speed_max_mm_s), Some((6.0, 500.0)));
        let force: [f32; HISTORY] = std::array::from_fn(|_| random.range(0.0, 6.0) as f32);
        let speed: [f32; 2 * HISTORY] = std::array::from_fn(|_| random.range(-350.0, 350.0) as f32);
        let vector: Vec<f32> = (0..VECTOR_LEN).map(|_| random.range(-1.0, 1.0) as f32).collect();
        let row = |x: Vec<f32>| {
            let width = x.len();
            rows(x, width, &device)
        };
        let scaled_force = force.map(|f| scaling.force.0 * (f - scaling.force.1)).to_vec();
        let scaled_speed = speed.map(|v| scaling.speed * v).to_vec();
        let answers = trained.forward(row(scaled_force), row(scaled_speed), row(vector.clone()));
        let mut runner = written.runner(&[vector], Precision::F32, Choice::Auto).unwrap();
        let mut found = Answer::default();
        runner.answer(0, &force, &speed, &mut found).unwrap();
        for (answer, found, most) in [
            (answers.magnitudes, &found.magnitudes[..], f32::MAX),
            (answers.ratio, &found.ratio, 1.0),
            (answers.variance, &[found.variance], f32::MAX),
        ] {
            let answer: Vec<f32> = numbers(answer).into_iter().map(|m| m.clamp(0.0, most)).collect();
            assert!(answer.iter().any(|m| *m > 0.0 && *m < most), "{answer:?}");
            assert!(apart(found, &answer) < 1e-4, "{}", apart(found, &answer));
        }
    }
}
