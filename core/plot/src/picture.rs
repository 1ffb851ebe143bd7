//! A graph, laid out in layers.

use std::collections::HashMap;

use super::layout::{Edge, Placement, cycle_closers, longest_path_layers};
use super::svg::{Svg, escape, num, text_width};

/// A box.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GraphPictureNode {
    /// Name of the node; wires refer to it.
    pub id: String,
    /// Kind of the node.
    pub kind: String,
    /// Text after the kind; may be empty.
    pub note: String,
    /// Whether the compiler dropped it: drawn grey.
    pub dropped: bool,
}

/// A wire from an output to an input.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GraphPictureWire {
    /// Node and output port; the port may be empty.
    pub from: (String, String),
    /// Node and input port; the port may be empty.
    pub to: (String, String),
    /// Label, such as a unit; may be empty.
    pub label: String,
    /// Whether it closes a cycle: drawn dashed, outside.
    pub feedback: bool,
}

/// A graph to draw: sources above, sinks below. Wires to unknown nodes are left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GraphPicture {
    /// Boxes; ids are unique.
    pub nodes: Vec<GraphPictureNode>,
    /// Wires.
    pub wires: Vec<GraphPictureWire>,
}

const MARGIN: f64 = 28.0;
const BOX_HEIGHT: f64 = 54.0;
const GAP: f64 = 54.0;
/// Straight part of a wire below its box, past its label.
const LEAD: f64 = 18.0;
const PORT_SIZE: f64 = 10.5;
const WIRE: &str = "#5b7083";
const GREY: &str = "#b4bec8";

/// A port of a box.
#[derive(Clone)]
struct Port {
    name: String,
    label: String,
    /// Offset from the centre of the box.
    x: f64,
}

impl Port {
    /// Room left and right of its wire.
    fn room(&self) -> (f64, f64) {
        let name = text_width(&self.name, PORT_SIZE) / 2.0 + 7.0;
        let label = if self.label.is_empty() { 0.0 } else { text_width(&self.label, PORT_SIZE) + 14.0 };
        (name, name.max(label))
    }
}

/// The index of a port of this name on a side of a box.
fn port(side: &mut Vec<Port>, name: &str, label: &str) -> usize {
    side.iter().position(|p| p.name == name).unwrap_or_else(|| {
        side.push(Port { name: name.into(), label: label.into(), x: 0.0 });
        side.len() - 1
    })
}

fn width(side: &[Port]) -> f64 {
    side.iter().map(|p| p.room().0 + p.room().1).sum()
}

/// Sets the ports of a side beside each other around the centre.
fn spread(side: &mut [Port]) {
    let mut at = if side.len() == 1 { -side[0].room().0 } else { -width(side) / 2.0 };
    for port in side {
        let (left, right) = port.room();
        port.x = at + left;
        at += left + right;
    }
}

/// A wire with its box and port at each end.
struct Wire {
    edge: Edge,
    ports: (usize, usize),
    feedback: bool,
}

/// A picture whose boxes have their places.
struct Laid<'a> {
    picture: &'a GraphPicture,
    /// Wires that follow the layers, and wires that close cycles.
    forth: Vec<Wire>,
    back: Vec<Wire>,
    inputs: Vec<Vec<Port>>,
    outputs: Vec<Vec<Port>>,
    width: Vec<f64>,
    layer: Vec<usize>,
    placement: Placement,
    /// The right edge of all boxes and labels.
    right: f64,
}

impl GraphPicture {
    /// The picture as an SVG document.
    pub fn to_svg(&self) -> String {
        self.laid().draw()
    }

    fn laid(&self) -> Laid<'_> {
        let index: HashMap<&str, usize> =
            self.nodes.iter().enumerate().map(|(i, n)| (n.id.as_str(), i)).collect();
        let mut outputs: Vec<Vec<Port>> = vec![Vec::new(); self.nodes.len()];
        let mut inputs = outputs.clone();
        let mut wires = Vec::with_capacity(self.wires.len());
        for GraphPictureWire { from, to, label, feedback } in &self.wires {
            if let (Some(&a), Some(&b)) = (index.get(from.0.as_str()), index.get(to.0.as_str())) {
                let ports = (port(&mut outputs[a], &from.1, label), port(&mut inputs[b], &to.1, ""));
                wires.push(Wire { edge: (a, b), ports, feedback: *feedback });
            }
        }
        let all: Vec<Edge> = wires.iter().map(|w| w.edge).collect();
        let known: Vec<bool> = wires.iter().map(|w| w.feedback).collect();
        for (wire, closes) in wires.iter_mut().zip(cycle_closers(self.nodes.len(), &all, &known)) {
            wire.feedback = closes;
        }
        let (back, forth): (Vec<Wire>, Vec<Wire>) = wires.into_iter().partition(|w| w.feedback);
        let edges: Vec<Edge> = forth.iter().map(|w| w.edge).collect();
        let layer = longest_path_layers(self.nodes.len(), &edges);
        let mut placement = Placement::new(&layer, &edges);
        let sides = inputs.iter().zip(&outputs).map(|(i, o)| width(i).max(width(o)) + 8.0);
        let width: Vec<f64> =
            self.nodes.iter().zip(sides).map(|(n, sides)| caption_width(n).max(sides).max(92.0)).collect();
        inputs.iter_mut().chain(&mut outputs).for_each(|side| spread(side));
        let ends = |w: &Wire| (outputs[w.edge.0][w.ports.0].x, inputs[w.edge.1][w.ports.1].x);
        let right = placement.place(&width, &forth.iter().map(ends).collect::<Vec<_>>());
        // Labels stand right of their wires and may reach past the boxes.
        let labels = outputs.iter().enumerate().flat_map(|(n, side)| side.iter().map(move |p| (n, p)));
        let right = labels.map(|(n, p)| placement.x[n] + p.x + p.room().1).fold(right, f64::max);
        Laid { picture: self, forth, back, inputs, outputs, width, layer, placement, right }
    }
}

