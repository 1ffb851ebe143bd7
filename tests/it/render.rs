//! `asperity render`: a stroke goes in, a file that an actuator could play comes out.

use std::f64::consts::TAU;
use std::time::Duration;

use harness::{Ran, asperity, files, graphs, json, run, wav};
use tempfile::TempDir;

fn shipped(name: &str) -> String {
    graphs(name).display().to_string()
}

fn heravi() -> String {
    shipped("heravi2024.ron")
}

/// Renders the shipped graph with these words.
fn render(dir: &TempDir, args: &str) -> Ran {
    let graph = heravi();
    run(dir.path(), &["render", &graph].into_iter().chain(args.split(' ')).collect::<Vec<_>>())
}

fn npy(dir: &TempDir, name: &str) -> Vec<f32> {
    asperity_accuracy::npy::read(dir.path().join(name)).unwrap().values.into_f32()
}

fn rms(x: &[f32]) -> f64 {
    (x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / x.len().max(1) as f64).sqrt()
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
    let dir = tempfile::tempdir().unwrap();
    let ran = render(&dir, "--out o.wav --plot p.svg --report r.json").ok();
    assert_eq!(files(dir.path()), ["o.wav", "p.svg", "r.json"]);
    for word in ["rendered", "x real time", "p50", "p99", "latency", "peak", "limiter", "faults", "wrote"] {
        assert!(ran.out.contains(word), "no {word} in {}", ran.out);
    }
    let report = json(&dir.path().join("r.json"));
    let ticks = report["ticks"].as_u64().unwrap();
    let (samples, rate) = wav(&dir.path().join("o.wav"));
    assert_eq!((rate, samples.len() as u64), (48_000, ticks * 96));
    assert!(ticks > 500 * 5, "the shipped stroke lasts some seconds");
    for key in ["p50", "p99", "p999", "max"] {
        assert!(report["tick_us"][key].as_f64().unwrap() > 0.0, "{key}");
    }
    assert!(report["realtime_factor"].as_f64().unwrap() > 1.0);
    assert!(report["latency_ms"].as_f64().unwrap() > 0.0);
    assert_eq!(report["faults"], 0);
    assert_eq!(report["seed"], 2024);
    assert!(report["asperity"].is_string() && report["dropped"].as_array().unwrap().is_empty());
    let nodes = report["nodes"].as_array().unwrap();
    assert_eq!(nodes.len(), 12);
    let network = nodes.iter().find(|n| n["kind"] == "texture_network").unwrap();
    assert!(network["facts"]["executor"].as_str().unwrap().contains("packed"), "{network}");
    assert!(network["facts"]["error_against_tract"]["value"].as_f64().unwrap() < 1e-4);
    assert!(network["calls"].as_u64().unwrap() < ticks, "it sleeps while the stylus is off the surface");
    for n in nodes {
        for key in ["id", "kind", "calls", "us_p50", "us_p99", "faults"] {
            assert!(!n[key].is_null(), "{key} of {n}");
        }
    }
    // What is written is what the amplifier gets: 1 A/V and 1 V at full scale, so samples are amperes.
    let peak = samples.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    assert!((report["output"]["peak"].as_f64().unwrap() - f64::from(peak)).abs() < 1e-6);
    assert!((report["output"]["rms"].as_f64().unwrap() - rms(&samples)).abs() < 1e-6);
    assert_eq!(report["output"]["unit"], "A");
    assert!(peak > 0.01, "a texture must be there: {peak}");
    assert!(rms(&samples) < 0.1478, "the coil's rating");
    let svg = std::fs::read_to_string(dir.path().join("p.svg")).unwrap();
    for panel in ["Position", "Speed", "Normal force", "Acceleration", "Coil current", "canvas"] {
        assert!(svg.contains(panel), "no {panel} in the plot");
    }
}

