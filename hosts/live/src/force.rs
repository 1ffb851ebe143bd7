//! Local model of the surface under the stylus, for a force-feedback device.

/// Contact model: a plane with a spring and a damper. The device's servo thread evaluates it at its own
/// rate and position, so neither a tick nor an audio buffer lies inside the loop of the wall.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ForceModel {
    /// A point of the plane \[mm\], in the graph's axes, z up.
    pub point: [f64; 3],
    /// Outward normal of the plane; a unit vector, or all 0 for no surface.
    pub normal: [f64; 3],
    /// Stiffness \[N/mm\], at least 0.
    pub stiffness_n_per_mm: f64,
    /// Damping along the normal while in the plane \[N s/m\], at least 0.
    pub damping_ns_per_m: f64,
    /// Force beside the plane \[N\]: friction, drag, pull; constant within a tick.
    pub beside_n: [f64; 3],
    /// Largest force \[N\]; the device's own limit also applies.
    pub max_force_n: f64,
    /// Whether the values are valid; if not, the device releases its force.
    pub valid: bool,
    /// Time of the tick, by [`now_ns`](crate::now_ns). A model that is too old counts as invalid.
    pub time_ns: u64,
}

/// Writer of the tick thread.
pub type ForceWriter = triple_buffer::Input<ForceModel>;

/// Reader of a servo thread.
pub type ForceReader = triple_buffer::Output<ForceModel>;

/// Holds the newest model; neither side waits.
pub fn force_model() -> (ForceWriter, ForceReader) {
    triple_buffer::triple_buffer(&ForceModel::default())
}