fn top(layer: usize) -> f64 {
    MARGIN + layer as f64 * (BOX_HEIGHT + GAP)
}

impl Laid<'_> {
    fn draw(&self) -> String {
        let lane = |i: usize| self.right + MARGIN + 18.0 + 14.0 * i as f64;
        let width = match self.back.len() {
            0 => self.right + 2.0 * MARGIN,
            n => lane(n - 1) + MARGIN,
        };
        let layers = self.placement.layers.len();
        let below_last = self.back.iter().any(|w| self.layer[w.edge.0] + 1 == layers);
        let height = top(layers.max(1)) + MARGIN - if below_last { 0.0 } else { GAP };
        let mut svg = Svg::new(width.max(200.0), height, "Graph");
        for (id, colour) in [("tip", WIRE), ("grey-tip", GREY)] {
            svg.raw(format_args!(
                "<marker id=\"{id}\" viewBox=\"0 0 8 8\" refX=\"7\" refY=\"4\" markerWidth=\"7\" \
                 markerHeight=\"7\" orient=\"auto\">\
                 <path d=\"M0 .8L7.5 4L0 7.2z\" fill=\"{colour}\"/></marker>\n"
            ));
        }
        for (w, chain) in self.forth.iter().zip(&self.placement.chains) {
            self.stroke(&mut svg, w, &self.forward(w, chain));
        }
        for (i, w) in self.back.iter().enumerate() {
            self.stroke(&mut svg, w, &self.backward(w, lane(i)));
        }
        for n in 0..self.picture.nodes.len() {
            self.draw_box(&mut svg, n);
        }
        svg.finish()
    }

    fn ends(&self, w: &Wire) -> (f64, f64) {
        let (from, to) = (&self.outputs[w.edge.0][w.ports.0], &self.inputs[w.edge.1][w.ports.1]);
        let at = |node: usize| MARGIN + self.placement.x[node];
        (at(w.edge.0) + from.x, at(w.edge.1) + to.x)
    }

    /// Down from box to box, straight past the layers between.
    fn forward(&self, w: &Wire, chain: &[usize]) -> String {
        let (mut x, end) = self.ends(w);
        let foot = top(self.layer[w.edge.0]) + BOX_HEIGHT;
        let mut d = format!("M{} {}V{}", num(x), num(foot), num(foot + LEAD));
        for (i, &v) in chain.iter().enumerate().skip(1) {
            let last = i + 1 == chain.len();
            let next = if last { end } else { MARGIN + self.placement.x[v] };
            let b = top(self.layer[w.edge.0] + i);
            let a = b - GAP + if i == 1 { LEAD } else { 0.0 };
            let [x0, x1, middle, y1] = [x, next, (a + b) / 2.0, b].map(num);
            d += &format!("C{x0} {middle} {x1} {middle} {x1} {y1}");
            if !last {
                d += &format!("V{}", num(b + BOX_HEIGHT));
            }
            x = next;
        }
        d
    }

    /// Out below one box, up a lane of its own, in above the other box.
    fn backward(&self, w: &Wire, lane: f64) -> String {
        let (start, end) = self.ends(w);
        let (foot, head) = (top(self.layer[w.edge.0]) + BOX_HEIGHT, top(self.layer[w.edge.1]));
        let (below, above, corner) = (foot + GAP * 0.55, head - (GAP * 0.4).min(MARGIN * 0.6), 8.0);
        format!(
            "M{} {}V{}q0 {c} {c} {c}H{}q{c} 0 {c} -{c}V{}q0 -{c} -{c} -{c}H{}q-{c} 0 -{c} {c}V{}",
            num(start),
            num(foot),
            num(below - corner),
            num(lane - corner),
            num(above + corner),
            num(end + corner),
            num(head),
            c = num(corner),
        )
    }

    fn stroke(&self, svg: &mut Svg, w: &Wire, d: &str) {
        let grey = self.picture.nodes[w.edge.0].dropped || self.picture.nodes[w.edge.1].dropped;
        let (colour, tip) = if grey { (GREY, "grey-tip") } else { (WIRE, "tip") };
        let dash = if w.feedback { " stroke-dasharray=\"5 4\"" } else { "" };
        let stroke = format!("stroke=\"{colour}\" stroke-width=\"1.5\"{dash} marker-end=\"url(#{tip})\"");
        svg.path(d, &format!("fill=\"none\" {stroke}"));
    }

    fn draw_box(&self, svg: &mut Svg, n: usize) {
        let (node, inputs, outputs) = (&self.picture.nodes[n], &self.inputs[n], &self.outputs[n]);
        let (x, y, width) = (MARGIN + self.placement.x[n], top(self.layer[n]), self.width[n]);
        let look = match (node.dropped, inputs.is_empty(), outputs.is_empty()) {
            (true, ..) => "fill=\"#f7f8f9\" stroke=\"#b4bec8\" stroke-dasharray=\"4 3\"",
            (false, true, _) => "fill=\"#eef7f0\" stroke=\"#5f9c77\"",
            (false, _, true) => "fill=\"#fdf2ec\" stroke=\"#c97b52\"",
            _ => "fill=\"#f1f6fa\" stroke=\"#7d9bb5\"",
        };
        svg.rect([x - width / 2.0, y], [width, BOX_HEIGHT], &format!("rx=\"8\" stroke-width=\"1.2\" {look}"));
        let grey = if node.dropped { " fill-opacity=\"0.55\"" } else { "" };
        let after = second_line(node);
        let gap = if after.is_empty() { "" } else { " dx=\"8\"" };
        svg.raw(format_args!(
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\"{grey}><tspan class=\"head\">{}</tspan>\
             <tspan{gap}>{}</tspan></text>\n",
            num(x),
            num(y + BOX_HEIGHT / 2.0 + 4.5),
            escape(&node.id),
            escape(&after)
        ));
        for port in inputs {
            svg.text([x + port.x, y + 13.0], "middle", "port", &port.name);
        }
        for port in outputs {
            svg.text([x + port.x, y + BOX_HEIGHT - 6.0], "middle", "port", &port.name);
            svg.text([x + port.x + 7.0, y + BOX_HEIGHT + 14.0], "start", "wire", &port.label);
        }
    }
}