#[test]
fn a_second_run_gives_the_same_bytes_and_another_seed_others() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["a.wav", "b.wav"] {
        render(&dir, &format!("--out {name} --seconds 2")).ok();
    }
    render(&dir, "--out c.wav --seconds 2 --set seed=7").ok();
    let read = |n: &str| std::fs::read(dir.path().join(n)).unwrap();
    assert_eq!(read("a.wav"), read("b.wav"));
    assert_ne!(read("a.wav"), read("c.wav"));
}

#[test]
fn sleeping_changes_no_byte() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["heravi2024.ron", "heravi2024_scatter.ron", "texture.ron"] {
        let graph = shipped(name);
        run(dir.path(), &["render", &graph, "--out", "a.wav"]).ok();
        run(dir.path(), &["render", &graph, "--out", "b.wav", "--no-sleep", "--no-prune"]).ok();
        let read = |n: &str| std::fs::read(dir.path().join(n)).unwrap();
        assert!(read("a.wav") == read("b.wav"), "{name}");
    }
}

/// Magnitudes that are means sound as loud as root mean squares.
#[test]
fn scatter_of_strength_0_changes_no_byte_and_means_are_as_loud() {
    let dir = tempfile::tempdir().unwrap();
    let render = |graph: &str, sets: &[&str]| {
        let graph = shipped(graph);
        let mut args = vec!["render", &graph, "--out", "o.wav", "--seconds", "2"];
        args.extend(sets.iter().flat_map(|set| ["--set", set]));
        run(dir.path(), &args).ok();
        wav(&dir.path().join("o.wav")).0
    };
    let model = |name: &str| format!("texture.model={}", shipped(&format!("models/surfaces/{name}.onnx")));
    let (squares, means) = (model("texture"), model("texture_mean"));
    let without = render("heravi2024.ron", &[&squares]);
    assert_eq!(render("heravi2024_scatter.ron", &["scatter.strength=0"]), without);
    let scattered = render("heravi2024_scatter.ron", &[]);
    assert!(rms(&scattered) > 2.0 * rms(&without));
    let of_means = 20.0 * (rms(&render("heravi2024_scatter.ron", &[&means])) / rms(&scattered)).log10();
    assert!(of_means.abs() < 0.5, "{of_means} dB");
    // The recommended graph too: it had no wire that says which of them they are.
    let loud = |model: &str| rms(&render("texture.ron", &[model]));
    let of_means = 20.0 * (loud(&means) / loud(&squares)).log10();
    assert!(of_means.abs() < 0.6, "{of_means} dB");
}

#[test]
fn every_rate_gives_its_number_of_samples() {
    let dir = tempfile::tempdir().unwrap();
    for (tick_hz, audio_hz) in
        [(500, 44_100), (1000, 48_000), (4000, 96_000), (100, 48_000), (700, 8_000), (500, 22_050)]
    {
        let sets = format!("--set tick_hz={tick_hz} --set audio_hz={audio_hz}");
        render(&dir, &format!("--out o.wav --seconds 3 {sets}")).ok();
        let (samples, rate) = wav(&dir.path().join("o.wav"));
        assert_eq!((rate as usize, samples.len()), (audio_hz, 3 * audio_hz), "{sets}");
        assert!(rms(&samples) > 1e-3 && samples.iter().all(|x| x.is_finite()), "{sets}");
    }
}

#[test]
fn the_level_does_not_depend_on_tick_rate_or_synthesis() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("t.csv"), straight(100.0, 2.0, 0.2, 5.8, 6.0)).unwrap();
    let level = |sets: &str| {
        render(&dir, &format!("--input t.csv --probe gate.out=a.npy{sets}")).ok();
        let a = npy(&dir, "a.npy");
        let second = a.len() / 6;
        20.0 * rms(&a[2 * second..5 * second]).log10()
    };
    let reference = level("");
    for sets in [
        " --set tick_hz=1000",
        " --set tick_hz=250",
        " --set texture.synthesis_hz=0",
        " --set texture.synthesis_hz=0 --set audio_hz=44100",
        " --set audio_hz=44100",
        " --set tick_hz=700",
    ] {
        let other = level(sets);
        assert!((other - reference).abs() < 1.0, "{sets}: {other} dB, not {reference} dB");
    }
}

