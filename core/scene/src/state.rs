//! Motion of the stylus, and the state of the contact that follows from it.

/// Where a stylus is and how it moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Place in mm.
    pub position_mm: [f64; 3],
    /// Velocity behind the low-pass, for textures, in mm/s.
    pub velocity_mm_s: [f64; 3],
    /// Velocity as it is, for forces, in mm/s.
    pub unfiltered_mm_s: [f64; 3],
    /// Another number: the stylus was put down elsewhere.
    pub stroke: f64,
}

/// What is chosen about contacts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactSettings {
    /// Largest force of a surface in N.
    pub max_force_n: f64,
    /// How long one surface's textures take to go over into another's \[s\].
    pub crossfade_s: f64,
    /// How long the textures of a wall stay when it is left, for what fades them out \[s\].
    pub hold_s: f64,
    /// From how far a surface that is not yet touched is told of to a device that pushes back in a loop of
    /// its own \[mm\].
    pub anticipate_mm: f64,
    /// The speed at which a wall counts as reached by a stylus that was put down on it from elsewhere: how
    /// fast it came is not known \[mm/s\].
    pub put_down_mm_s: f64,
}

/// The textures of one surface, or of one face of a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Voice {
    /// How loud, 0 to 1: the square root of its part of the power.
    pub level: f64,
    /// Where on the surface the stylus is, in mm.
    pub place_mm: [f64; 2],
    /// Another number: it is of another surface than before.
    pub stroke: f64,
}

/// A force from both sides of a surface, within a reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pull {
    /// Slot of the effect; -1 for none.
    pub slot: f64,
    /// Distance to the surface \[mm\], below 0 inside.
    pub distance_mm: f64,
    /// The surface's outward normal.
    pub normal: [f64; 3],
}

/// State of the contact in a tick. Numbers of surfaces and slots count from 0 and are -1 for none. The lists have the
/// order of [`EffectNames`](crate::EffectNames).
#[derive(Clone, Debug, PartialEq)]
pub struct ContactState {
    /// Normal force by Hooke's law, in N.
    pub force_n: f64,
    /// Penetration in mm.
    pub depth_mm: f64,
    /// A point of the plane that touches the surface, in mm.
    pub plane_mm: [f64; 3],
    /// The way out, of length 1; 0 where nothing is touched.
    pub normal: [f64; 3],
    /// Of the surface, in N/mm.
    pub stiffness_n_per_mm: f64,
    /// Of the surface, in N s/m.
    pub damping_ns_per_m: f64,
    /// Force of the wall with its damping, in N.
    pub push_n: [f64; 3],
    /// Two directions along the surface.
    pub tangents: [[f64; 3]; 2],
    /// Where along them the stylus is, and how high over the surface, in mm. In the air it goes on as if
    /// the surface did.
    pub place_mm: [f64; 3],
    /// Along them, behind the low-pass, in mm/s.
    pub velocity_mm_s: [f64; 2],
    /// Length of that.
    pub speed_mm_s: f64,
    /// Along them, as it is, in mm/s.
    pub slide_mm_s: [f64; 2],
    /// The wall's number in the scene.
    pub surface: f64,
    /// The volume's.
    pub volume: f64,
    /// Speed at which it was reached in this tick, in mm/s; else 0.
    pub approach_mm_s: f64,
    /// When in the tick that was, 0 to 1.
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
