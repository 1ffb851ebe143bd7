use super::*;

const RATE: u32 = 48_000;

fn full(channels: usize) -> Ramp {
    let mut ramp = Ramp::new(RATE, channels, 0.0);
    ramp.play(&mut vec![1.0; channels]);
    ramp
}

/// The envelope itself, by a signal of 1.
fn ones(ramp: &mut Ramp, frames: usize) -> Vec<f32> {
    let mut x = vec![1.0; frames];
    ramp.play(&mut x);
    x
}

fn largest_step(x: &[f32]) -> f32 {
    x.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max)
}

#[test]
fn start_rises_over_2_s_as_a_raised_cosine() {
    let mut ramp = Ramp::new(RATE, 1, START_S);
    assert_eq!(ramp.level(), Level::Rising);
    let x = ones(&mut ramp, 96_000);
    for (i, got) in x.iter().enumerate() {
        let want = 0.5 * (1.0 - (PI * (i + 1) as f64 / 96_000.0).cos());
        assert!((f64::from(*got) - want).abs() < 1e-6, "{i}: {got} {want}");
    }
    assert_eq!(ramp.level(), Level::Full);
    let mut signal = [0.1_f32, -0.3, 1e-9, f32::NAN];
    ramp.play(&mut signal);
    assert_eq!(signal, [0.1, -0.3, 1e-9, 0.0], "bit for bit");
}

#[test]
fn stop_is_silent_after_15_ms_from_any_level() {
    let mut ramp = full(1);
    ramp.open(false);
    let x = ones(&mut ramp, 720);
    assert!(x[359] > 0.49 && x[359] < 0.51 && x[718] > 0.0 && x[719] == 0.0);
    assert!(ramp.silent() && largest_step(&x) < 0.0023);
    assert_eq!(ones(&mut ramp, 100), [0.0; 100]);

    let mut ramp = Ramp::new(RATE, 1, START_S);
    let mut x = ones(&mut ramp, 48_000);
    ramp.open(false);
    x.extend(ones(&mut ramp, 720));
    assert!(ramp.silent() && largest_step(&x) < 0.0023);
    ramp.open(true);
    assert!(ones(&mut ramp, 95_000)[94_999] < 1.0, "a start that was broken off is as slow again");
}

#[test]
fn unmute_rises_from_the_current_level() {
    let mut ramp = full(1);
    ramp.open(false);
    let mut x = ones(&mut ramp, 300);
    ramp.open(true);
    x.extend(ones(&mut ramp, 9_600));
    assert!(ramp.level() == Level::Full && x[x.len() - 1] == 1.0 && largest_step(&x) < 0.0023);
}

#[test]
fn underrun_fades_out_and_in_on_every_channel() {
    let mut ramp = full(2);
    let mut x: Vec<f32> = (0..480).flat_map(|i| [(i as f32 * 0.05).sin() * 0.8, 0.25]).collect();
    ramp.play(&mut x);
    let (a, b) = (x[958], x[959]);
    let mut gap = vec![9.0; 2 * 300];
    ramp.starve(&mut gap);
    for (i, frame) in gap.chunks_exact(2).enumerate() {
        let w = (0.5 * (1.0 + (PI * (i + 1) as f64 / 240.0).cos())) as f32 * f32::from(i < 240);
        assert!((frame[0] - a * w).abs() < 1e-6 && (frame[1] - b * w).abs() < 1e-6, "{i}");
    }
    let mut after = vec![1.0; 2 * 480];
    ramp.play(&mut after);
    let w = |i: usize| (0.5 * (1.0 - (PI * (i + 1) as f64 / 480.0).cos())) as f32;
    assert!((0..480).all(|i| (after[2 * i + 1] - w(i)).abs() < 1e-6));
    let mut still = vec![0.5; 2];
    ramp.play(&mut still);
    assert_eq!(still, [0.5, 0.5]);
}

#[test]
fn breaks_never_raise_the_level_or_step() {
    let mut ramp = full(1);
    let mut heard = vec![1.0];
    for n in [1, 3, 100, 240, 7, 481, 50, 2, 2, 600] {
        let mut gap = vec![5.0; n];
        ramp.starve(&mut gap);
        heard.extend(gap);
        heard.extend(ones(&mut ramp, n * 2));
        ramp.broken();
        heard.extend(ones(&mut ramp, n));
    }
    assert!(heard.iter().all(|x| (0.0..=1.0).contains(x)));
    // A raised cosine over 5 ms is at most pi / 2 / 240 steep, and with one of 10 ms against it not steeper.
    assert!(largest_step(&heard) < 0.007, "{}", largest_step(&heard));
    ramp.open(false);
    let mut rest = vec![0.0; 720];
    ramp.starve(&mut rest);
    assert!(ramp.silent());
}