#[test]
fn there_is_silence_off_the_surface_and_at_rest() {
    let dir = tempfile::tempdir().unwrap();
    let level = |csv: String| {
        std::fs::write(dir.path().join("t.csv"), csv).unwrap();
        render(&dir, "--input t.csv --probe gate.out=a.npy --report r.json").ok();
        let a = npy(&dir, "a.npy");
        let report = json(&dir.path().join("r.json"));
        let nodes = report["nodes"].as_array().unwrap();
        let network = nodes.iter().find(|n| n["id"] == "texture").unwrap();
        (rms(&a), network["calls"].as_u64().unwrap())
    };
    let (touching, calls) = level(straight(100.0, 2.0, 0.5, 1.5, 2.0));
    assert!(touching > 0.1 && (500..700).contains(&calls), "{touching} {calls}");
    assert_eq!(level(straight(100.0, -1.0, 0.5, 1.5, 2.0)), (0.0, 0), "in the air");
    // Pressed and slower than the gate. Coming down takes no motion along the surface.
    assert_eq!(level(straight(3.0, 2.0, 0.5, 1.5, 2.0)), (0.0, 0), "at rest");
}

#[test]
fn the_gate_opens_and_closes_without_a_click() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("t.csv"), straight(120.0, 2.0, 0.5, 7.5, 8.0)).unwrap();
    render(&dir, "--input t.csv --out o.wav").ok();
    let (x, rate) = wav(&dir.path().join("o.wav"));
    let step = |from: f64, to: f64| {
        let part = &x[(from * f64::from(rate)) as usize..(to * f64::from(rate)) as usize];
        part.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max)
    };
    let steady = step(1.0, 7.4);
    assert!(steady > 0.0);
    let (start, end) = (step(0.0, 0.8), step(7.45, 8.0));
    // the touch itself may be a little more than the stroke that follows; a click would be many times that
    let most = 1.25 * steady;
    assert!(start <= most && end <= most, "{start} and {end}, steady {steady}");
}

#[test]
fn a_grating_is_felt_at_speed_over_wavelength() {
    // ridges across x; of finer ones the shipped network blurs the lines
    let (name, period_mm, speed) = ("sine grating 2.5 mm", 2.5, 100.0);
    let hz = |bin: usize| bin as f64 * 10.0;
    let expected = (speed / period_mm / 10.0) as usize;

    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("t.csv"), straight(speed, 2.0, 0.2, 7.8, 8.0)).unwrap();
    let material = format!("texture.material={name}");
    run(
        dir.path(),
        &["render", &heravi(), "--input", "t.csv", "--set", &material, "--probe", "synthesis=a.npy"],
    )
    .ok();
    let a = npy(&dir, "a.npy");
    let steady = &a[2500..7 * 2500];
    let power = |hz: f64| {
        // Mean power of Hann-windowed segments of 0.1 s at one frequency.
        let mut sum = 0.0;
        for part in steady.chunks_exact(250) {
            let (mut re, mut im) = (0.0, 0.0);
            for (i, x) in part.iter().enumerate() {
                let w = 0.5 - 0.5 * (TAU * i as f64 / 250.0).cos();
                let p = TAU * hz * i as f64 / 2500.0;
                re += w * f64::from(*x) * p.cos();
                im += w * f64::from(*x) * p.sin();
            }
            sum += re * re + im * im;
        }
        sum
    };
    let powers: Vec<f64> = (1..=100).map(|b| power(hz(b))).collect();
    let heard = 1 + (0..100).max_by(|a, b| powers[*a].total_cmp(&powers[*b])).unwrap();
    let (heard_hz, hz) = (hz(heard), hz(expected));
    assert!(heard.abs_diff(expected) <= 1, "{name}: loudest at {heard_hz} Hz, expected {hz} Hz");
}

