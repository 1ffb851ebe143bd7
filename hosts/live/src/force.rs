//! What a graph says of the surface under the stylus, for a device that pushes back by itself.

/// A local model of contact: a plane with a spring and a damper. The device's servo thread evaluates it at
/// its own rate against the position it reads itself, so that neither a tick nor a device's buffer stands
/// inside the loop of the wall.
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
    /// What there is beside the plane \[N\]: friction, drag, pull; as it was in the tick.
    pub beside_n: [f64; 3],
    /// Largest force \[N\]; the device's own limit counts besides.
    pub max_force_n: f64,
    /// Whether the values are to be trusted; if not, the device lets go.
    pub valid: bool,
    /// When the tick that said so ran, by [`now_ns`](crate::now_ns). A model that is too old is not to be
    /// trusted either.
    pub time_ns: u64,
}

/// Where the tick thread puts the newest model.
pub type ForceWriter = triple_buffer::Input<ForceModel>;

/// Where a servo thread reads it.
pub type ForceReader = triple_buffer::Output<ForceModel>;

/// A place for the newest model; neither side ever waits.
pub fn force_model() -> (ForceWriter, ForceReader) {
    triple_buffer::triple_buffer(&ForceModel::default())
}
