//! Roles of nodes.

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
