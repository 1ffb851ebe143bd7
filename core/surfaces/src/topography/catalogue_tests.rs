use super::*;
use crate::topography::HeightField;

#[test]
fn each_family_has_14_surfaces_with_unique_names() {
    let surfaces = made_surfaces();
    let names: std::collections::BTreeSet<&str> = surfaces.iter().map(|s| s.name.as_str()).collect();
    assert_eq!((surfaces.len(), names.len()), (112, 112));
    for family in Family::ALL {
        assert_eq!(surfaces.iter().filter(|s| s.family == family).count(), 14);
    }
}

#[test]
fn patch_has_no_seam_and_seed_only_changes_the_piece() {
    for surface in made_surfaces().iter().step_by(5) {
        let grid = (512, 0.04);
        let (a, b) = (surface.patch(grid, 1), surface.patch(grid, 2));
        assert!(a.heights().iter().all(|h| h.is_finite()), "{}", surface.name);
        assert_eq!(a, surface.patch(grid, 1));
        let (rms, other) = (a.rms_mm(), b.rms_mm());
        assert!((0.5..2.0).contains(&(rms / other)), "{}: {rms} {other}", surface.name);
        // Steps over the seam are as large as steps elsewhere.
        let step = |from: i64, to: i64| {
            let sum: f64 = (0..512).map(|row| f64::from((a.point(to, row) - a.point(from, row)).abs())).sum();
            sum / 512.0
        };
        let usual = (0..512).map(|c| step(c, c + 1)).fold(0.0, f64::max);
        assert!(step(511, 512) <= usual, "{}", surface.name);
        assert!(a != b);
    }
}

#[test]
fn a_wide_patch_has_the_pitch_of_a_narrow_one() {
    let surface = made_surfaces().into_iter().find(|s| s.name == "square grating 3 mm").unwrap();
    // Number of rises through the mean around the patch.
    let ridges = |patch: &HeightField| {
        let middle = 0.5 * patch.heights().iter().fold(0.0, |most: f32, h| most.max(*h));
        let row = &patch.heights()[..patch.side()];
        let next = row.iter().cycle().skip(1);
        row.iter().zip(next).filter(|(here, next)| **here < middle && **next >= middle).count()
    };
    // 20.48 mm are 6.8 periods and 81.92 mm are 27.3, so the wider patch alone would have another
    // pitch.
    let grid = (512, 0.04);
    assert_eq!(ridges(&surface.patch(grid, 5)), 7);
    assert_eq!(ridges(&surface.patch((4 * grid.0, grid.1), 5)), 27);
    assert_eq!(ridges(&surface.wide_patch(grid, 4, 5)), 28);
}

#[test]
fn statistics_are_as_stated() {
    let grid = (1024, 0.02);
    let of = |name: &str| {
        let surface = made_surfaces().into_iter().find(|s| s.name == name).expect("a surface");
        surface.as_stated(grid, 3)
    };
    let brushed = of("brushed aluminium").rms_mm();
    assert!((brushed / 0.000_8 - 1.0).abs() < 0.15, "{brushed}");
    let mean = |heights: &mut dyn Iterator<Item = f64>| heights.sum::<f64>() / 6.0;
    let frosted = made_surfaces().into_iter().find(|s| s.name == "frosted acrylic").expect("a surface");
    let pieces: Vec<f64> = (0..6).map(|seed| frosted.patch((256, 0.02), seed).rms_mm()).collect();
    let usual = mean(&mut pieces.iter().copied());
    assert!((usual / 0.001_4 - 1.0).abs() < 0.1, "{usual}");
    let spread = mean(&mut pieces.iter().map(|p| (p / usual - 1.0).powi(2))).sqrt();
    assert!((0.03..0.15).contains(&spread), "{spread}");
    // A square wave with an edge: its depth from top to bottom.
    let grating = of("square grating 2 mm");
    let (low, high) = grating.heights().iter().fold((f32::MAX, f32::MIN), |(l, h), x| (l.min(*x), h.max(*x)));
    assert!((high - low - 0.1).abs() < 0.012, "{}", high - low);
    // Roughness grows with the grain.
    let rms: Vec<f64> =
        ["sandpaper P36", "sandpaper P80", "sandpaper P180", "sandpaper P400"].map(|n| of(n).rms_mm()).into();
    assert!(rms.windows(2).all(|w| w[0] > 1.5 * w[1]), "{rms:?}");
    let lay = of("brushed steel");
    let along: f64 = (0..1024).map(|i| f64::from((lay.point(7, i + 1) - lay.point(7, i)).powi(2))).sum();
    let across: f64 = (0..1024).map(|i| f64::from((lay.point(i + 1, 7) - lay.point(i, 7)).powi(2))).sum();
    assert!(across > 10.0 * along, "{across} {along}");
}

/// Distance of the heights below and above which this part of a patch lies.
fn span(patch: &HeightField, part: f64) -> f64 {
    let mut heights = patch.heights().to_vec();
    heights.sort_unstable_by(f32::total_cmp);
    let at = |part: f64| f64::from(heights[(part * (heights.len() - 1) as f64).round() as usize]);
    at(1.0 - part) - at(part)
}