#[test]
fn probes_record_every_kind_of_port() {
    let dir = tempfile::tempdir().unwrap();
    render(
        &dir,
        "--seconds 1 --probe stylus.position=p.csv --probe motion.speed=v.npy --probe texture=m.npy \
         --probe phase.spectrum=s.npy --probe limiter=i.csv",
    )
    .ok();
    let csv = std::fs::read_to_string(dir.path().join("p.csv")).unwrap();
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines[0], "t_s,0 [mm],1 [mm],2 [mm]");
    assert_eq!(lines.len(), 501);
    assert!(lines[250].starts_with("0.498,"), "{}", lines[250]);
    let shape = |n: &str| asperity_accuracy::npy::read(dir.path().join(n)).unwrap().shape;
    assert_eq!(shape("v.npy"), [500]);
    assert_eq!(shape("m.npy")[1], 101);
    assert_eq!(shape("s.npy")[1], 202);
    assert_eq!(std::fs::read_to_string(dir.path().join("i.csv")).unwrap().lines().count(), 48_001);
}

#[test]
fn a_recorded_force_and_speed_are_outputs_of_their_own() {
    let dir = tempfile::tempdir().unwrap();
    let mut csv = String::from("t_s,x_mm,y_mm,z_mm,force_n,speed_mm_s\n");
    for k in 0..=100 {
        let t = f64::from(k) * 0.01;
        csv.push_str(&format!("{t},{},0,-1,{},{}\n", 50.0 * t, 0.5 + t, 50.0));
    }
    std::fs::write(dir.path().join("t.csv"), csv).unwrap();
    let graph = r#"Graph(version: 1, nodes: {
        "t": (kind: "trajectory", params: (file: "t.csv", interpolation: linear)),
        "p": (kind: "probe", params: (file: "f.npy")), "q": (kind: "probe", params: (file: "v.npy"))},
        wires: [("t.force", "p"), ("t.speed", "q")])"#;
    std::fs::write(dir.path().join("g.ron"), graph).unwrap();
    run(dir.path(), &["render", "g.ron"]).ok();
    let (force, speed) = (npy(&dir, "f.npy"), npy(&dir, "v.npy"));
    assert_eq!(force.len(), 500);
    for (k, f) in force.iter().enumerate() {
        assert!((f64::from(*f) - (0.5 + k as f64 / 500.0)).abs() < 1e-6, "{k}");
    }
    assert!(speed.iter().all(|v| *v == 50.0));
}

#[test]
fn voltage_drive_goes_through_to_the_file() {
    let dir = tempfile::tempdir().unwrap();
    render(&dir, "--set inverse.drive=voltage --out o.wav --report r.json").ok();
    let report = json(&dir.path().join("r.json"));
    assert_eq!(report["output"]["unit"], "V");
    assert!(report["output"]["rms"].as_f64().unwrap() > 0.01);
}

#[test]
fn what_reaches_no_sink_is_dropped_and_named() {
    let dir = tempfile::tempdir().unwrap();
    let graph = harness::shipped_graph()
        .replace("\"phase\": (kind: \"spsi\"),", "\"phase\": (kind: \"spsi\"), \"idle\": (kind: \"gain\"),")
        .replace("(\"texture\", \"phase\"),", "(\"texture\", \"phase\"), (\"motion.speed\", \"idle\"),");
    std::fs::write(dir.path().join("g.ron"), graph).unwrap();
    run(dir.path(), &["render", "g.ron", "--seconds", "0.5", "--report", "r.json"]).ok();
    let report = json(&dir.path().join("r.json"));
    assert_eq!(report["dropped"][0]["id"], "idle");
    let ids: Vec<_> = report["nodes"].as_array().unwrap().iter().map(|n| n["id"].clone()).collect();
    assert!(!ids.contains(&"idle".into()), "{ids:?}");
    let ran = run(dir.path(), &["check", "g.ron"]).ok();
    assert!(ran.out.contains("idle (gain): nothing reads its outputs"), "{}", ran.out);
}

