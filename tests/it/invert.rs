//! `asperity invert`, as a user runs it.

use std::path::Path;

use asperity_accuracy::npy;
use harness::retrieval::{score, vector};
use harness::{Ran, files, run, wav};

/// Writes a vector's magnitudes at 2500 Hz to `m.npy` and answers them.
fn write_magnitudes(dir: &Path, name: &str) -> Vec<f32> {
    let mags = vector(name, 2500);
    let file = std::fs::File::create(dir.join("m.npy")).unwrap();
    npy::write_f32(file, &[mags.len() / 101, 101], &mags).unwrap();
    mags
}

fn invert(dir: &Path, phase: &str, rate: &str, out: &str) -> Ran {
    run(dir, &["invert", "--phase", phase, "--magnitudes", "m.npy", "--rate", rate, "--out", out])
}

#[test]
fn default_is_what_the_recommended_graph_uses() {
    let dir = tempfile::tempdir().unwrap();
    write_magnitudes(dir.path(), "texture_2500");
    for (kind, out) in
        [("default", "a.npy"), ("shaped_noise:precision=f32", "b.npy"), ("default:seed=77", "c.npy")]
    {
        invert(dir.path(), kind, "2500", out).ok();
    }
    let read = |n: &str| std::fs::read(dir.path().join(n)).unwrap();
    assert!(read("a.npy") == read("b.npy"));
    assert!(read("a.npy") != read("c.npy"), "a parameter must reach the node");
}

#[test]
fn a_wav_holds_what_the_npy_holds() {
    let dir = tempfile::tempdir().unwrap();
    write_magnitudes(dir.path(), "texture_2500");
    for out in ["y.npy", "y.wav"] {
        invert(dir.path(), "default", "2500", out).ok();
    }
    let (samples, rate) = wav(&dir.path().join("y.wav"));
    assert_eq!(rate, 2500);
    assert_eq!(samples, npy::read(dir.path().join("y.npy")).unwrap().values.into_f32());
}

#[test]
fn bad_magnitudes_are_refused_or_counted() {
    let dir = tempfile::tempdir().unwrap();
    let write = |shape: &[usize], values: &[f32]| {
        npy::write_f32(std::fs::File::create(dir.path().join("m.npy")).unwrap(), shape, values).unwrap();
    };
    write(&[3, 200], &[1.0; 600]);
    for (phase, rate, out, says) in [
        ("spsi", "2500", "y.npy", "1 to 126 bins at 2500 Hz"),
        ("spsi", "2503", "y.npy", "a multiple of 10"),
        ("spsy", "48000", "y.npy", "did you mean `spsi`?"),
        ("gain", "48000", "y.npy", "no phase-retrieval node"),
        ("spsi:sed=1", "48000", "y.npy", "did you mean `seed`?"),
        ("spsi:seed", "48000", "y.npy", "no `=`"),
        ("griffin_lim:alpha=0.5", "48000", "y.npy", "`griffin_lim` has no parameter `alpha`"),
        ("spsi", "48000", "y.mp3", ".wav or .npy"),
    ] {
        let ran = invert(dir.path(), phase, rate, out);
        assert_eq!(ran.code, 2, "{phase} {rate}: {}{}", ran.out, ran.err);
        assert!(ran.err.contains(says), "{phase} {rate}: expected `{says}` in {}", ran.err);
    }
    std::fs::write(dir.path().join("m.npy"), b"not an array").unwrap();
    assert_eq!(invert(dir.path(), "spsi", "2500", "y.npy").code, 2);
    assert_eq!(files(dir.path()), ["m.npy"]);

    let mut values = vec![1.0_f32; 101 * 20];
    (values[5], values[300], values[700]) = (f32::NAN, f32::INFINITY, -1.0);
    write(&[20, 101], &values);
    invert(dir.path(), "spsi", "2500", "y.npy").ok().says(&["3 magnitudes are negative or not finite"]);
    let y = npy::read(dir.path().join("y.npy")).unwrap().values.into_f32();
    assert!(y.iter().all(|x| x.is_finite()));
}

/// Frame n covers samples from floor(n rate/500) on.
#[test]
fn signal_of_each_method_scores_as_published() {
    let dir = tempfile::tempdir().unwrap();
    let mags = write_magnitudes(dir.path(), "texture_2500");
    for (phase, most) in [
        ("spsi", -11.2),
        ("sample_commit:emission=0", -25.0),
        ("sample_commit:emission=-25,momentum=0.85,frames=5,passes=6", -21.0),
        ("griffin_lim:iterations=30", -14.0),
        ("fast_griffin_lim:iterations=30", -17.0),
    ] {
        invert(dir.path(), phase, "2500", "y.npy").ok();
        let y = npy::read(dir.path().join("y.npy")).unwrap().values.into_f64();
        assert_eq!(y.len(), (mags.len() / 101 - 1) * 5 + 250, "{phase}");
        let db = score(&mags, 2500, &y).convergence_db;
        assert!(db < most, "{phase}: {db} dB");
    }
}
