//! Catalogue of the made surfaces. Figures follow products sold under such names.
//!
//! # Heights
//!
//! Meaning of the stated figures on measured pieces. Brackets give the share of heights left out at
//! either end:
//!
//! - Sandpaper, size of grains: the grains' root mean square is 0.14 of it within 6 %. P36 to P150
//!   measure 0.66 to 0.78 of it from bottom to tops \[0.1 %\].
//! - Foam, depth of cells as a part of a pore: the deepest cells measure 0.89 to 1.15 of it \[0.1 %\].
//!   Cut polystyrene beads measure 1.4 to 1.9, as their roughness is as high.
//! - Pebbled, waves, height: within 6 % from one standard deviation to the other \[16 %\]. Peaks are
//!   higher; the root mean square is within 5 % of its closed form.
//! - Pebbled, hide, height of the highest: 0.97 to 1.11 of it, with the matt \[1 %\].
//!
//! # Neighbours
//!
//! Neighbours are alike but not the same. Three statistics of six pieces are compared: root mean square
//! height, root mean square slope, and the wavelength that halves the power. Two surfaces overlap in a
//! statistic if their ranges do. Number of a family's 13 neighbouring pairs that overlap in at least
//! one of the three, in two, and in all:
//!
//! | | pieces of 20 mm | pieces of 10 mm |
//! |---|---|---|
//! | sandpaper | 2, 0, 0 | 6, 0, 0 |
//! | weave | 6, 4, 0 | 7, 5, 0 |
//! | grating | 7, 0, 0 | 5, 0, 0 |
//! | foam | 5, 0, 0 | 7, 1, 1 |
//! | carpet | 7, 2, 1 | 10, 3, 1 |
//! | wood | 9, 2, 1 | 9, 4, 1 |
//! | pebbled plastic | 9, 0, 0 | 9, 0, 0 |
//! | sheet | 5, 2, 0 | 5, 3, 0 |
//! | all 104 | 50, 10, 2 | 58, 16, 3 |
//!
//! Single grains of neighbouring sandpapers also overlap: sizes within a paper differ by 15 %.

use super::family::{Binding, Carpet, Foam, Grating, Mould, Pebbled, Pile, Sheet, Weave, Wood};
use super::made::{Contact, Family, MadeSurface, Recipe};

/// All made surfaces by family, 14 of each. Within a family neighbours are alike, and half of them
/// overlap.
pub fn made_surfaces() -> Vec<MadeSurface> {
    [sandpapers(), weaves(), gratings(), foams(), carpets(), woods(), pebbles(), sheets()].concat()
}

/// A family's surfaces. Each row has a name and figures, of which `made` makes the rest.
fn family<R>(
    family: Family,
    rows: [(&str, R); 14],
    made: impl Fn(&str, R) -> (String, Contact, Recipe),
) -> Vec<MadeSurface> {
    let of = |(name, figures): (&str, R)| {
        let (description, contact, recipe) = made(name, figures);
        MadeSurface { name: name.to_owned(), description, family, contact, recipe }
    };
    rows.into_iter().map(of).collect()
}

const fn contact(modulus_mpa: f64, friction: f64, damping_s_m: f64) -> Contact {
    Contact { modulus_mpa, friction, damping_s_m }
}

/// Grades of FEPA 43 with their mean grain sizes in micrometres.
fn sandpapers() -> Vec<MadeSurface> {
    let grades = [
        ("sandpaper P36", 538.0),
        ("sandpaper P40", 425.0),
        ("sandpaper P50", 336.0),
        ("sandpaper P60", 269.0),
        ("sandpaper P80", 201.0),
        ("sandpaper P100", 162.0),
        ("sandpaper P120", 125.0),
        ("sandpaper P150", 100.0),
        ("sandpaper P180", 82.0),
        ("sandpaper P220", 68.0),
        ("sandpaper P240", 58.5),
        ("sandpaper P280", 52.2),
        ("sandpaper P320", 46.2),
        ("sandpaper P400", 35.0),
    ];
    family(Family::Sandpaper, grades, |name, um| {
        let grade = name.trim_start_matches("sandpaper ");
        let description = format!("Coated abrasive of grade {grade}: grains of {um} um on paper.");
        (description, contact(90.0, 0.5, 10.0), Recipe::Sandpaper(um * 1e-3))
    })
}

