//! `asperity render`: a stroke goes in, a file that an actuator could play comes out.

use std::f64::consts::TAU;
use std::time::Duration;

use harness::live::{largest_step, rms};
use harness::{Ran, Room, asperity, graphs, node};

/// Renders the shipped graph with these words.
fn render(dir: &Room, args: &str) -> Ran {
    dir.run(&format!("render graphs/heravi2024.ron {args}"))
}

/// A trajectory at 500 Hz: straight along x at a speed, pressed to a depth from `from` to `to` seconds;
/// before and after above the surface, moving from 0.3 s before to 0.3 s after.
fn straight(speed_mm_s: f64, depth_mm: f64, from: f64, to: f64, seconds: f64) -> String {
    harness::csv(seconds, |t| {
        let z = if (from..to).contains(&t) { -depth_mm } else { 5.0 };
        [speed_mm_s * t.clamp(from - 0.3, to + 0.3), 0.0, z]
    })
}

#[test]
fn one_command_makes_wav_plot_and_report() {
    let dir = Room::new();
    let words = "rendered|x real time|p50|p99|latency|peak|limiter|faults|wrote";
    render(&dir, "--out o.wav --plot p.svg --report r.json").ok().says(&words.split('|').collect::<Vec<_>>());
    assert_eq!(dir.files(), ["o.wav", "p.svg", "r.json"]);
    let report = dir.json("r.json");
    let ticks = report["ticks"].as_u64().unwrap();
    let (samples, rate) = dir.wav("o.wav");
    assert_eq!((rate, samples.len() as u64), (48_000, ticks * 96));
    assert!(ticks > 500 * 5, "the shipped stroke lasts some seconds");
    for key in ["p50", "p99", "p999", "max"] {
        assert!(report["tick_us"][key].as_f64().unwrap() > 0.0, "{key}");
    }
    assert!(report["realtime_factor"].as_f64().unwrap() > 1.0 && report["asperity"].is_string());
    assert!(report["latency"]["declared_ms"].as_f64().unwrap() > 0.0);
    assert!(
        report["faults"] == 0 && report["seed"] == 2024 && report["dropped"].as_array().unwrap().is_empty()
    );
    let nodes = report["nodes"].as_array().unwrap();
    assert_eq!(nodes.len(), 12);
    let network = node(&report, "texture");
    assert!(network["facts"]["executor"].as_str().unwrap().contains("packed"), "{network}");
    assert!(network["facts"]["error_against_tract"]["value"].as_f64().unwrap() < 1e-4);
    assert!(network["calls"].as_u64().unwrap() < ticks, "it sleeps while the stylus is off the surface");
    for n in nodes {
        let missing =
            ["id", "kind", "calls", "us_p50", "us_p99", "faults"].iter().find(|key| n[*key].is_null());
        assert!(missing.is_none(), "{missing:?} of {n}");
    }
    // What is written is what the amplifier gets: 1 A/V and 1 V at full scale, so samples are amperes.
    let peak = samples.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    assert!((report["output"]["peak"].as_f64().unwrap() - f64::from(peak)).abs() < 1e-6);
    assert!((report["output"]["rms"].as_f64().unwrap() - rms(&samples)).abs() < 1e-6);
    assert_eq!(report["output"]["unit"], "A");
    assert!(peak > 0.01, "a texture must be there: {peak}");
    assert!(rms(&samples) < 0.1478, "the coil's rating");
    let svg = dir.text("p.svg");
    for panel in ["Position", "Speed", "Normal force", "Acceleration", "Coil current", "canvas"] {
        assert!(svg.contains(panel), "no {panel} in the plot");
    }
}

#[test]
fn sleeping_changes_no_byte() {
    let dir = Room::new();
    for name in ["heravi2024", "heravi2024_scatter", "texture"] {
        let [a, b] = ["", " --no-sleep --no-prune"].map(|more| {
            dir.run(&format!("render graphs/{name}.ron --seconds 3 --out o.wav{more}")).ok();
            dir.bytes("o.wav")
        });
        assert!(a == b, "{name}");
    }
}

