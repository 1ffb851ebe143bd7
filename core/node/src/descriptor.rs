//! What a node says of itself, before there is one.

use std::borrow::Cow;

use crate::{Input, Output, Param};

/// What the engine does with a node that slept, when it wakes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Resume {
    /// The node is reset, as if the graph began.
    #[default]
    Restart,
    /// The node is told how many ticks it missed.
    Elapsed,
    /// The node goes on as it was: what it puts out depends on the tick and its inputs, not on how often
    /// it was called.
    Resume,
    /// The node never sleeps: what it remembers must stay up to date.
    Never,
}

impl Resume {
    /// The word a person reads.
    pub fn word(self) -> &'static str {
        match self {
            Resume::Restart => "restart",
            Resume::Elapsed => "elapsed time",
            Resume::Resume => "resuming",
            Resume::Never => "nothing: it never sleeps",
        }
    }
}

/// Kind, ports and parameters of a node.
#[derive(Clone, Debug)]
pub struct Descriptor {
    /// Name in a graph file: lower case, words joined by `_`.
    pub kind: Cow<'static, str>,
    /// What it does, in a sentence.
    pub summary: Cow<'static, str>,
    /// Inputs. Where they depend on parameters, these are the ones of the defaults.
    pub inputs: Vec<Input>,
    /// Outputs. Where they depend on parameters, these are the ones of the defaults.
    pub outputs: Vec<Output>,
    /// Parameters.
    pub params: Vec<Param>,
    /// How it wakes.
    pub resume: Resume,
    /// Whether a graph wants it for its own sake; what leads to no sink is not built.
    pub sink: bool,
    /// Whether a sink only looks on: what it reads may sleep as if it were not there.
    pub passive: bool,
    /// The input that this node gates: while its `wants` answers no, what serves that input alone sleeps.
    pub gate: Option<Cow<'static, str>>,
    /// Names the parameter that says how long it delays, for a node that can close a cycle: its output in
    /// a tick then does not need its input in that tick.
    pub feedback: Option<Cow<'static, str>>,
    /// What there is to say of latency and tail; empty where both are zero.
    pub timing: Cow<'static, str>,
}

impl Descriptor {
    /// A node without ports or parameters yet.
    pub fn new(kind: impl Into<Cow<'static, str>>, summary: impl Into<Cow<'static, str>>) -> Self {
        Self {
            kind: kind.into(),
            summary: summary.into(),
            inputs: Vec::new(),
            outputs: Vec::new(),
            params: Vec::new(),
            resume: Resume::Restart,
            sink: false,
            passive: false,
            gate: None,
            feedback: None,
            timing: Cow::Borrowed(""),
        }
    }

    /// Adds an input.
    #[must_use]
    pub fn input(mut self, input: Input) -> Self {
        self.inputs.push(input);
        self
    }

    /// Adds an output.
    #[must_use]
    pub fn output(mut self, output: Output) -> Self {
        self.outputs.push(output);
        self
    }

    /// Adds a parameter.
    #[must_use]
    pub fn param(mut self, param: Param) -> Self {
        self.params.push(param);
        self
    }

    /// Says how the node wakes.
    #[must_use]
    pub fn resumes(mut self, resume: Resume) -> Self {
        self.resume = resume;
        self
    }

    /// A sink: wanted for its own sake.
    #[must_use]
    pub fn sink(mut self) -> Self {
        self.sink = true;
        self
    }

    /// A sink that only looks on, and keeps nothing awake.
    #[must_use]
    pub fn passive_sink(mut self) -> Self {
        (self.sink, self.passive) = (true, true);
        self
    }

    /// A gate on one of its inputs.
    #[must_use]
    pub fn gates(mut self, input: impl Into<Cow<'static, str>>) -> Self {
        self.gate = Some(input.into());
        self
    }

    /// Can close a cycle; of several the one with the largest `parameter` does.
    #[must_use]
    pub fn closes_cycles(mut self, parameter: impl Into<Cow<'static, str>>) -> Self {
        self.feedback = Some(parameter.into());
        self
    }

    /// What there is to say of latency and tail.
    #[must_use]
    pub fn timing(mut self, timing: impl Into<Cow<'static, str>>) -> Self {
        self.timing = timing.into();
        self
    }
}
