//! A graph, laid out in layers.

use std::collections::HashMap;

use super::layers::{Edge, Placement, cycle_closers, longest_path_layers};
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

/// The ports on one side of a box.
#[derive(Clone, Default)]
struct Side {
    ports: Vec<Port>,
}

#[derive(Clone)]
struct Port {
    name: String,
    /// Label of the wires of an output.
    label: String,
    /// Offset from the centre of the box.
    x: f64,
    /// Mean place of the other ends of its wires.
    pull: f64,
}

impl Port {
    /// Room left and right of its wire.
    fn room(&self) -> (f64, f64) {
        let name = text_width(&self.name, PORT_SIZE) / 2.0 + 7.0;
        let label = if self.label.is_empty() { 0.0 } else { text_width(&self.label, PORT_SIZE) + 14.0 };
        (name, name.max(label))
    }
}

impl Side {
    fn index(&mut self, name: &str, label: &str) -> usize {
        let found = self.ports.iter().position(|p| p.name == name);
        found.unwrap_or_else(|| {
            self.ports.push(Port { name: name.into(), label: label.into(), x: 0.0, pull: 0.0 });
            self.ports.len() - 1
        })
    }

    fn width(&self) -> f64 {
        self.ports.iter().map(|p| p.room().0 + p.room().1).sum()
    }

    /// Sets the ports side by side around the centre, in the order of `pull`.
    fn spread(&mut self) {
        let mut order: Vec<usize> = (0..self.ports.len()).collect();
        order.sort_by(|a, b| self.ports[*a].pull.total_cmp(&self.ports[*b].pull));
        if let [only] = self.ports.as_mut_slice() {
            only.x = 0.0;
            return;
        }
        let mut at = -self.width() / 2.0;
        for i in order {
            let (left, right) = self.ports[i].room();
            self.ports[i].x = at + left;
            at += left + right;
        }
    }
}

/// A wire with the indices of its boxes and ports.
struct Wire<'a> {
    wire: &'a GraphPictureWire,
    edge: Edge,
    ports: (usize, usize),
}