/// Magnitudes that are means sound as loud as root mean squares.
#[test]
fn scatter_of_strength_0_changes_no_byte_and_means_are_as_loud() {
    let dir = Room::new();
    let render = |graph: &str, set: &str| {
        dir.run(&format!("render graphs/{graph}.ron --out o.wav --seconds 2 {set}")).ok();
        dir.wav("o.wav").0
    };
    let model = |name: &str| {
        format!("--set texture.model={}", graphs(&format!("models/surfaces/{name}.onnx")).display())
    };
    let (squares, means) = (model("texture"), model("texture_mean"));
    let without = render("heravi2024", &squares);
    assert_eq!(render("heravi2024_scatter", "--set scatter.strength=0"), without);
    let scattered = render("heravi2024_scatter", "");
    assert!(rms(&scattered) > 2.0 * rms(&without));
    let of_means = 20.0 * (rms(&render("heravi2024_scatter", &means)) / rms(&scattered)).log10();
    assert!(of_means.abs() < 0.5, "{of_means} dB");
    // The recommended graph too: it had no wire that says which of them they are.
    let of_means = 20.0 * (rms(&render("texture", &means)) / rms(&render("texture", &squares))).log10();
    assert!(of_means.abs() < 0.6, "{of_means} dB");
}

#[test]
fn every_rate_gives_its_number_of_samples() {
    let dir = Room::new();
    for (tick_hz, audio_hz) in [(500, 44_100), (4000, 96_000), (100, 48_000), (700, 8_000), (500, 22_050)] {
        let sets = format!("--set tick_hz={tick_hz} --set audio_hz={audio_hz}");
        render(&dir, &format!("--out o.wav --seconds 2 {sets}")).ok();
        let (samples, rate) = dir.wav("o.wav");
        assert_eq!((rate as usize, samples.len()), (audio_hz, 2 * audio_hz), "{sets}");
        assert!(rms(&samples) > 1e-3 && samples.iter().all(|x| x.is_finite()), "{sets}");
    }
}

#[test]
fn the_level_does_not_depend_on_tick_rate_or_synthesis() {
    let dir = Room::new();
    dir.write("t.csv", straight(100.0, 2.0, 0.2, 3.8, 4.0));
    let level = |sets: &str| {
        render(&dir, &format!("--input t.csv --probe gate.out=a.npy {sets}")).ok();
        let a = dir.npy("a.npy");
        20.0 * rms(&a[a.len() / 4..a.len() / 8 * 7]).log10()
    };
    let reference = level("");
    for sets in [
        "--set tick_hz=1000",
        "--set tick_hz=250",
        "--set texture.synthesis_hz=0",
        "--set texture.synthesis_hz=0 --set audio_hz=44100",
        "--set audio_hz=44100",
        "--set tick_hz=700",
    ] {
        let other = level(sets);
        assert!((other - reference).abs() < 1.0, "{sets}: {other} dB, not {reference} dB");
    }
}

#[test]
fn there_is_silence_off_the_surface_and_at_rest() {
    let dir = Room::new();
    let level = |speed_mm_s: f64, depth_mm: f64| {
        dir.write("t.csv", straight(speed_mm_s, depth_mm, 0.5, 1.5, 2.0));
        render(&dir, "--input t.csv --probe gate.out=a.npy --report r.json").ok();
        (rms(&dir.npy("a.npy")), node(&dir.json("r.json"), "texture")["calls"].as_u64().unwrap())
    };
    let (touching, calls) = level(100.0, 2.0);
    assert!(touching > 0.1 && (500..700).contains(&calls), "{touching} {calls}");
    assert_eq!(level(100.0, -1.0), (0.0, 0), "in the air");
    // Pressed and slower than the gate. Coming down takes no motion along the surface.
    assert_eq!(level(3.0, 2.0), (0.0, 0), "at rest");
}

