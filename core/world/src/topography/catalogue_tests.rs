use super::*;

#[test]
fn there_are_fourteen_of_each_family_by_names_of_their_own() {
    let surfaces = made_surfaces();
    let names: std::collections::BTreeSet<&str> = surfaces.iter().map(|s| s.name.as_str()).collect();
    assert_eq!((surfaces.len(), names.len()), (112, 112));
    for family in Family::ALL {
        assert_eq!(surfaces.iter().filter(|s| s.family == family).count(), 14);
    }
}

#[test]
fn a_patch_has_no_seam_and_another_seed_is_another_piece_of_the_same() {
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
fn statistics_are_as_stated() {
    let grid = (1024, 0.02);
    let of = |name: &str| {
        let surface = made_surfaces().into_iter().find(|s| s.name == name).expect("a surface");
        surface.patch(grid, 3)
    };
    let brushed = of("brushed aluminium").rms_mm();
    assert!((brushed / 0.000_8 - 1.0).abs() < 0.15, "{brushed}");
    let mean = |heights: &mut dyn Iterator<Item = f64>| heights.sum::<f64>() / 6.0;
    let frosted = made_surfaces().into_iter().find(|s| s.name == "frosted acrylic").expect("a surface");
    let pieces: Vec<f64> = (0..6).map(|seed| frosted.patch((256, 0.02), seed).rms_mm()).collect();
    let usual = mean(&mut pieces.iter().copied());
    assert!((usual / 0.001_4 - 1.0).abs() < 0.06, "{usual}");
    let spread = mean(&mut pieces.iter().map(|p| (p / usual - 1.0).powi(2))).sqrt();
    assert!((0.01..0.08).contains(&spread), "{spread}");
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

#[test]
#[ignore = "writes a picture to look at: ASPERITY_LOOK names the file, a .pgm"]
fn a_sheet_of_all_surfaces() {
    let Ok(path) = std::env::var("ASPERITY_LOOK") else { return };
    let (edge, side) = (160, 512);
    let surfaces = made_surfaces();
    let (columns, rows) = (14, surfaces.len() / 14);
    let mut pixels = vec![0_u8; columns * rows * edge * edge];
    for (n, surface) in surfaces.iter().enumerate() {
        let patch = surface.patch((side, 0.04), 1);
        let slope = patch.rms_slope().max(1e-6);
        for y in 0..edge {
            for x in 0..edge {
                let place = 0.08;
                let dx = patch.sample(x as f64 * place, y as f64 * place).slope[0];
                let shade = 128.0 + 60.0 * dx / slope;
                pixels[((n / columns) * edge + y) * columns * edge + (n % columns) * edge + x] = shade as u8;
            }
        }
    }
    let mut file = format!("P5 {} {} 255\n", columns * edge, rows * edge).into_bytes();
    file.extend(pixels);
    std::fs::write(path, file).expect("a picture");
}