fn weaves() -> Vec<MadeSurface> {
    use Binding::{Plain, Satin, Twill};
    // Pitch [mm], binding, cover, thickness, fibre, wander, fuzz; modulus [MPa], friction.
    let cloths = [
        ("voile", (0.33, Plain, 0.62, 0.30, 0.015, 0.04, 0.1, 20.0, 0.25)),
        ("percale", (0.36, Plain, 0.95, 0.40, 0.015, 0.03, 0.1, 25.0, 0.28)),
        ("poplin", (0.42, Plain, 0.95, 0.40, 0.020, 0.04, 0.15, 25.0, 0.30)),
        ("muslin", (0.55, Plain, 0.75, 0.40, 0.030, 0.07, 0.3, 15.0, 0.35)),
        ("linen", (0.70, Plain, 0.85, 0.42, 0.030, 0.10, 0.3, 30.0, 0.35)),
        ("canvas", (0.95, Plain, 0.98, 0.42, 0.020, 0.05, 0.2, 40.0, 0.40)),
        ("hessian", (1.90, Plain, 0.70, 0.35, 0.025, 0.10, 0.6, 30.0, 0.45)),
        ("gabardine", (0.40, Twill, 0.96, 0.40, 0.020, 0.03, 0.1, 20.0, 0.28)),
        ("drill", (0.55, Twill, 0.96, 0.40, 0.025, 0.04, 0.15, 30.0, 0.32)),
        ("denim", (0.70, Twill, 0.97, 0.42, 0.030, 0.05, 0.3, 35.0, 0.38)),
        ("heavy denim", (0.85, Twill, 0.97, 0.42, 0.030, 0.05, 0.3, 35.0, 0.40)),
        ("sateen", (0.34, Satin, 0.97, 0.35, 0.012, 0.03, 0.05, 20.0, 0.20)),
        ("duchesse satin", (0.45, Satin, 0.98, 0.35, 0.012, 0.03, 0.05, 20.0, 0.18)),
        ("moleskin", (0.60, Satin, 0.97, 0.38, 0.030, 0.05, 1.0, 25.0, 0.30)),
    ];
    family(
        Family::Weave,
        cloths,
        |_, (pitch_mm, binding, cover, thickness, fibre, wander, fuzz, modulus, friction)| {
            let of = Weave { pitch_mm, binding, cover, thickness, fibre, wander, fuzz };
            let bound = match binding {
                Plain => "plain weave",
                Twill => "two-and-two twill",
                Satin => "five-end satin",
            };
            let threads = 10.0 / pitch_mm;
            let description = format!("Cloth: {bound}, {threads:.0} threads a centimetre.");
            (description, contact(modulus, friction, 15.0), Recipe::Weave(of))
        },
    )
}

fn gratings() -> Vec<MadeSurface> {
    // Period, depth [mm], duty, edge.
    let ridges = [
        ("square grating 0.5 mm", (0.5, 0.06, 0.5, 0.16)),
        ("square grating 0.8 mm", (0.8, 0.065, 0.5, 0.14)),
        ("square grating 1.2 mm", (1.2, 0.08, 0.5, 0.12)),
        ("square grating 2 mm", (2.0, 0.10, 0.5, 0.10)),
        ("square grating 3 mm", (3.0, 0.12, 0.5, 0.08)),
        ("sine grating 0.6 mm", (0.6, 0.024, 0.5, 0.5)),
        ("sine grating 1 mm", (1.0, 0.05, 0.5, 0.5)),
        ("sine grating 1.6 mm", (1.6, 0.08, 0.5, 0.5)),
        ("sine grating 2.5 mm", (2.5, 0.12, 0.5, 0.5)),
        ("narrow ridges 1 mm", (1.0, 0.045, 0.25, 0.15)),
        ("narrow ridges 1.8 mm", (1.8, 0.08, 0.2, 0.14)),
        ("narrow grooves 1 mm", (1.0, 0.06, 0.75, 0.15)),
        ("narrow grooves 1.8 mm", (1.8, 0.08, 0.8, 0.14)),
        ("narrow grooves 3 mm", (3.0, 0.12, 0.8, 0.10)),
    ];
    family(Family::Grating, ridges, |_, (period_mm, depth_mm, duty, edge)| {
        let of = Grating { period_mm, depth_mm, duty, edge, roughness_mm: 0.0008 };
        let description = format!("Moulded polypropylene: ridges every {period_mm} mm, {depth_mm} mm high.");
        (description, contact(1_300.0, 0.25, 15.0), Recipe::Grating(of))
    })
}

