//! Motion of the stylus, and the state of the contact that follows from it.

/// Position and velocity of a stylus.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Position in mm.
    pub position_mm: [f64; 3],
    /// Velocity after the low-pass filter, for textures, in mm/s.
    pub velocity_mm_s: [f64; 3],
    /// Unfiltered velocity, for forces, in mm/s.
    pub unfiltered_mm_s: [f64; 3],
    /// Number of the stroke. It changes when the stylus is put down elsewhere.
    pub stroke: f64,
}

/// Settings of contacts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactSettings {
    /// Largest force of a surface in N.
    pub max_force_n: f64,
    /// Time of the crossfade from one surface's textures to another's \[s\].
    pub crossfade_s: f64,
    /// Time for which a wall's textures stay after the stylus leaves it, so that later nodes can fade
    /// them out \[s\].
    pub hold_s: f64,
    /// Distance from which a surface that is not yet touched is reported \[mm\]. A device that pushes
    /// back in its own loop needs it.
    pub anticipate_mm: f64,
    /// Approach speed for a stylus that is put down on a wall from elsewhere, since its speed is not
    /// known \[mm/s\].
    pub put_down_mm_s: f64,
}

/// Textures of one surface, or of one face of a box.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Voice {
    /// Level, 0 to 1: the square root of the voice's part of the power.
    pub level: f64,
    /// Place of the stylus on the surface, in mm.
    pub place_mm: [f64; 2],
    /// Number that changes when the voice goes to another surface.
    pub stroke: f64,
}

/// Force from both sides of a surface, within a reach.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pull {
    /// Slot of the effect; -1 for none.
    pub slot: f64,
    /// Distance to the surface \[mm\]; below 0 inside.
    pub distance_mm: f64,
    /// Outward normal of the surface.
    pub normal: [f64; 3],
}

/// State of the contact in a tick. Numbers of surfaces and slots count from 0; -1 stands for none. The
/// lists have the order of [`EffectNames`](crate::EffectNames).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactState {
    /// Normal force by Hooke's law, in N.
    pub force_n: f64,
    /// Penetration in mm.
    pub depth_mm: f64,
    /// Point of the plane that touches the surface, in mm.
    pub plane_mm: [f64; 3],
    /// Outward normal, of length 1; 0 where nothing is touched.
    pub normal: [f64; 3],
    /// Stiffness of the surface, in N/mm.
    pub stiffness_n_per_mm: f64,
    /// Damping of the surface, in N s/m.
    pub damping_ns_per_m: f64,
    /// Force of the wall including its damping, in N.
    pub push_n: [f64; 3],
    /// Two directions along the surface.
    pub tangents: [[f64; 3]; 2],
    /// Place of the stylus along these directions, and its height above the surface, in mm. In the air,
    /// the place goes on as if the surface did.
    pub place_mm: [f64; 3],
    /// Velocity along these directions after the low-pass filter, in mm/s.
    pub velocity_mm_s: [f64; 2],
    /// Magnitude of `velocity_mm_s`.
    pub speed_mm_s: f64,
    /// Unfiltered velocity along these directions, in mm/s.
    pub slide_mm_s: [f64; 2],
    /// Number of the wall in the scene.
    pub surface: f64,
    /// Number of the volume in the scene.
    pub volume: f64,
    /// Speed with which the wall was reached in this tick, in mm/s; else 0.
    pub approach_mm_s: f64,
    /// Moment within the tick at which the wall was reached, 0 to 1.
    pub moment: f64,
    /// Material of the network; the last one where nothing is touched.
    pub material: f64,
    /// Level of the network, 0 to 1.
    pub network: f64,
    /// Textures of two surfaces.
    pub voices: [Voice; 2],
    /// Slots of effects that act while a wall is touched.
    pub touching: Vec<f64>,
    /// Slots of effects that act inside of volumes too.
    pub inside: Vec<f64>,
    /// Effects that act from both sides.
    pub near: Vec<Pull>,
    /// Slots of textures, of the first voice and of the second.
    pub textures: [Vec<f64>; 2],
}
