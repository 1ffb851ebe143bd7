//! The made materials.

use asperity_source::Diagnostic;

use super::{Law, Line, Parameters};

/// A material with a name, a sentence and a law.
#[derive(Clone, Debug)]
pub struct MadeMaterial {
    /// Name in the library.
    pub name: &'static str,
    /// What it feels like, in a sentence.
    pub description: &'static str,
    /// Its law.
    pub law: Law,
}

struct Recipe {
    name: &'static str,
    description: &'static str,
    /// level [m/s^2], speed exponent, force exponent
    growth: (f64, f64, f64),
    /// corner [1/mm], exponent
    floor: (f64, f64),
    /// [1/mm], half width [1/mm], share
    lines: &'static [(f64, f64, f64)],
    tip_per_mm: f64,
    /// [Hz], damping ratio, gain
    resonance: (f64, f64, f64),
}

const RECIPES: [Recipe; 12] = [
    Recipe {
        name: "brick",
        description: "Fired clay: coarse, without pitch, loud and low.",
        growth: (4.2, 0.75, 0.55),
        floor: (0.55, 1.9),
        lines: &[],
        tip_per_mm: 3.5,
        resonance: (330.0, 0.18, 2.2),
    },
    Recipe {
        name: "brushed aluminium",
        description: "Fine parallel scratches on stiff metal: bright, with a clear ring of the tool.",
        growth: (1.4, 0.95, 0.45),
        floor: (2.6, 2.4),
        lines: &[(3.4, 0.5, 0.5)],
        tip_per_mm: 8.0,
        resonance: (520.0, 0.10, 3.2),
    },
    Recipe {
        name: "coarse weave",
        description: "Sackcloth with a thread every 1.4 mm and its harmonics: a strong pitch that follows speed.",
        growth: (3.6, 0.85, 0.65),
        floor: (0.9, 2.6),
        lines: &[(0.71, 0.045, 1.6), (1.42, 0.09, 0.9), (2.13, 0.14, 0.3)],
        tip_per_mm: 4.0,
        resonance: (240.0, 0.22, 1.8),
    },
    Recipe {
        name: "corduroy",
        description: "Ribs of cloth every 2.6 mm: slow bumps with few harmonics.",
        growth: (3.0, 0.9, 0.6),
        floor: (0.7, 2.8),
        lines: &[(0.385, 0.02, 2.4), (0.77, 0.04, 0.7)],
        tip_per_mm: 2.5,
        resonance: (190.0, 0.26, 1.6),
    },
    Recipe {
        name: "cork",
        description: "Pressed granules of some millimetres: soft, low and irregular.",
        growth: (1.9, 0.6, 0.7),
        floor: (0.4, 2.2),
        lines: &[(0.33, 0.12, 0.5)],
        tip_per_mm: 2.0,
        resonance: (170.0, 0.30, 1.5),
    },
    Recipe {
        name: "denim",
        description: "Twill of cotton, a thread every 0.7 mm: a soft buzz over a broad floor.",
        growth: (2.2, 0.85, 0.6),
        floor: (1.3, 2.5),
        lines: &[(1.43, 0.12, 1.1), (2.86, 0.25, 0.25)],
        tip_per_mm: 4.5,
        resonance: (230.0, 0.24, 1.7),
    },
    Recipe {
        name: "fine sandpaper",
        description: "Grit of a twentieth of a millimetre: an even hiss that rises with speed.",
        growth: (2.6, 1.05, 0.5),
        floor: (3.2, 2.1),
        lines: &[],
        tip_per_mm: 7.0,
        resonance: (430.0, 0.14, 2.4),
    },
    Recipe {
        name: "frosted acrylic",
        description: "Etched plastic: nearly smooth, faint and bright.",
        growth: (0.7, 1.1, 0.4),
        floor: (2.0, 2.0),
        lines: &[],
        tip_per_mm: 9.0,
        resonance: (470.0, 0.12, 2.8),
    },
    Recipe {
        name: "leather",
        description: "Grained hide: a dull, soft rub with a weak grain of 1.1 mm.",
        growth: (1.2, 0.7, 0.75),
        floor: (0.8, 2.9),
        lines: &[(0.9, 0.18, 0.6)],
        tip_per_mm: 2.2,
        resonance: (150.0, 0.35, 1.4),
    },
    Recipe {
        name: "printer paper",
        description: "Office paper: quiet, fine and even.",
        growth: (0.9, 1.0, 0.5),
        floor: (1.7, 1.8),
        lines: &[],
        tip_per_mm: 6.0,
        resonance: (380.0, 0.20, 1.8),
    },
    Recipe {
        name: "ribbed rubber",
        description: "Moulded ribs every 1.8 mm on a grip: exact, loud, rich in harmonics.",
        growth: (4.8, 0.7, 0.85),
        floor: (0.6, 2.4),
        lines: &[(0.555, 0.022, 2.2), (1.11, 0.045, 1.4), (1.665, 0.065, 0.8), (2.22, 0.09, 0.4)],
        tip_per_mm: 5.0,
        resonance: (210.0, 0.28, 1.5),
    },
    Recipe {
        name: "rough sandpaper",
        description: "Grit of a quarter of a millimetre: harsh and broad, with a hint of its grain.",
        growth: (5.5, 0.95, 0.6),
        floor: (1.4, 2.0),
        lines: &[(1.9, 0.7, 0.5)],
        tip_per_mm: 6.0,
        resonance: (360.0, 0.16, 2.2),
    },
];

/// All made materials, by name.
///
/// # Errors
/// None that a user can cause: a recipe outside the law's ranges would be reported here.
pub fn made_materials() -> Result<Vec<MadeMaterial>, Diagnostic> {
    RECIPES
        .iter()
        .map(|r| {
            let line = |&(per_mm, half_width_per_mm, share)| Line { per_mm, half_width_per_mm, share };
            let law = Law::new(Parameters {
                level_m_s2: r.growth.0,
                speed_exponent: r.growth.1,
                force_exponent: r.growth.2,
                floor_corner_per_mm: r.floor.0,
                floor_exponent: r.floor.1,
                lines: r.lines.iter().map(line).collect(),
                tip_per_mm: r.tip_per_mm,
                resonance_hz: r.resonance.0,
                resonance_damping: r.resonance.1,
                resonance_gain: r.resonance.2,
            })?;
            Ok(MadeMaterial { name: r.name, description: r.description, law })
        })
        .collect()
}