fn foams() -> Vec<MadeSurface> {
    // Pore [mm], wall, depth, open; modulus [MPa].
    let cut = [
        ("microcellular rubber", (0.30, 0.40, 0.35, 0.5, 5.0)),
        ("neoprene foam", (0.42, 0.38, 0.35, 0.6, 2.0)),
        ("EVA foam", (0.55, 0.35, 0.30, 0.6, 4.0)),
        ("dense polyurethane foam", (0.60, 0.25, 0.45, 0.8, 1.0)),
        ("polyurethane foam", (0.80, 0.20, 0.50, 0.85, 0.5)),
        ("upholstery foam", (1.00, 0.18, 0.50, 0.9, 0.3)),
        ("filter foam 45 ppi", (0.56, 0.22, 0.70, 1.0, 0.8)),
        ("filter foam 30 ppi", (0.85, 0.20, 0.70, 1.0, 0.8)),
        ("filter foam 20 ppi", (1.27, 0.18, 0.70, 1.0, 0.8)),
        ("filter foam 10 ppi", (2.54, 0.16, 0.60, 1.0, 0.8)),
        ("extruded polystyrene", (0.35, 0.30, 0.30, 0.9, 15.0)),
        ("polystyrene beads, cut", (2.80, 0.10, 0.10, 0.3, 8.0)),
        ("bath sponge", (1.60, 0.30, 0.60, 0.7, 0.4)),
        ("cellulose sponge", (1.90, 0.35, 0.50, 0.5, 1.5)),
    ];
    family(Family::Foam, cut, |_, (pore_mm, wall, depth, open, modulus)| {
        let of = Foam { pore_mm, wall, depth, open };
        (format!("Foam, cut: a cell every {pore_mm} mm."), contact(modulus, 0.6, 20.0), Recipe::Foam(of))
    })
}

fn carpets() -> Vec<MadeSurface> {
    use Pile::{Curl, Cut, Felt, Loop};
    // Pile, pitch, height [mm], disorder, ply [mm]; modulus [MPa].
    let piles = [
        ("needle felt", (Felt, 1.6, 0.20, 1.0, 0.08, 2.0)),
        ("velour", (Cut, 0.9, 0.20, 0.8, 0.12, 1.0)),
        ("fine loop pile", (Loop, 1.8, 0.45, 0.25, 0.50, 1.5)),
        ("loop pile", (Loop, 2.4, 0.60, 0.25, 0.65, 1.2)),
        ("coarse loop pile", (Loop, 3.2, 0.80, 0.25, 0.85, 1.0)),
        ("berber", (Loop, 4.0, 0.90, 0.35, 1.10, 1.0)),
        ("cut pile", (Cut, 2.0, 0.50, 0.6, 0.20, 0.6)),
        ("plush", (Cut, 1.6, 0.45, 0.9, 0.16, 0.4)),
        ("saxony", (Cut, 3.0, 0.80, 0.7, 0.30, 0.4)),
        ("frieze", (Curl, 2.8, 0.80, 0.9, 0.55, 0.5)),
        ("sisal", (Loop, 2.6, 0.55, 0.10, 0.35, 8.0)),
        ("seagrass", (Loop, 3.8, 0.70, 0.08, 1.60, 15.0)),
        ("coir", (Felt, 6.0, 0.80, 0.5, 0.28, 6.0)),
        ("terry towel", (Curl, 1.5, 0.45, 0.8, 0.40, 0.5)),
    ];
    family(Family::Carpet, piles, |_, (pile, pitch_mm, height_mm, disorder, ply_mm, modulus)| {
        let of = Carpet { pile, pitch_mm, height_mm, disorder, ply_mm };
        let description = match pile {
            Loop => format!("Loops in rows, every {pitch_mm} mm, {height_mm} mm high."),
            Curl => format!("Loops every {pitch_mm} mm as they fell, {height_mm} mm high."),
            Cut => format!("Cut tufts every {pitch_mm} mm, {height_mm} mm high."),
            Felt => format!("Fibres {ply_mm} mm thick across each other."),
        };
        (description, contact(modulus, 0.5, 20.0), Recipe::Carpet(of))
    })
}