#[test]
fn the_gate_opens_and_closes_without_a_click() {
    let dir = Room::new();
    dir.write("t.csv", straight(120.0, 2.0, 0.5, 7.5, 8.0));
    render(&dir, "--input t.csv --out o.wav").ok();
    let (x, rate) = dir.wav("o.wav");
    let at = |seconds: f64| (seconds * f64::from(rate)) as usize;
    let step = |from: f64, to: f64| largest_step(&x[at(from)..at(to)]);
    // The touch itself may be a little more than the stroke that follows; a click would be many times that.
    let (steady, start, end) = (step(1.0, 7.4), step(0.0, 0.8), step(7.45, 8.0));
    assert!(steady > 0.0 && start.max(end) <= 1.25 * steady, "{start} and {end}, steady {steady}");
}

/// Mean power at a frequency, of Hann-windowed segments of 0.1 s at 2500 Hz.
fn power(x: &[f32], hz: f64) -> f64 {
    let segment = |part: &[f32]| {
        let (mut re, mut im) = (0.0, 0.0);
        for (i, x) in part.iter().enumerate() {
            let w = 0.5 - 0.5 * (TAU * i as f64 / 250.0).cos();
            let (sin, cos) = (TAU * hz * i as f64 / 2500.0).sin_cos();
            re += w * f64::from(*x) * cos;
            im += w * f64::from(*x) * sin;
        }
        re * re + im * im
    };
    x.chunks_exact(250).map(segment).sum()
}

/// Ridges across x; of finer ones the shipped network blurs the lines.
#[test]
fn a_grating_is_felt_at_speed_over_wavelength() {
    let (period_mm, speed) = (2.5, 100.0);
    let dir = Room::new();
    dir.write("t.csv", straight(speed, 2.0, 0.2, 7.8, 8.0));
    render(&dir, "--input t.csv --set 'texture.material=sine grating 2.5 mm' --probe synthesis=a.npy").ok();
    let a = dir.npy("a.npy");
    let heard = |bin: &usize| power(&a[2500..7 * 2500], *bin as f64 * 10.0);
    let loudest = (1..=100).max_by(|a, b| heard(a).total_cmp(&heard(b))).unwrap();
    let expected = (speed / period_mm / 10.0) as usize;
    assert!(loudest.abs_diff(expected) <= 1, "loudest at {loudest}0 Hz, expected {expected}0 Hz");
}

#[test]
fn probes_record_every_kind_of_port() {
    let dir = Room::new();
    render(
        &dir,
        "--seconds 1 --probe stylus.position=p.csv --probe motion.speed=v.npy --probe texture=m.npy \
         --probe phase.spectrum=s.npy --probe limiter=i.csv",
    )
    .ok();
    let csv = dir.text("p.csv");
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!((lines[0], lines.len()), ("t_s,0 [mm],1 [mm],2 [mm]", 501));
    assert!(lines[250].starts_with("0.498,"), "{}", lines[250]);
    let shape = |n: &str| asperity_accuracy::npy::read(dir.join(n)).unwrap().shape;
    assert_eq!((shape("v.npy"), shape("m.npy")[1], shape("s.npy")[1]), (vec![500], 101, 202));
    assert_eq!(dir.text("i.csv").lines().count(), 48_001);
}

#[test]
fn a_recorded_force_and_speed_are_outputs_of_their_own() {
    let dir = Room::new();
    let row = |k: i32| {
        let t = f64::from(k) * 0.01;
        format!("{t},{},0,-1,{},50\n", 50.0 * t, 0.5 + t)
    };
    let rows: String = (0..=100).map(row).collect();
    dir.write("t.csv", format!("t_s,x_mm,y_mm,z_mm,force_n,speed_mm_s\n{rows}"));
    dir.write(
        "g.ron",
        r#"Graph(version: 1, nodes: {
        "t": (kind: "trajectory", params: (file: "t.csv", interpolation: linear)),
        "p": (kind: "probe", params: (file: "f.npy")), "q": (kind: "probe", params: (file: "v.npy"))},
        wires: [("t.force", "p"), ("t.speed", "q")])"#,
    );
    dir.run("render g.ron").ok();
    let (force, speed) = (dir.npy("f.npy"), dir.npy("v.npy"));
    assert_eq!(force.len(), 500);
    for (k, f) in force.iter().enumerate() {
        assert!((f64::from(*f) - (0.5 + k as f64 / 500.0)).abs() < 1e-6, "{k}");
    }
    assert!(speed.iter().all(|v| *v == 50.0));
}

