//! The built-in nodes: one file a node, one folder a stage of the chain.
//!
//! [`registry`] returns all of them.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod actuator;
#[cfg(test)]
#[path = "tests/bench.rs"]
mod bench;
pub mod contact;
pub mod effects;
pub mod motion;
pub mod phase;
mod precision;
mod prelude;
mod since;
pub mod sinks;
pub mod sources;
pub mod synthesis;
pub mod texture;
pub mod utility;

use asperity_node::Registry;

/// All built-in kinds.
pub fn registry() -> Registry {
    Registry::new()
        .stage("Motion of the stylus")
        .with::<motion::Trajectory>()
        .with::<motion::Stroke>()
        .with::<motion::Velocity>()
        .stage("Signal sources")
        .with::<sources::AudioIn>()
        .with::<sources::Clip>()
        .with::<sources::Impulse>()
        .with::<sources::Noise>()
        .with::<sources::Sine>()
        .with::<sources::Sweep>()
        .stage("Contact with surfaces")
        .with::<contact::VirtualFloor>()
        .with::<contact::Contact>()
        .with::<contact::SpeedGate>()
        .stage("Effects of surfaces")
        .with::<effects::Friction>()
        .with::<effects::Viscosity>()
        .with::<effects::Magnet>()
        .with::<effects::ForceLimiter>()
        .with::<effects::Tap>()
        .with::<effects::Vibration>()
        .with::<effects::Autoregressive>()
        .with::<effects::Waveform>()
        .with::<effects::Relief>()
        .with::<effects::Level>()
        .stage("Learned texture")
        .with::<texture::ActionHistory>()
        .with::<texture::TextureNetwork>()
        .with::<texture::Scatter>()
        .stage("Phase retrieval")
        .with::<phase::Spsi>()
        .with::<phase::PhaseVocoder>()
        .with::<phase::RandomPhase>()
        .with::<phase::OscillatorBank>()
        .with::<phase::SampleCommit>()
        .with::<phase::ShapedNoise>()
        .stage("Synthesis")
        .with::<synthesis::OverlapAdd>()
        .with::<synthesis::Resample>()
        .stage("Actuator")
        .with::<actuator::ActuatorInverse>()
        .with::<actuator::Limiter>()
        .stage("Utilities")
        .with::<utility::Delay>()
        .with::<utility::Gain>()
        .with::<utility::Mix>()
        .stage("Outputs")
        .with::<sinks::AudioOut>()
        .with::<sinks::FileOut>()
        .with::<sinks::Probe>()
}

/// The code of the docs must compile.
#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/write-a-graph-and-a-node.md")]
struct Docs;