fn woods() -> Vec<MadeSurface> {
    // Ring, its height, fibre, its height, pore [mm], pores [1/mm^2], in early wood; modulus [MPa].
    let boards = [
        ("balsa", (4.0, 0.006, 0.12, 0.006, 0.060, 0.8, 0.0, 40.0)),
        ("spruce", (2.2, 0.012, 0.09, 0.004, 0.0, 0.0, 0.0, 120.0)),
        ("brushed spruce", (2.2, 0.050, 0.10, 0.008, 0.0, 0.0, 0.0, 120.0)),
        ("pine", (3.2, 0.016, 0.10, 0.0045, 0.0, 0.0, 0.0, 150.0)),
        ("larch", (2.6, 0.024, 0.10, 0.005, 0.0, 0.0, 0.0, 200.0)),
        ("cedar", (1.8, 0.014, 0.11, 0.0055, 0.0, 0.0, 0.0, 100.0)),
        ("beech", (3.0, 0.004, 0.08, 0.003, 0.020, 6.0, 0.1, 400.0)),
        ("maple", (3.5, 0.003, 0.07, 0.0025, 0.015, 3.0, 0.1, 450.0)),
        ("birch", (3.0, 0.004, 0.08, 0.0035, 0.025, 2.0, 0.1, 350.0)),
        ("cherry", (2.6, 0.004, 0.08, 0.003, 0.018, 5.0, 0.5, 300.0)),
        ("walnut", (3.2, 0.006, 0.12, 0.004, 0.060, 1.0, 0.5, 300.0)),
        ("oak", (2.8, 0.012, 0.16, 0.005, 0.090, 2.5, 1.0, 350.0)),
        ("brushed oak", (2.8, 0.040, 0.18, 0.010, 0.120, 2.5, 1.0, 350.0)),
        ("ash", (3.4, 0.018, 0.18, 0.005, 0.080, 1.6, 1.0, 350.0)),
    ];
    family(
        Family::Wood,
        boards,
        |_, (ring, ring_high, fibre, fibre_high, pore, pores, rings_porous, modulus)| {
            let of = Wood {
                ring_mm: ring,
                ring_height_mm: ring_high,
                fibre_mm: fibre,
                fibre_height_mm: fibre_high,
                pore_mm: pore,
                pores,
                rings_porous,
            };
            (
                format!("A planed board: rings every {ring} mm."),
                contact(modulus, 0.35, 12.0),
                Recipe::Wood(of),
            )
        },
    )
}