impl GraphPicture {
    /// The picture as an SVG document.
    pub fn to_svg(&self) -> String {
        let index: HashMap<&str, usize> =
            self.nodes.iter().enumerate().map(|(i, n)| (n.id.as_str(), i)).collect();
        let mut outputs = vec![Side::default(); self.nodes.len()];
        let mut inputs = vec![Side::default(); self.nodes.len()];
        let mut wires: Vec<Wire<'_>> = Vec::with_capacity(self.wires.len());
        for wire in &self.wires {
            let (Some(&from), Some(&to)) = (index.get(wire.from.0.as_str()), index.get(wire.to.0.as_str()))
            else {
                continue;
            };
            let ports = (outputs[from].index(&wire.from.1, &wire.label), inputs[to].index(&wire.to.1, ""));
            wires.push(Wire { wire, edge: Edge { from, to }, ports });
        }
        let all: Vec<Edge> = wires.iter().map(|w| w.edge).collect();
        let known: Vec<bool> = wires.iter().map(|w| w.wire.feedback).collect();
        let closes = cycle_closers(self.nodes.len(), &all, &known);
        let (back, forth): (Vec<_>, Vec<_>) = wires.into_iter().zip(closes).partition(|(_, closes)| *closes);
        let (back, forth): (Vec<_>, Vec<_>) =
            (back.into_iter().map(|w| w.0).collect(), forth.into_iter().map(|w| w.0).collect());

        let edges: Vec<Edge> = forth.iter().map(|w: &Wire<'_>| w.edge).collect();
        let layer = longest_path_layers(self.nodes.len(), &edges);
        let mut placement = Placement::order(&layer, &edges);
        let width: Vec<f64> = self
            .nodes
            .iter()
            .zip(inputs.iter().zip(&outputs))
            .map(|(n, (i, o))| (caption_width(n) + 28.0).max(i.width() + 8.0).max(o.width() + 8.0).max(92.0))
            .collect();
        // First with wires at the centres, then with ports in the order of their wires.
        placement.place(&width, &vec![(0.0, 0.0); edges.len()]);
        pull(&mut outputs, &mut inputs, &forth, &placement);
        outputs.iter_mut().chain(&mut inputs).for_each(Side::spread);
        let ends: Vec<(f64, f64)> = forth
            .iter()
            .map(|w| (outputs[w.edge.from].ports[w.ports.0].x, inputs[w.edge.to].ports[w.ports.1].x))
            .collect();
        let right = placement.place(&width, &ends);
        // Labels stand right of their wires and may reach past the boxes.
        let labels = outputs.iter().enumerate().flat_map(|(n, side)| side.ports.iter().map(move |p| (n, p)));
        let right = labels.map(|(n, p)| placement.x[n] + p.x + p.room().1).fold(right, f64::max);

        let layers = placement.layers.len().max(1) as f64;
        let lane = |i: usize| right + MARGIN + 18.0 + 14.0 * i as f64;
        let total = if back.is_empty() { right + 2.0 * MARGIN } else { lane(back.len() - 1) + MARGIN };
        let below_last = back.iter().any(|w| layer[w.edge.from] + 1 == placement.layers.len());
        let height = 2.0 * MARGIN + layers * (BOX_HEIGHT + GAP) - if below_last { 0.0 } else { GAP };
        let mut svg = Svg::new(total.max(200.0), height, "Graph");
        for (id, colour) in [("tip", WIRE), ("grey-tip", GREY)] {
            svg.raw(format_args!(
                "<marker id=\"{id}\" viewBox=\"0 0 8 8\" refX=\"7\" refY=\"4\" markerWidth=\"7\" \
                 markerHeight=\"7\" orient=\"auto\">\
                 <path d=\"M0 .8L7.5 4L0 7.2z\" fill=\"{colour}\"/></marker>\n"
            ));
        }
        let top = |layer: usize| MARGIN + layer as f64 * (BOX_HEIGHT + GAP);
        let x_of = |v: usize| MARGIN + placement.x[v];
        let grey = |w: &Wire<'_>| self.nodes[w.edge.from].dropped || self.nodes[w.edge.to].dropped;
        for ((w, chain), (start, end)) in forth.iter().zip(&placement.chains).zip(&ends) {
            let (mut d, mut from) = (String::new(), layer[w.edge.from]);
            let mut x = x_of(w.edge.from) + start;
            d += &format!("M{} {}", num(x), num(top(from) + BOX_HEIGHT));
            for (i, &v) in chain.iter().enumerate().skip(1) {
                let next = if i + 1 == chain.len() { x_of(v) + end } else { x_of(v) };
                let lead = if i == 1 { LEAD } else { 0.0 };
                let (a, b) = (top(from) + BOX_HEIGHT + lead, top(from + 1));
                let middle = (a + b) / 2.0;
                if i == 1 {
                    d += &format!("V{}", num(a));
                }
                let [x0, x1, m, y1] = [x, next, middle, b].map(num);
                d += &format!("C{x0} {m} {x1} {m} {x1} {y1}");
                if i + 1 < chain.len() {
                    d += &format!("V{}", num(b + BOX_HEIGHT));
                }
                (x, from) = (next, from + 1);
            }
            stroke(&mut svg, &d, grey(w), false);
        }
        for (i, w) in back.iter().enumerate() {
            let start = x_of(w.edge.from) + outputs[w.edge.from].ports[w.ports.0].x;
            let end = x_of(w.edge.to) + inputs[w.edge.to].ports[w.ports.1].x;
            // Out below one box, up a lane of its own, in above the other box.
            let below = top(layer[w.edge.from]) + BOX_HEIGHT + GAP * 0.55;
            let above = top(layer[w.edge.to]) - (GAP * 0.4).min(MARGIN * 0.6);
            let corner = 8.0;
            let d = format!(
                "M{sx} {sy}V{}q0 {c} {c} {c}H{}q{c} 0 {c} -{c}V{}q0 -{c} -{c} -{c}H{}q-{c} 0 -{c} {c}V{}",
                num(below - corner),
                num(lane(i) - corner),
                num(above + corner),
                num(end + corner),
                num(top(layer[w.edge.to])),
                sx = num(start),
                sy = num(top(layer[w.edge.from]) + BOX_HEIGHT),
                c = num(corner),
            );
            stroke(&mut svg, &d, grey(w), true);
        }
        for (n, node) in self.nodes.iter().enumerate() {
            let at = [x_of(n), top(layer[n])];
            draw_box(&mut svg, node, at, width[n], &inputs[n], &outputs[n]);
        }
        svg.finish()
    }
}

/// Sets the mean place of the other ends of the wires of every port.
fn pull(outputs: &mut [Side], inputs: &mut [Side], wires: &[Wire<'_>], placement: &Placement) {
    let mut counts: HashMap<(bool, usize, usize), (f64, f64)> = HashMap::new();
    for (w, chain) in wires.iter().zip(&placement.chains) {
        let (Some(second), Some(before_last)) = (chain.get(1), chain.len().checked_sub(2).map(|i| chain[i]))
        else {
            continue;
        };
        for (key, x) in [
            ((true, w.edge.from, w.ports.0), placement.x[*second]),
            ((false, w.edge.to, w.ports.1), placement.x[before_last]),
        ] {
            let sum = counts.entry(key).or_insert((0.0, 0.0));
            *sum = (sum.0 + x, sum.1 + 1.0);
        }
    }
    for (output, sides) in [(true, outputs), (false, inputs)] {
        for (n, side) in sides.iter_mut().enumerate() {
            for (p, port) in side.ports.iter_mut().enumerate() {
                // A port with feedback wires alone stands at the right end, where they run.
                port.pull = counts.get(&(output, n, p)).map_or(f64::MAX, |(sum, n)| sum / n);
            }
        }
    }
}

fn stroke(svg: &mut Svg, d: &str, grey: bool, dashed: bool) {
    let (colour, tip) = if grey { (GREY, "grey-tip") } else { (WIRE, "tip") };
    let dash = if dashed { " stroke-dasharray=\"5 4\"" } else { "" };
    svg.path(
        d,
        &format!("fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\"{dash} marker-end=\"url(#{tip})\""),
    );
}

fn caption_width(node: &GraphPictureNode) -> f64 {
    // Bold is wider than the estimate.
    text_width(&node.id, 13.0) * 1.08 + text_width(&second_line(node), 12.0) + 9.0
}

/// Text after the id: the kind unless it equals the id, and the note.
fn second_line(node: &GraphPictureNode) -> String {
    let kind = if node.kind == node.id { "" } else { node.kind.as_str() };
    match (kind.is_empty(), node.note.is_empty()) {
        (_, true) => kind.to_owned(),
        (true, false) => node.note.clone(),
        (false, false) => format!("{kind}, {}", node.note),
    }
}

fn draw_box(svg: &mut Svg, node: &GraphPictureNode, at: [f64; 2], width: f64, inputs: &Side, outputs: &Side) {
    let [x, y] = at;
    let look = match (node.dropped, inputs.ports.is_empty(), outputs.ports.is_empty()) {
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
    for port in &inputs.ports {
        svg.text([x + port.x, y + 13.0], "middle", "port", &port.name);
    }
    for port in &outputs.ports {
        svg.text([x + port.x, y + BOX_HEIGHT - 6.0], "middle", "port", &port.name);
        svg.text([x + port.x + 7.0, y + BOX_HEIGHT + 14.0], "start", "wire", &port.label);
    }
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
        let mut back = wire("c", "b");
        back.feedback = true;
        let picture = GraphPicture {
            nodes: ["a", "b", "c"].map(node).to_vec(),
            wires: vec![wire("a", "b"), wire("b", "c"), back, wire("c", "a"), wire("c", "c")],
        };
        let svg = picture.to_svg();
        tags(&svg);
        assert_eq!(svg.matches("stroke-dasharray=\"5 4\"").count(), 3);
    }

    #[test]
    fn empty_graph_is_an_empty_page() {
        tags(&GraphPicture::default().to_svg());
    }
}