#[test]
fn voltage_drive_goes_through_to_the_file() {
    let dir = Room::new();
    render(&dir, "--set inverse.drive=voltage --seconds 2 --out o.wav --report r.json").ok();
    let output = &dir.json("r.json")["output"];
    assert!(output["unit"] == "V" && output["rms"].as_f64().unwrap() > 0.01, "{output}");
}

#[test]
fn what_reaches_no_sink_is_dropped_and_named() {
    let dir = Room::new();
    let graph = harness::shipped_graph()
        .replace("\"phase\": (kind: \"spsi\"),", "\"phase\": (kind: \"spsi\"), \"idle\": (kind: \"gain\"),")
        .replace("(\"texture\", \"phase\"),", "(\"texture\", \"phase\"), (\"motion.speed\", \"idle\"),");
    dir.write("g.ron", graph);
    dir.run("render g.ron --seconds 0.5 --report r.json").ok();
    let report = dir.json("r.json");
    assert_eq!(report["dropped"][0]["id"], "idle");
    assert!(report["nodes"].as_array().unwrap().iter().all(|n| n["id"] != "idle"));
    dir.run("check g.ron").ok().says(&["idle (gain): nothing reads its outputs"]);
}

#[test]
fn a_model_that_tract_runs_says_that_it_allocates() {
    let dir = Room::new();
    render(&dir, "--seconds 1 --out t.wav --report r.json --set texture.executor=tract")
        .ok()
        .says(&["`texture` allocates in every tick"]);
    let report = dir.json("r.json");
    let network = node(&report, "texture");
    assert!(network["allocation_free"] == false && network["facts"]["executor"] == "tract", "{network}");
    // Both executors render the same signal, to the tolerance of the kernels.
    render(&dir, "--seconds 1 --out p.wav").ok();
    let (a, b) = (dir.wav("t.wav").0, dir.wav("p.wav").0);
    let diff: Vec<f32> = a.iter().zip(&b).map(|(x, y)| x - y).collect();
    assert!(rms(&diff) < 0.02 * rms(&a), "{} of {}", rms(&diff), rms(&a));
}

#[cfg(unix)]
#[test]
fn ctrl_c_leaves_a_valid_wav() {
    let dir = Room::new();
    let mut child = asperity(&dir)
        .args("render graphs/heravi2024.ron --out o.wav --seconds 20000".split(' '))
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    // Once the file is growing, it renders.
    let growing = || {
        let part = dir.files().into_iter().find(|f| f.ends_with(".part"))?;
        std::fs::metadata(dir.join(part)).ok().filter(|m| m.len() > 100_000)
    };
    let began = (0..600).any(|_| {
        std::thread::sleep(Duration::from_millis(50));
        growing().is_some()
    });
    assert!(began, "it never began: {:?}", dir.files());
    let killed = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(dir.files(), ["o.wav"]);
    let (samples, _) = dir.wav("o.wav");
    assert!(samples.len() > 10_000 && samples.len().is_multiple_of(96), "{}", samples.len());
}

#[test]
fn integer_wav_formats_hold_the_same_signal() {
    let dir = Room::new();
    for format in ["f32", "i24", "i16"] {
        render(&dir, &format!("--seconds 1 --out {format}.wav --format {format}")).ok();
    }
    let (float, _) = dir.wav("f32.wav");
    for (name, full) in [("i24.wav", 8_388_607.0), ("i16.wav", 32_767.0)] {
        let mut reader = hound::WavReader::open(dir.join(name)).unwrap();
        let ints: Vec<i32> = reader.samples::<i32>().map(Result::unwrap).collect();
        assert_eq!(ints.len(), float.len());
        let near = |(i, x): (&i32, &f32)| (f64::from(*i) - f64::from(*x) * full).abs() <= 0.6;
        assert!(ints.iter().zip(&float).all(near), "{name}");
    }
}
