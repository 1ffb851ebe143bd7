//! `asperity invert`, as a user runs it.

use asperity_accuracy::npy;
use harness::retrieval::{score, vector};
use harness::{Ran, Room};

/// Writes a vector's magnitudes at 2500 Hz to `m.npy` and answers them.
fn write_magnitudes(dir: &Room, name: &str) -> Vec<f32> {
    let mags = vector(name, 2500);
    let file = std::fs::File::create(dir.join("m.npy")).unwrap();
    npy::write_f32(file, &[mags.len() / 101, 101], &mags).unwrap();
    mags
}

fn invert(dir: &Room, phase: &str, rate: &str, out: &str) -> Ran {
    dir.run(&format!("invert --phase {phase} --magnitudes m.npy --rate {rate} --scale dft --out {out}"))
}

/// A bug once: the amplitudes of a probe were taken for those of an unscaled DFT, 36 dB too small.
#[test]
fn probed_magnitudes_come_back_at_their_level() {
    let dir = Room::new();
    let probes = "--probe texture=m.npz --probe texture=m.npy --probe phase=y.npy";
    dir.run(&format!("render graphs/texture.ron --seconds 2 {probes}")).ok();
    dir.run("invert --magnitudes m.npz --out a.npy").ok();
    dir.run("invert --magnitudes m.npy --rate 2500 --scale amplitude --out b.npy").ok();
    assert!(dir.npy("a.npy") == dir.npy("b.npy"), "an archive states what the options state");
    let level = |file: &str| {
        let signal = dir.npy(file);
        (signal.iter().map(|x| f64::from(x * x)).sum::<f64>() / signal.len() as f64).sqrt()
    };
    let off = 20.0 * (level("a.npy") / level("y.npy")).log10();
    // The node of the graph has a gate and the scatter of the network besides.
    assert!(off.abs() < 3.0, "{off} dB");
}

#[test]
fn array_without_its_convention_is_refused() {
    let dir = Room::new();
    write_magnitudes(&dir, "texture_2500");
    for (options, says) in [
        ("--rate 2500", "`--scale dft`: |sum w x|"),
        ("--scale dft", "`--rate HZ`, or a .npz file"),
        ("--rate 2500 --scale decibel", "dft"),
    ] {
        dir.run(&format!("invert --magnitudes m.npy --out y.npy {options}")).refused(says);
    }
    assert_eq!(dir.files(), ["m.npy"]);
}

/// `np.savez_compressed` of NumPy 2.4.6 made the file, from 3 frames of `texture_2500` at the scale "dft".
#[test]
fn archive_by_numpy_is_taken() {
    let dir = Room::new();
    let archive = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/phase/by_numpy.npz");
    dir.run(&format!("invert --phase spsi --magnitudes {archive} --out a.npy")).ok();
    let mags = vector("texture_2500", 2500);
    npy::write_f32(std::fs::File::create(dir.join("m.npy")).unwrap(), &[3, 101], &mags[..303]).unwrap();
    invert(&dir, "spsi", "2500", "b.npy").ok();
    assert!(dir.npy("a.npy") == dir.npy("b.npy"));
    dir.run(&format!("invert --magnitudes {archive} --rate 44100 --out c.npy")).refused("2500 Hz, not 44100");
}

#[test]
fn default_is_what_the_recommended_graph_uses() {
    let dir = Room::new();
    write_magnitudes(&dir, "texture_2500");
    let [default, shaped, other] = ["default", "shaped_noise:precision=f32", "default:seed=77"].map(|kind| {
        invert(&dir, kind, "2500", "y.npy").ok();
        dir.npy("y.npy")
    });
    assert!(default == shaped && default != other, "a parameter must reach the node");
    invert(&dir, "default", "2500", "y.wav").ok();
    assert!(dir.wav("y.wav") == (default, 2500), "a WAV file holds what the array holds");
}

#[test]
fn bad_magnitudes_are_refused_or_counted() {
    let dir = Room::new();
    let write = |shape: &[usize], values: &[f32]| {
        npy::write_f32(std::fs::File::create(dir.join("m.npy")).unwrap(), shape, values).unwrap();
    };
    write(&[3, 200], &[1.0; 600]);
    for (phase, rate, out, says) in [
        ("spsi", "2500", "y.npy", "1 to 126 bins at 2500 Hz"),
        ("spsi", "2503", "y.npy", "a multiple of 10"),
        ("spsy", "48000", "y.npy", "did you mean `spsi`?"),
        ("gain", "48000", "y.npy", "is not a phase-retrieval node"),
        ("spsi:sed=1", "48000", "y.npy", "did you mean `seed`?"),
        ("spsi:seed", "48000", "y.npy", "no `=`"),
        ("griffin_lim:alpha=0.5", "48000", "y.npy", "`griffin_lim` has no parameter `alpha`"),
        ("spsi", "48000", "y.mp3", ".wav or .npy"),
    ] {
        invert(&dir, phase, rate, out).refused(says);
    }
    dir.write("m.npy", b"not an array");
    invert(&dir, "spsi", "2500", "y.npy").refused("");
    assert_eq!(dir.files(), ["m.npy"]);

    let mut values = vec![1.0_f32; 101 * 20];
    (values[5], values[300], values[700]) = (f32::NAN, f32::INFINITY, -1.0);
    write(&[20, 101], &values);
    invert(&dir, "spsi", "2500", "y.npy").ok().says(&["3 magnitudes are negative or not finite"]);
    assert!(dir.npy("y.npy").iter().all(|x| x.is_finite()));
}

/// Frame n covers samples from floor(n rate/500) on.
#[test]
fn signal_of_each_method_scores_as_published() {
    let dir = Room::new();
    let mags = write_magnitudes(&dir, "texture_2500");
    for (phase, most) in [
        ("spsi", -11.2),
        ("sample_commit:emission=0", -25.0),
        ("sample_commit:emission=-25,momentum=0.85,frames=5,passes=6", -21.0),
        ("griffin_lim:iterations=30", -14.0),
        ("fast_griffin_lim:iterations=30", -17.0),
    ] {
        invert(&dir, phase, "2500", "y.npy").ok();
        let y = npy::read(dir.join("y.npy")).unwrap().values.into_f64();
        assert_eq!(y.len(), (mags.len() / 101 - 1) * 5 + 250, "{phase}");
        let db = score(&mags, 2500, &y).convergence_db;
        assert!(db < most, "{phase}: {db} dB");
    }
}