/// Width of the text in a box, with room beside it.
fn caption_width(node: &GraphPictureNode) -> f64 {
    // Bold is wider than the estimate.
    text_width(&node.id, 13.0) * 1.08 + text_width(&second_line(node), 12.0) + 37.0
}

/// Text after the id: the kind unless it equals the id, and the note.
fn second_line(node: &GraphPictureNode) -> String {
    let kind = if node.kind == node.id { "" } else { node.kind.as_str() };
    let comma = if kind.is_empty() || node.note.is_empty() { "" } else { ", " };
    format!("{kind}{comma}{}", node.note)
}

#[cfg(test)]
mod tests {
    use super::super::tests::tags;
    use super::*;

    fn node(id: &str) -> GraphPictureNode {
        GraphPictureNode { id: id.into(), kind: "k".into(), ..GraphPictureNode::default() }
    }

    fn wire(from: &str, to: &str) -> GraphPictureWire {
        GraphPictureWire {
            from: (from.into(), "o".into()),
            to: (to.into(), "i".into()),
            ..GraphPictureWire::default()
        }
    }

    #[test]
    fn every_node_and_wire_is_drawn() {
        let picture = GraphPicture {
            nodes: ["a", "b<&>", "c", "lone"].map(node).to_vec(),
            wires: vec![wire("a", "b<&>"), wire("b<&>", "c"), wire("a", "c"), wire("a", "nobody")],
        };
        let svg = picture.to_svg();
        let count = tags(&svg);
        assert_eq!(count["rect"], 1 + 4, "the ground and four boxes");
        assert_eq!(svg.matches("marker-end").count(), 3);
        assert!(svg.contains("b&lt;&amp;&gt;"));
    }

    #[test]
    fn cycles_are_drawn_dashed() {
        let back = GraphPictureWire { feedback: true, ..wire("c", "b") };
        let picture = GraphPicture {
            nodes: ["a", "b", "c"].map(node).to_vec(),
            wires: vec![wire("a", "b"), wire("b", "c"), back, wire("c", "a"), wire("c", "c")],
        };
        let svg = picture.to_svg();
        tags(&svg);
        assert_eq!(svg.matches("stroke-dasharray=\"5 4\"").count(), 3);
        tags(&GraphPicture::default().to_svg());
    }
}
