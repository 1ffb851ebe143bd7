//! The shipped stroke equals the made one and is what its first lines say.

use std::path::PathBuf;

use asperity_diagnostics::Source;
use asperity_motion::{Sample, Trajectory, TrajectoryOptions};

#[path = "../../core/motion/examples/make_zigzag.rs"]
#[expect(dead_code, reason = "the example's own main is not called here")]
mod make_zigzag;

fn shipped() -> PathBuf {
    harness::graphs("trajectories/zigzag.csv")
}

/// A few places may differ by one sensor step, since another `sin` may round differently.
#[test]
fn the_shipped_file_is_what_the_example_makes() {
    let options = TrajectoryOptions::default();
    let file = Trajectory::read(shipped(), &options).unwrap();
    let made = Trajectory::parse(&Source::new("made", make_zigzag::csv()), &options).unwrap();
    assert_eq!((file.rows(), file.duration_s()), (made.rows(), made.duration_s()));
    let mut differ = 0;
    for i in 0..file.rows() {
        let t = i as f64 * file.duration_s() / (file.rows() - 1) as f64;
        let (Sample { position: a, .. }, Sample { position: b, .. }) = (file.sample(t), made.sample(t));
        for k in 0..3 {
            assert!((a[k] - b[k]).abs() <= make_zigzag::QUANTUM_MM + 2e-3, "{t} s: {a:?} {b:?}");
            differ += usize::from(a[k] != b[k]);
        }
    }
    assert!(differ <= file.rows() / 200, "{differ} of {} rows", file.rows());
}

#[test]
fn scripted_run_has_its_strokes_pause_lift_off_and_forces() {
    let t = Trajectory::read(shipped(), &TrajectoryOptions::default()).unwrap();
    assert!((7.5..8.5).contains(&t.duration_s()), "{}", t.duration_s());
    assert!(std::fs::metadata(shipped()).unwrap().len() < 300_000);

    // Planar speed over 20 ms, longer than a sensor step lasts.
    let at = |i: i32| t.sample(f64::from(i) * 0.002).position;
    let rows = t.rows() as i32;
    let (mut fastest, mut hardest, mut softest): (f64, f64, f64) = (0.0, 0.0, f64::MAX);
    let (mut quiet, mut longest_quiet, mut touches) = (0, 0, 0);
    for i in 0..rows {
        let (a, b) = (at(i - 5), at(i + 5));
        let speed = (b[0] - a[0]).hypot(b[1] - a[1]) / 0.02;
        let force = -at(i)[2] * make_zigzag::STIFFNESS_N_PER_MM;
        fastest = fastest.max(speed);
        hardest = hardest.max(force);
        if force > 0.0 && speed > 40.0 {
            softest = softest.min(force);
        }
        quiet = if force > 0.5 && speed < 5.0 { quiet + 1 } else { 0 };
        longest_quiet = longest_quiet.max(quiet);
        touches += usize::from(force > 0.0 && at(i - 1)[2] >= 0.0);
    }
    assert!((170.0..185.0).contains(&fastest), "{fastest}");
    assert!((2.4..2.6).contains(&hardest), "{hardest}");
    assert!((0.25..0.6).contains(&softest), "{softest}");
    assert_eq!(touches, 2);
    assert!(longest_quiet > 250, "half a second of pause, found {} ms", longest_quiet * 2);
    assert!(at(0)[2] > 5.0 && at(rows)[2] > 5.0, "starts and ends above the surface");
}