#[test]
fn heights_of_foam_pebbles_and_sandpaper_are_as_stated() {
    let mut tested = [0; 4];
    for surface in made_surfaces() {
        let name = &surface.name;
        let mean = |of: &dyn Fn(&HeightField) -> f64| {
            (0..6).map(|seed| of(&surface.as_stated((256, 0.04), seed))).sum::<f64>() / 6.0
        };
        match surface.recipe {
            Recipe::Sandpaper(grain_mm) => {
                let patch = surface.as_stated((512, 0.02), 3);
                // Without resin and backing, 0.03 of a grain and 2 um.
                let rms = (patch.rms_mm().powi(2) - (0.03 * grain_mm + 0.002).powi(2)).sqrt();
                assert!((rms / (0.14 * grain_mm) - 1.0).abs() < 0.06, "{name}: {rms}");
                // Tops are 0.6 of a grain's size, blunted at 0.85 of that. Grains larger than most by
                // twice the spread of their logarithm (0.15) make 0.69 of the mean size. On fine grades
                // the resin adds to it.
                let tops = span(&patch, 1e-3) / grain_mm;
                assert!(grain_mm < 0.1 || (0.62..0.8).contains(&tops), "{name}: {tops}");
                tested[0] += 1;
            }
            Recipe::Foam(of) => {
                // From the walls to the deepest cells.
                let depth = span(&surface.as_stated((512, 0.04), 3), 1e-3) / (of.depth * of.pore_mm);
                // Grooves between beads are shallow, so the beads' roughness counts as much.
                let stated = if name == "polystyrene beads, cut" { 1.3..2.2 } else { 0.85..1.2 };
                assert!(stated.contains(&depth), "{name}: {depth}");
                tested[1] += 1;
            }
            Recipe::Pebbled(of) if of.mould == Mould::Waves => {
                // Gaussian waves, bent by tanh so that one standard deviation is half the height.
                let bent = |g: f64| {
                    (0.5 * of.height_mm * (of.flatness * g).tanh() / of.flatness.tanh())
                        .clamp(-of.height_mm, of.height_mm)
                };
                let (sum, weight) = (-500..=500)
                    .map(|n| 0.01 * f64::from(n))
                    .map(|g| (bent(g).powi(2), (-0.5 * g * g).exp()))
                    .fold((0.0, 0.0), |(sum, all), (square, weight)| (sum + weight * square, all + weight));
                let want = (sum / weight + of.matt_mm.powi(2)).sqrt();
                let rms = mean(&|patch| patch.rms_mm());
                assert!((rms / want - 1.0).abs() < 0.05, "{name}: {rms}, not {want}");
                let height = mean(&|patch| span(patch, 0.158_7));
                assert!((height / of.height_mm - 1.0).abs() < 0.07, "{name}: {height}");
                tested[2] += 1;
            }
            Recipe::Pebbled(of) => {
                // From creases to tops, with the matt on both.
                let height = mean(&|patch| span(patch, 0.01)) / of.height_mm;
                assert!((0.93..1.15).contains(&height), "{name}: {height}");
                tested[3] += 1;
            }
            _ => {}
        }
    }
    assert_eq!(tested, [14, 14, 6, 8]);
}

/// Root mean square height and slope, and the wavelength that halves the power, along lines of both
/// directions.
fn statistics(patch: &HeightField) -> [f64; 3] {
    let side = patch.side();
    let mut power = vec![0.0; side / 2];
    let mean = patch.mean_mm();
    for line in 0..side as i64 {
        for along in [true, false] {
            let values: Vec<f64> = (0..side as i64)
                .map(|i| f64::from(if along { patch.point(i, line) } else { patch.point(line, i) }) - mean)
                .collect();
            let bins = asperity_fft::spectrum(values);
            power.iter_mut().zip(&bins[1..]).for_each(|(sum, bin)| *sum += bin.norm_sqr());
        }
    }
    let half = 0.5 * power.iter().sum::<f64>();
    let mut below = 0.0;
    let mut middle = 0.5;
    for (bin, here) in power.iter().enumerate() {
        if below + here >= half {
            middle = bin as f64 + 0.5 + (half - below) / here;
            break;
        }
        below += here;
    }
    [patch.rms_mm(), patch.rms_slope(), patch.length_mm() / middle]
}

/// Number of each family's 13 neighbouring pairs that overlap in at least one, two and three
/// [statistics] over six pieces. Two ranges overlap unless one's least is above the other's most.
fn overlapping(grid: (usize, f64)) -> Vec<[usize; 3]> {
    let ranges: Vec<[[f64; 2]; 3]> = made_surfaces()
        .iter()
        .map(|surface| {
            let mut ranges = [[f64::MAX, f64::MIN]; 3];
            for seed in 0..6 {
                let of = statistics(&surface.patch(grid, seed));
                ranges.iter_mut().zip(of).for_each(|(r, s)| *r = [r[0].min(s), r[1].max(s)]);
            }
            ranges
        })
        .collect();
    let shared = |pair: &[[[f64; 2]; 3]]| {
        pair[0].iter().zip(pair[1]).filter(|(a, b)| a[0] <= b[1] && b[0] <= a[1]).count()
    };
    let family = |of: &[[[f64; 2]; 3]]| {
        [1, 2, 3].map(|least| of.windows(2).filter(|pair| shared(pair) >= least).count())
    };
    ranges.chunks(14).map(family).collect()
}

#[test]
fn some_neighbours_overlap_in_measured_statistics() {
    let found = overlapping((256, 0.04));
    // In each family some pairs share one range, few share two and hardly any share three.
    assert!(found.iter().all(|of| of[0] >= 5), "{found:?}");
    let [one, two, three] = [0, 1, 2].map(|n| found.iter().map(|of| of[n]).sum::<usize>());
    assert!((54..=62).contains(&one) && (12..=20).contains(&two) && (1..=5).contains(&three), "{found:?}");
}