fn pebbles() -> Vec<MadeSurface> {
    // Pitch, height [mm], flatness, matt [mm]; modulus [MPa], friction.
    use Mould::{Hide, Waves};
    let moulds = [
        ("spark-eroded plastic, fine", (Waves, 0.18, 0.010, 0.6, 0.0010, 400.0, 0.25)),
        ("spark-eroded plastic", (Waves, 0.28, 0.014, 0.6, 0.0012, 400.0, 0.25)),
        ("spark-eroded plastic, coarse", (Waves, 0.42, 0.018, 0.6, 0.0015, 400.0, 0.28)),
        ("keyboard plastic", (Waves, 0.35, 0.008, 1.0, 0.0008, 400.0, 0.25)),
        ("dashboard grain, fine", (Hide, 0.70, 0.050, 1.8, 0.002, 40.0, 0.45)),
        ("dashboard grain", (Hide, 1.00, 0.075, 1.8, 0.003, 40.0, 0.45)),
        ("dashboard grain, coarse", (Hide, 1.50, 0.110, 1.8, 0.003, 40.0, 0.45)),
        ("suitcase shell", (Waves, 1.30, 0.045, 1.2, 0.001, 500.0, 0.30)),
        ("orange peel lacquer", (Waves, 2.20, 0.030, 0.4, 0.0004, 1_500.0, 0.22)),
        ("leather grain, fine", (Hide, 0.55, 0.045, 2.4, 0.004, 20.0, 0.50)),
        ("leather grain", (Hide, 0.85, 0.070, 2.4, 0.005, 20.0, 0.50)),
        ("leather grain, coarse", (Hide, 1.30, 0.110, 2.6, 0.005, 20.0, 0.50)),
        ("rubber pebble mat", (Hide, 2.00, 0.250, 2.0, 0.004, 6.0, 0.80)),
        ("pebbled handle", (Hide, 1.60, 0.180, 1.4, 0.003, 25.0, 0.60)),
    ];
    family(
        Family::Pebbled,
        moulds,
        |_, (mould, pitch_mm, height_mm, flatness, matt_mm, modulus, friction)| {
            let of = Pebbled { mould, pitch_mm, height_mm, flatness, matt_mm };
            let description = format!("Moulded: pebbles every {pitch_mm} mm, {height_mm} mm high.");
            (description, contact(modulus, friction, 15.0), Recipe::Pebbled(of))
        },
    )
}

fn sheets() -> Vec<MadeSurface> {
    // Height [um], roll-off [1/mm], Hurst, lay; modulus [MPa], friction.
    let flats = [
        ("float glass", (0.02, 0.3, 0.9, 1.0, 70_000.0, 0.15)),
        ("acrylic sheet", (0.25, 2.5, 0.9, 1.0, 3_000.0, 0.25)),
        ("frosted acrylic", (1.4, 9.0, 0.7, 1.0, 1_500.0, 0.30)),
        ("ground glass", (1.5, 13.0, 0.6, 1.0, 3_000.0, 0.25)),
        ("anodised aluminium", (0.8, 6.0, 0.7, 1.0, 3_000.0, 0.25)),
        ("brushed aluminium", (0.8, 7.0, 0.6, 30.0, 3_000.0, 0.22)),
        ("brushed steel", (0.7, 11.0, 0.6, 40.0, 4_000.0, 0.20)),
        ("milled aluminium", (1.2, 3.0, 0.9, 20.0, 3_000.0, 0.25)),
        ("sand-blasted steel", (1.8, 7.0, 0.7, 1.0, 3_000.0, 0.30)),
        ("printer paper", (3.0, 5.0, 0.5, 1.5, 60.0, 0.35)),
        ("drawing paper", (7.0, 2.8, 0.6, 1.3, 50.0, 0.40)),
        ("watercolour paper", (18.0, 0.9, 0.7, 1.2, 40.0, 0.45)),
        ("cardboard", (5.0, 1.2, 0.6, 4.0, 30.0, 0.40)),
        ("unglazed tile", (3.0, 3.0, 0.6, 1.0, 1_500.0, 0.45)),
    ];
    family(Family::Sheet, flats, |_, (um, roll_off_per_mm, hurst, lay, modulus, friction)| {
        let of = Sheet { height_mm: um * 1e-3, roll_off_per_mm, hurst, lay };
        let description = format!("A sheet: {um} um of height, root mean square.");
        (description, contact(modulus, friction, 30.0), Recipe::Sheet(of))
    })
}

#[cfg(test)]
#[path = "catalogue_tests.rs"]
mod tests;