#[test]
fn a_model_that_tract_runs_says_that_it_allocates() {
    let dir = tempfile::tempdir().unwrap();
    let ran = render(&dir, "--seconds 1 --out t.wav --report r.json --set texture.executor=tract").ok();
    assert!(ran.err.contains("`texture` allocates in every tick"), "{}", ran.err);
    let report = json(&dir.path().join("r.json"));
    let network = report["nodes"].as_array().unwrap().iter().find(|n| n["id"] == "texture").unwrap().clone();
    assert_eq!(
        (&network["allocation_free"], &network["facts"]["executor"]),
        (&false.into(), &"tract".into())
    );
    // Both executors render the same signal, to the tolerance of the kernels.
    render(&dir, "--seconds 1 --out p.wav").ok();
    let (a, b) = (wav(&dir.path().join("t.wav")).0, wav(&dir.path().join("p.wav")).0);
    let diff: Vec<f32> = a.iter().zip(&b).map(|(x, y)| x - y).collect();
    assert!(rms(&diff) < 0.02 * rms(&a), "{} of {}", rms(&diff), rms(&a));
}

#[test]
fn two_things_may_not_be_written_to_one_file() {
    let dir = tempfile::tempdir().unwrap();
    for first in ["--out a.npy", "--probe motion.velocity=a.npy"] {
        render(&dir, &format!("{first} --probe motion.speed=a.npy")).refused("would write the same file as");
        assert!(files(dir.path()).is_empty());
    }
}

#[test]
fn an_old_file_stays_when_a_render_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("o.wav"), "precious").unwrap();
    let ran = render(&dir, "--out o.wav --set motion.cutoff_hz=-1");
    assert_eq!(ran.code, 2);
    assert_eq!(std::fs::read_to_string(dir.path().join("o.wav")).unwrap(), "precious");
}

#[cfg(unix)]
#[test]
fn ctrl_c_leaves_a_valid_wav() {
    let dir = tempfile::tempdir().unwrap();
    let mut child = asperity(dir.path())
        .args(["render", &heravi(), "--out", "o.wav", "--seconds", "20000"])
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    // Once the file is growing, it renders.
    let growing = || {
        let part = files(dir.path()).into_iter().find(|f| f.ends_with(".part"))?;
        std::fs::metadata(dir.path().join(part)).ok().filter(|m| m.len() > 100_000)
    };
    for _ in 0..600 {
        if growing().is_some() {
            break;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    assert!(growing().is_some(), "it never began: {:?}", files(dir.path()));
    let killed = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    let status = child.wait().unwrap();
    assert_eq!(status.code(), Some(130));
    assert_eq!(files(dir.path()), ["o.wav"]);
    let (samples, _) = wav(&dir.path().join("o.wav"));
    assert!(samples.len() > 10_000 && samples.len().is_multiple_of(96), "{}", samples.len());
}

#[test]
fn integer_wav_formats_hold_the_same_signal() {
    let dir = tempfile::tempdir().unwrap();
    for format in ["f32", "i24", "i16"] {
        render(&dir, &format!("--seconds 2 --out {format}.wav --format {format}")).ok();
    }
    let (float, _) = wav(&dir.path().join("f32.wav"));
    for (name, full) in [("i24.wav", 8_388_607.0), ("i16.wav", 32_767.0)] {
        let mut reader = hound::WavReader::open(dir.path().join(name)).unwrap();
        let ints: Vec<i32> = reader.samples::<i32>().map(Result::unwrap).collect();
        assert_eq!(ints.len(), float.len());
        assert!(
            ints.iter().zip(&float).all(|(i, x)| (f64::from(*i) - f64::from(*x) * full).abs() <= 0.6),
            "{name}"
        );
    }
}
