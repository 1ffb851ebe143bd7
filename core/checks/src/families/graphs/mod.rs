//! Graphs of any shape and size.

mod drawn;
mod shapes;
mod twice;
mod types;

pub use drawn::{Became, Drawn, drawn};

use crate::case::{Case, Family};

pub(super) const CASES: &[Case] = &[
    Case {
        family: Family::Graphs,
        name: "one_to_5000_nodes",
        hard: "chains, fan-out and fan-in, diamonds in a row, delayed loops in a row, and a hundred sources before a chain that a hundred sinks look at: of 1 to 5000 nodes, or the least that has a sink",
        must: "one node alone is refused, as nobody hears it; each other loads and runs without a fault, and what comes out is what goes in, within 10^-6; the schedule has at most 3 steps a node, and its lists of paths name at most 20 nodes a node and \
               2 10^5 more",
        of_graph: false,
        run: shapes::run,
    },
    Case {
        family: Family::Graphs,
        name: "random_graphs",
        hard: "graphs of up to 40 nodes of any kinds, with parameters and wires drawn at random, most of which fit, some of which do not",
        must: "one that loads runs for 60 ticks, finite, without a fault but numbers beyond all bounds in a loop, which are contained; one that does not load says why, at a place in its file",
        of_graph: false,
        run: drawn::run,
    },
    Case {
        family: Family::Graphs,
        name: "same_bytes",
        hard: "the graph is compiled and run twice, tick by tick beside each other",
        must: "every output of every node is the same in every tick, to the bit",
        of_graph: true,
        run: twice::run,
    },
];
