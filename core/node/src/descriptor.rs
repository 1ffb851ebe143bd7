//! Descriptors of node kinds.

use std::borrow::Cow;

use crate::{Effect, Input, Output, Param, ShapeSpec};

/// The engine's action when a sleeping node wakes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Resume {
    /// The node is reset, as if the graph began.
    #[default]
    Restart,
    /// The node learns how many ticks it slept.
    Elapsed,
    /// The node continues as it was. Its output depends on the tick and its inputs, not on the number
    /// of calls.
    Continue,
    /// The node never sleeps, because its state must stay up to date.
    Never,
}

impl Resume {
    /// Word for a person.
    pub fn word(self) -> &'static str {
        match self {
            Resume::Restart => "restart",
            Resume::Elapsed => "elapsed time",
            Resume::Continue => "resuming",
            Resume::Never => "nothing: it never sleeps",
        }
    }
}

/// Kind, ports and parameters of a node.
#[must_use]
#[derive(Clone, Debug, Default)]
pub struct Descriptor {
    /// Name in a graph file: lower case, words joined by `_`.
    pub kind: Cow<'static, str>,
    /// Purpose, in one sentence.
    pub summary: Cow<'static, str>,
    /// Purpose for the host, if the host treats it specially. A plugin's kind has none.
    pub role: Option<Role>,
    /// Inputs. If they depend on parameters, those for the defaults.
    pub inputs: Vec<Input>,
    /// Outputs. If they depend on parameters, those for the defaults.
    pub outputs: Vec<Output>,
    /// Parameters.
    pub params: Vec<Param>,
    /// Behaviour on waking.
    pub resume: Resume,
    /// Whether it is a sink. Nodes that reach no sink are not built.
    pub sink: bool,
    /// Whether a sink only observes: it does not keep its sources awake.
    pub passive: bool,
    /// The input that this node gates: while `wants` returns false, nodes that serve only that input
    /// sleep.
    pub gate: Option<Cow<'static, str>>,
    /// The parameter with the node's delay, for a node that can close a cycle: its output in a tick
    /// does not need its input in that tick.
    pub feedback: Option<Cow<'static, str>>,
    /// The effect that this kind renders on surfaces, as scenes need to know it.
    pub effect: Option<Effect>,
    /// Notes on latency and tail; empty if both are zero.
    pub timing: Cow<'static, str>,
}

impl Descriptor {
    /// Makes a descriptor without ports or parameters.
    pub fn new(kind: impl Into<Cow<'static, str>>, summary: impl Into<Cow<'static, str>>) -> Self {
        Self { kind: kind.into(), summary: summary.into(), ..Self::default() }
    }

    /// Gives it a role.
    pub fn role(mut self, role: Role) -> Self {
        self.role = Some(role);
        self
    }

    /// Adds an input.
    pub fn input(mut self, input: Input) -> Self {
        self.inputs.push(input);
        self
    }

    /// Adds an output.
    pub fn output(mut self, output: Output) -> Self {
        self.outputs.push(output);
        self
    }

    /// Adds a parameter.
    pub fn param(mut self, param: Param) -> Self {
        self.params.push(param);
        self
    }

    /// Sets the behaviour on waking.
    pub fn resumes(mut self, resume: Resume) -> Self {
        self.resume = resume;
        self
    }

    /// Makes it a sink.
    pub fn sink(mut self) -> Self {
        self.sink = true;
        self
    }

    /// Makes it a sink that only observes, and keeps nothing awake.
    pub fn passive_sink(mut self) -> Self {
        (self.sink, self.passive) = (true, true);
        self
    }

    /// Makes it a gate on one of its inputs.
    pub fn gates(mut self, input: impl Into<Cow<'static, str>>) -> Self {
        self.gate = Some(input.into());
        self
    }

    /// Lets it close cycles. Of several such nodes in a cycle the one with the largest `parameter`
    /// does.
    pub fn closes_cycles(mut self, parameter: impl Into<Cow<'static, str>>) -> Self {
        self.feedback = Some(parameter.into());
        self
    }

    /// Renders an effect of surfaces.
    pub fn effect(mut self, effect: Effect) -> Self {
        self.effect = Some(effect);
        self
    }

    /// Sets the notes on latency and tail.
    pub fn timing(mut self, timing: impl Into<Cow<'static, str>>) -> Self {
        self.timing = timing.into();
        self
    }
}

/// Ports of a phase-retrieval kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Retrieval<'a> {
    /// Name of its input of magnitudes.
    pub input: &'a str,
    /// Name of its output.
    pub output: &'a str,
    /// Whether it outputs spectra, so that an `overlap_add` must follow; otherwise it outputs samples.
    pub spectrum: bool,
}

impl Descriptor {
    /// Ports of this kind if it retrieves phase: exactly one required input, of magnitudes, and one
    /// output, of spectra or samples.
    pub fn retrieval(&self) -> Option<Retrieval<'_>> {
        let mut required = self.inputs.iter().filter(|p| !p.optional);
        let (Some(input), None) = (required.next(), required.next()) else { return None };
        let [output] = self.outputs.as_slice() else { return None };
        let spectrum = match output.shape {
            ShapeSpec::Spectrum(_) => true,
            ShapeSpec::Audio(_) => false,
            _ => return None,
        };
        let magnitudes = matches!(input.shape, ShapeSpec::Magnitude(_));
        magnitudes.then_some(Retrieval { input: &input.name, output: &output.name, spectrum })
    }
}

/// Purpose of a node for its host. A host finds nodes by their role, and ports and parameters by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// A channel of the sound card: the host plays the first output.
    AudioOutput,
    /// A recorded channel of the sound card: the host feeds the first input.
    AudioInput,
    /// A recording: the host writes the first output to the parameter `file`.
    Recorder,
    /// A recording: the host writes the first input to the parameter `file`.
    Probe,
    /// Motion of a hand. A device or the live page feeds the first three inputs: position, force, stroke.
    Hand,
    /// Force on a hand. A device renders the surface in its own loop; the inputs are point of the plane,
    /// normal, stiffness, damping and further force, in this order.
    Force,
    /// A stroke that is known beforehand.
    Stroke,
    /// Velocity of the stylus behind a low-pass, with the parameters `cutoff_hz` and `cutoff_hz_per_mm_s`.
    Velocity,
    /// Contact of the stylus with the surfaces of a scene.
    Contact,
    /// A learned texture model with the parameters `library` and `material`.
    TextureNetwork,
    /// Overlap-add of spectra, the second half of phase retrieval.
    OverlapAdd,
    /// Inverse of the actuator: the first input is the acceleration that is to be felt.
    ActuatorInverse,
    /// Limiter that protects the actuator; its facts count the limited samples.
    Limiter,
}
