//! Writes the network as ONNX: Gemm, Relu and Concat, nothing else.

use prost::Message;
use tract_onnx::pb;

use crate::network::{NetworkWeights, Weights};
use asperity_dataset::HISTORY;
use asperity_world::material::{BINS, VECTOR_LEN};

/// Version of the file format: that of ONNX 1.8, which every current reader knows.
const IR_VERSION: i64 = 7;
/// Version of the operators.
const OPSET: i64 = 13;

/// The bytes of an ONNX file with inputs `force` \[1, 10\] N, `speed` \[1, 20\] mm/s and `texture` \[1, 256\] and
/// the output `magnitudes` \[1, 100\] m/s^2. `about` goes into the file's metadata.
pub(crate) fn encode(network: &NetworkWeights, about: &[(&str, String)]) -> Vec<u8> {
    let mut graph = Graph::default();
    let force = graph.chain("force", "force", &network.force, "force_features");
    let speed = graph.chain("speed", "speed", &network.speed, "speed_features");
    let joined = graph.concat("action_input", [force, speed]);
    let action = graph.chain("action", &joined, &network.action, "action_features");
    let joined = graph.concat("predictor_input", ["texture".to_owned(), action]);
    graph.chain("predictor", &joined, &network.predictor, "magnitudes");
    let model = pb::ModelProto {
        ir_version: IR_VERSION,
        opset_import: vec![pb::OperatorSetIdProto { domain: String::new(), version: OPSET }],
        producer_name: "asperity-train".to_owned(),
        producer_version: env!("CARGO_PKG_VERSION").to_owned(),
        doc_string: "Texture network: 10 forces [N], 10 vx and 10 vy [mm/s], a material's vector, to the \
                     amplitudes [m/s^2] of the next 0.1 s of acceleration at 10, 20, .. 1000 Hz."
            .to_owned(),
        metadata_props: about
            .iter()
            .map(|(key, value)| pb::StringStringEntryProto { key: (*key).to_owned(), value: value.clone() })
            .collect(),
        graph: Some(pb::GraphProto {
            name: "texture_network".to_owned(),
            node: graph.nodes,
            initializer: graph.tensors,
            input: vec![value("force", HISTORY), value("speed", 2 * HISTORY), value("texture", VECTOR_LEN)],
            output: vec![value("magnitudes", BINS)],
            ..Default::default()
        }),
        ..Default::default()
    };
    model.encode_to_vec()
}

#[derive(Default)]
struct Graph {
    nodes: Vec<pb::NodeProto>,
    tensors: Vec<pb::TensorProto>,
}

impl Graph {
    fn node(&mut self, op: &str, name: &str, inputs: Vec<String>, output: &str) -> usize {
        self.nodes.push(pb::NodeProto {
            input: inputs,
            output: vec![output.to_owned()],
            name: name.to_owned(),
            op_type: op.to_owned(),
            ..Default::default()
        });
        self.nodes.len() - 1
    }

    fn concat(&mut self, name: &str, inputs: [String; 2]) -> String {
        let node = self.node("Concat", name, inputs.to_vec(), name);
        self.nodes[node].attribute.push(pb::AttributeProto {
            name: "axis".to_owned(),
            r#type: pb::attribute_proto::AttributeType::Int as i32,
            i: 1,
            ..Default::default()
        });
        name.to_owned()
    }

    /// Layers with a ReLU after each; the last ReLU's value is called `output`.
    fn chain(&mut self, name: &str, input: &str, layers: &[Weights], output: &str) -> String {
        let mut x = input.to_owned();
        for (i, layer) in layers.iter().enumerate() {
            let part = |what: &str| format!("{name}.{i}.{what}");
            self.tensor(part("weight"), &[layer.inputs, layer.outputs], &layer.weight);
            self.tensor(part("bias"), &[layer.outputs], &layer.bias);
            let (gemm, relu) = (part("gemm"), part("relu"));
            self.node("Gemm", &gemm, vec![x, part("weight"), part("bias")], &gemm);
            x = if i + 1 == layers.len() { output.to_owned() } else { relu.clone() };
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
}

fn value(name: &str, width: usize) -> pb::ValueInfoProto {
    use pb::tensor_shape_proto::{Dimension, dimension::Value};
    let dim = |n: usize| Dimension { value: Some(Value::DimValue(n as i64)), ..Default::default() };
    let tensor = pb::type_proto::Tensor {
        elem_type: pb::tensor_proto::DataType::Float as i32,
        shape: Some(pb::TensorShapeProto { dim: vec![dim(1), dim(width)] }),
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
