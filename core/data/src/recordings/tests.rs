//! Recordings with known magnitudes and histories.

use std::f64::consts::TAU;

use asperity_diagnostics::Source;

use super::*;
use crate::example::Example;
use crate::folder::write_picture as picture;

/// A table with a column for each name, from a function of time.
fn table(names: &str, rate_hz: f64, duration_s: f64, row: impl Fn(f64) -> Vec<f64>) -> String {
    let mut text = format!("# invented\n{names}\n");
    for i in 0..(rate_hz * duration_s).round() as usize {
        let t = i as f64 / rate_hz;
        let cells: Vec<String> = row(t).iter().map(f64::to_string).collect();
        text.push_str(&format!("{t:.4}, {}\n", cells.join(", ")));
    }
    text
}

fn examples(text: &str) -> Vec<Example> {
    let stroke = parse(&Source::new("s.csv", text), &ColumnMap::default()).unwrap_or_else(|e| panic!("{e}"));
    stroke.examples().unwrap().into_iter().map(|t| t.example).collect()
}

fn tone(amplitude: f64, hz: f64, t: f64) -> f64 {
    amplitude * (TAU * hz * t).sin()
}

#[test]
fn three_axes_with_gravity_are_one_amplitude() {
    for rate_hz in [1000.0, 1024.0, 2000.0, 2500.0, 4096.0, 10_000.0] {
        let text = table("t_s,force_n,vx_mm_s,vy_mm_s,ax_m_s2,ay_m_s2,az_m_s2", rate_hz, 1.0, |t| {
            vec![2.0, 30.0, -40.0, tone(3.0, 120.0, t), tone(4.0, 120.0, t + 0.1), 9.81]
        });
        let found = examples(&text);
        // From 0.08 s on, every 20 ms, while 0.1 s follow.
        assert_eq!(found.len(), 42);
        for e in &found {
            assert!((e.magnitudes[11] - 5.0).abs() < 0.02, "{}", e.magnitudes[11]);
            assert!((e.magnitudes[10] - 2.5).abs() < 0.02 && (e.magnitudes[12] - 2.5).abs() < 0.02);
            assert!(e.magnitudes[0] < 0.05 && e.magnitudes[30] < 0.01, "{}", e.magnitudes[0]);
            assert_eq!(e.force, [2.0; 10]);
            assert!(e.velocity[..10].iter().all(|v| (v - 30.0).abs() < 0.2), "{:?}", e.velocity);
            assert!(e.velocity[10..].iter().all(|v| (v + 40.0).abs() < 0.2));
            let above = if rate_hz < 2000.0 { (rate_hz / 20.0) as usize } else { 100 };
            assert!(e.magnitudes[above..].iter().all(|m| *m == 0.0));
        }
    }
}

#[test]
fn gravity_filter_keeps_ten_hertz_nearly_whole() {
    let text = table("time_s,force_n,speed_mm_s,acceleration_m_s2", 1000.0, 2.0, |t| {
        vec![1.0, 50.0, tone(1.0, 10.0, t) + 9.81 * (TAU * 0.2 * t).cos()]
    });
    let want = 4.0 / 17f32.sqrt();
    for e in &examples(&text)[20..] {
        assert!((e.magnitudes[0] - want).abs() < 0.05, "{}", e.magnitudes[0]);
    }
}

#[test]
fn places_velocities_and_speeds_tell_one_motion() {
    let swing = |t: f64| 100.0 * (TAU * 2.0 * t).sin();
    let place = |t: f64| -100.0 / (TAU * 2.0) * (TAU * 2.0 * t).cos();
    let of = |names: &str, row: &dyn Fn(f64) -> Vec<f64>| {
        examples(&table(&format!("t_s,force_n,acceleration_m_s2,{names}"), 1000.0, 1.5, |t| {
            [vec![1.0, 0.0], row(t)].concat()
        }))
    };
    let velocity = of("vx_mm_s,vy_mm_s", &|t| vec![0.6 * swing(t), 0.8 * swing(t)]);
    let places = of("y_mm,x_mm", &|t| vec![0.8 * place(t), 0.6 * place(t)]);
    let both = of("y_mm,x_mm,vx_mm_s,vy_mm_s", &|t| vec![0.0, 0.0, 0.6 * swing(t), 0.8 * swing(t)]);
    let speeds = of("speed_mm_s", &|t| vec![swing(t).abs()]);
    assert_eq!(velocity, both);
    // Also at a rate without a whole number of samples in a tick.
    let odd = examples(&table("t_s,force_n,acceleration_m_s2,x_mm,y_mm", 1024.0, 1.5, |t| {
        vec![1.0, 0.0, 100.0 * t, 0.0]
    }));
    assert!(odd.iter().skip(10).all(|e| e.velocity[..10].iter().all(|v| (v - 100.0).abs() < 0.7)), "{odd:?}");
    let mut directions = Vec::new();
    for ((v, p), s) in velocity.iter().zip(&places).zip(&speeds) {
        assert!(v.velocity.iter().zip(&p.velocity).all(|(a, b)| (a - b).abs() < 1.0), "{v:?} {p:?}");
        assert!((0..10).all(|i| (v.velocity[10 + i] / v.velocity[i] - 0.8 / 0.6).abs() < 1e-3));
        assert!((0..10).all(|i| s.velocity[i].hypot(s.velocity[10 + i]) <= 101.0));
        directions.push(s.velocity[19].atan2(s.velocity[9]));
    }
    assert!(directions.windows(2).all(|d| (d[0] - d[1]).abs() > 0.5), "{directions:?}");
}

#[test]
fn one_stroke_is_read_as_recorded_with_speed_of_its_motion() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.csv");
    // A circle of 30 mm at 1.5 turns a second: 283 mm/s all the way.
    let (radius, w) = (30.0, TAU * 1.5);
    let read = |names: &str, row: &dyn Fn(f64) -> Vec<f64>| {
        let row = |t| [vec![2.0 + t], row(t)].concat();
        std::fs::write(&path, table(&format!("t_s,force_n,{names}"), 1000.0, 1.0, row)).unwrap();
        recorded(&path, &ColumnMap::default()).unwrap()
    };
    // Noise of velocities, here 200 mm/s up and down, is no speed.
    let rattle = |t: f64| if (t * 1000.0).round() as i64 % 2 == 0 { 200.0 } else { -200.0 };
    let places = read("x_mm,y_mm,az_m_s2", &|t| vec![radius * (w * t).cos(), radius * (w * t).sin(), 9.81]);
    let velocities = read("vx_mm_s,vy_mm_s,acceleration_m_s2", &|t| {
        vec![-radius * w * (w * t).sin() + rattle(t), radius * w * (w * t).cos(), t]
    });
    for found in [&places, &velocities] {
        let off = found.speed_mm_s.iter().map(|v| (v - radius * w).abs()).fold(0.0, f64::max);
        assert!(found.speed_mm_s.len() == 1000 && off < 1.5, "{off}");
    }
    let speeds = read("speed_mm_s,ax_m_s2,az_m_s2", &|t| vec![100.0 * t, t, -t]);
    assert_eq!((speeds.rate_hz, speeds.speed_mm_s[700], speeds.force_n[500]), (1000.0, 70.0, 2.5));
    assert_eq!(speeds.acceleration_m_s2.len(), 2);
    assert_eq!([speeds.acceleration_m_s2[0][250], speeds.acceleration_m_s2[1][250]], [0.25, -0.25]);
    assert_eq!(velocities.acceleration_m_s2[0][999], 0.999);
    assert!(
        recorded(&folder.path().join("none.csv"), &ColumnMap::default())
            .unwrap_err()
            .to_string()
            .contains("none.csv")
    );
    let wav_path = folder.path().join("s.wav");
    std::fs::write(folder.path().join(CHANNELS_FILE), NAMES).unwrap();
    wav(&wav_path, (hound::SampleFormat::Float, 32), 2000, 1.0);
    let found = recorded(&wav_path, &ColumnMap::default()).unwrap();
    assert!(found.rate_hz == 2000.0 && (found.speed_mm_s[77] - 100.0).abs() < 1e-3);
    assert_eq!(channels_file(&wav_path), folder.path().join("recording.ron"));
}

#[test]
fn headerless_columns_take_the_callers_names() {
    let column = |x: f64| vec![x; 1000];
    let named = [("force_n", 2.0), ("none", f64::NAN), ("speed_mm_s", 30.0), ("ax_m_s2", 0.5)];
    let columns = || named.map(|(name, x)| (name, column(x))).to_vec();
    let found = Recorded::from_columns(1000.0, columns()).unwrap();
    assert_eq!((found.force_n, found.speed_mm_s), (column(2.0), column(30.0)));
    assert_eq!((found.rate_hz, found.acceleration_m_s2), (1000.0, vec![column(0.5)]));
    type Columns = Vec<(&'static str, Vec<f64>)>;
    let error = |rate_hz: f64, change: fn(&mut Columns)| {
        let mut columns = columns();
        change(&mut columns);
        Recorded::from_columns(rate_hz, columns).unwrap_err().to_string()
    };
    for (found, want) in [
        (error(1e3, |c| c[0].0 = "force"), "unknown column `force` (did you mean `force_n`?)"),
        (error(1e3, |c| c[0].0 = "t_s"), "unknown column `t_s`"),
        (error(1e3, |c| c[1] = c[0].clone()), "the column `force_n` is there twice"),
        (error(1e3, |c| drop(c.remove(0))), "no force (`force_n`)"),
        (error(1e3, |c| c[2].1[7] = -1.0), "`speed_mm_s` is -1 in row 7, at 0.007 s"),
        (error(1e3, |c| c[3].1[0] = f64::NAN), "`ax_m_s2` is NaN in row 0"),
        (error(1e3, |c| c[3].1.truncate(99)), "columns of 1000 and of 99 samples"),
        (error(500.0, |_| ()), "a rate of 500.0 Hz"),
        (error(f64::NAN, |_| ()), "a rate of NaN Hz"),
        (error(1e3, |c| c.iter_mut().for_each(|c| c.1.truncate(400))), "a stroke of 0.400 s"),
        (error(1e3, |c| c.clear()), "no force"),
    ] {
        assert!(found.starts_with(want), "{found}\nwanted {want}");
    }
}

fn write(folder: &Path, name: &str, text: &str) {
    std::fs::create_dir_all(folder).unwrap();
    std::fs::write(folder.join(name), text).unwrap();
}

#[test]
fn no_sample_is_in_both_training_and_test() {
    let folder = tempfile::tempdir().unwrap();
    let cork = folder.path().join("cork");
    // The force is the time, so that a history tells its time.
    let text = table("t_s,force_n,speed_mm_s,acceleration_m_s2", 1000.0, 4.0, |t| vec![t, 50.0, 0.0]);
    write(&cork, "stroke.csv", &text);
    write(&cork, "notes.txt", "read by nobody");
    picture(&cork.join("a.PNG"), 90);
    let subjects = read(folder.path()).unwrap();
    let Parts { train, held } = &subjects[0].examples;
    assert_eq!((subjects[0].name.as_str(), subjects[0].truth), ("cork", Truth::Draws));
    assert!(train.len() > 140 && held.len() > 25, "{} {}", train.len(), held.len());
    let last = train.iter().map(|e| e.force[9]).fold(0.0, f32::max);
    let first = held.iter().map(|e| e.force[0]).fold(9.0, f32::min);
    assert!(last + 0.1 <= 3.2 + 1e-3 && first >= 3.2 - 1e-3, "{last} {first}");
}

#[test]
fn of_five_strokes_the_last_is_held_apart_whole() {
    let folder = tempfile::tempdir().unwrap();
    let cork = folder.path().join("cork");
    for n in 1..=5 {
        let text =
            table("t_s,force_n,speed_mm_s,acceleration_m_s2", 1000.0, 1.0, |_| vec![f64::from(n), 9.0, 0.0]);
        write(&cork, &format!("{n}.csv"), &text);
    }
    for n in 0..6 {
        picture(&cork.join(format!("{n}.png")), 10 * n);
    }
    let subject = &read(folder.path()).unwrap()[0];
    assert!(subject.examples.train.iter().all(|e| e.force[9] < 4.5));
    assert!(subject.examples.held.iter().all(|e| e.force[9] == 5.0));
    assert_eq!((subject.examples.train.len(), subject.examples.held.len()), (4 * 42, 42));
    assert_eq!((subject.images.train.len(), subject.images.held.len()), (5, 1));
}

#[test]
fn bad_tables_are_refused_at_the_cell() {
    let h = "t_s,force_n,speed_mm_s,acceleration_m_s2";
    let good = table(h, 1000.0, 1.0, |_| vec![1.0, 2.0, 3.0]);
    let error = |text: &str| {
        parse(&Source::new("s.csv", text), &ColumnMap::default())
            .err()
            .map_or("none".into(), |e| e.to_string())
    };
    assert_eq!(error(&good), "none");
    let replaced = |what: &str, by: &str| {
        assert!(good.contains(what), "{what}");
        error(&good.replacen(what, by, 1))
    };
    let row = |by: &str| replaced("0.0100, 1, 2, 3", &format!("0.0100, {by}"));
    let slow = table(h, 500.0, 1.0, |_| vec![1.0, 2.0, 3.0]);
    let fast: String = (0..9000).map(|i| format!("{:.7}, 1, 2, 3\n", f64::from(i) / 10_100.0)).collect();
    let fast = format!("{h}\n{fast}");
    let short = table(h, 1000.0, 0.3, |_| vec![1.0, 2.0, 3.0]);
    for (found, want) in [
        (error("# nothing\n\n"), "s.csv:3:1: no header line"),
        (
            error("t_s,Fz,speed_mm_s,accel [g]\n"),
            "s.csv:1:28: no force (`force_n`; the file has `t_s`, `Fz`, `speed_mm_s`, `accel [g]`; name the \
             right ones, such as --map force_n=Fz:N)",
        ),
        (
            error("t_s,force_n,speed_mm_s,accel [g]\n"),
            "s.csv:1:33: no acceleration (`ax_m_s2`, `ay_m_s2`, `az_m_s2`, one at least, or \
             `acceleration_m_s2`; the file has `t_s`, `force_n`, `speed_mm_s`, `accel [g]`; name the right \
             ones, such as --map \"acceleration_m_s2=accel [g]:g\")",
        ),
        (error("t_s,force_n,force_n\n"), "s.csv:1:13: the column `force_n` is there twice"),
        (error("t_s,time_s\n"), "s.csv:1:5: the column `time_s` is there twice"),
        (error("force_n,speed_mm_s,ax_m_s2\n"), "s.csv:1:27: no clock"),
        (error("t_s,speed_mm_s,ax_m_s2\n"), "s.csv:1:23: no force"),
        (error("t_s,force_n,vx_mm_s,ax_m_s2\n"), "s.csv:1:28: no motion"),
        (error("t_s,force_n,speed_mm_s\n"), "s.csv:1:23: no acceleration"),
        (
            error("t_s,force_n,speed_mm_s,ax_m_s2,acceleration_m_s2\n"),
            "s.csv:1:49: the acceleration of one axis and of several",
        ),
        (error(&format!("{h}\n")), "s.csv:2:1: a stroke of no rows or one"),
        (row("1, , 3"), "s.csv:13:12: `speed_mm_s` is empty"),
        (row("x, 2, 3"), "s.csv:13:9: `force_n` is `x`, which is not a number"),
        (row("1, -2, 3"), "s.csv:13:12: `speed_mm_s` is `-2`, out of range"),
        (row("NaN, 2, 3"), "s.csv:13:9: `force_n` is `NaN`, which is not finite"),
        (row("inf, 2, 3"), "s.csv:13:9: `force_n` is `inf`, which is not finite"),
        (row("1, 2"), "s.csv:13:13: a row of 3 cells under a header of 4"),
        (row("1, 2, 3, 4"), "s.csv:13:18: a row of 5 cells under a header of 4"),
        (replaced("0.0100, ", "0.0050, "), "s.csv:13:1: the clock is not steady"),
        (replaced("0.0100, 1, 2, 3\n0.0110, 1, 2, 3\n", ""), "s.csv:13:1: the clock is not steady"),
        (error(&slow), "s.csv:502:1: a rate of 500.0 Hz"),
        (error(&fast), "s.csv:9001:1: a rate of 10100"),
        (error(&short), "s.csv:303:1: a stroke of 0.300 s"),
    ] {
        assert!(found.starts_with(want), "{found}\nwanted {want}");
    }
}

/// Writes a WAV file of force, something else, speed and acceleration, in parts of full scale.
fn wav(path: &Path, (format, bits): (hound::SampleFormat, u16), sample_rate: u32, seconds: f64) {
    let spec = hound::WavSpec { channels: 4, sample_rate, bits_per_sample: bits, sample_format: format };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    for i in 0..(f64::from(sample_rate) * seconds) as usize {
        for x in [0.25, -0.7, 0.5, tone(0.3, 120.0, i as f64 / f64::from(sample_rate))] {
            match format {
                hound::SampleFormat::Float => writer.write_sample(x as f32).unwrap(),
                hound::SampleFormat::Int => {
                    writer.write_sample((x * f64::from((1u32 << (bits - 1)) - 1)).round() as i32).unwrap()
                }
            }
        }
    }
    writer.finalize().unwrap();
}

const NAMES: &str = "Recording(channels: [\n(quantity: \"force_n\", full_scale: 20.0),\n\
    (quantity: \"none\"),\n\
    (quantity: \"speed_mm_s\", full_scale: 200.0),\n(quantity: \"acceleration_m_s2\", full_scale: 50.0)])";

#[test]
fn wav_of_every_width_and_rate_is_read_by_channel_name() {
    let folder = tempfile::tempdir().unwrap();
    let names = folder.path().join(CHANNELS_FILE);
    std::fs::write(&names, NAMES).unwrap();
    let path = folder.path().join("s.wav");
    use hound::SampleFormat::{Float, Int};
    for (format, rate) in
        [((Int, 16), 1000), ((Int, 24), 2000), ((Int, 32), 4096), ((Float, 32), 8192), ((Float, 32), 10_000)]
    {
        wav(&path, format, rate, 1.0);
        let found = read::wav(&path, &names).unwrap().examples().unwrap();
        assert_eq!(found.len(), 42);
        for timed in found {
            let e = timed.example;
            assert!((e.force[9] - 5.0).abs() < 1e-3, "{}", e.force[9]);
            assert!((e.velocity[9].hypot(e.velocity[19]) - 100.0).abs() < 0.5);
            assert!((e.magnitudes[11] - 15.0).abs() < 0.05, "{}", e.magnitudes[11]);
        }
    }
}

#[test]
fn bad_sound_files_and_bad_names_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (names, path) = (folder.path().join(CHANNELS_FILE), folder.path().join("s.wav"));
    let fails = |want: &str| {
        let found = read::wav(&path, &names).err().map_or("none".into(), |e| e.to_string());
        assert!(found.contains(want), "{found}\nwanted {want}");
    };
    wav(&path, (hound::SampleFormat::Int, 16), 2000, 1.0);
    fails("have no names");
    for (from, to, want) in [
        ("speed_mm_s", "sped_mm_s", "ron:4:12: unknown quantity `sped_mm_s` (did you mean `speed_mm_s`?)"),
        ("none", "force_n", "`force_n` is there twice"),
        ("force_n", "t_s", "unknown quantity `t_s`"),
        (", full_scale: 20.0", "", "recording.ron:2:1: the field `full_scale` is missing"),
        ("20.0", "-1.0", "out of range"),
        ("acceleration_m_s2", "none", "no acceleration"),
        ("(quantity: \"none\"),\n", "", "4 channels, and 3 are named"),
        ("20.0", "100000.0", "`force_n` is 25000"),
    ] {
        std::fs::write(&names, NAMES.replace(from, to)).unwrap();
        fails(want);
    }
    std::fs::write(&names, NAMES).unwrap();
    fails("none");
    wav(&path, (hound::SampleFormat::Int, 16), 2000, 0.2);
    fails("a stroke of 0.200 s");
    std::fs::write(&path, "RIFF, but no more").unwrap();
    fails("not a WAV file");
}

#[test]
fn folders_that_will_not_do_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let cork = folder.path().join("cork");
    let fails = |want: &str| {
        let found = read(folder.path()).unwrap_err().to_string();
        assert!(found.contains(want), "{found}");
    };
    fails("no materials in this folder");
    std::fs::create_dir(&cork).unwrap();
    fails("cork: no picture of this material");
    std::fs::write(cork.join("p.png"), "no picture").unwrap();
    fails("no stroke over this material");
    let text = table("t_s,force_n,speed_mm_s,ax_m_s2", 1000.0, 1.0, |_| vec![1.0, 2.0, 3.0]);
    write(&cork, "s.csv", &text);
    fails("p.png");
    write(&cork, "s.csv", "t_s\n");
    fails("s.csv:1:4: no force");
}

#[test]
fn recording_is_a_playable_stroke_with_its_acceleration() {
    use asperity_motion::{Trajectory, TrajectoryOptions};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.csv");
    let text = table("t_s,force_n,x_mm,y_mm,ax_m_s2,az_m_s2", 2000.0, 1.0, |t| {
        let (ax, az) = (tone(3.0, 120.0, t), 9.81 + tone(1.0, 300.0, t));
        vec![(2.0 * t - 0.5).max(-0.1), 80.0 * t, 5.0 - 30.0 * t, ax, az]
    });
    std::fs::write(&path, text).unwrap();
    let found = recording(&path, &ColumnMap::default()).unwrap();
    assert_eq!((found.position_mm.len(), found.felt.rate_hz, found.felt.axes().len()), (500, 2000.0, 2));
    for (tick, [x, y, z]) in found.position_mm.iter().enumerate() {
        let t = tick as f64 * 0.002;
        assert!((x - 80.0 * t).abs() < 1e-9 && (y - 5.0 + 30.0 * t).abs() < 1e-9, "{tick}");
        // Mean force of the last 2 ms over 0.5 N/mm; none where the sensor reads below 0.
        assert!((-z - 2.0 * (2.0 * t - 0.5).max(0.0)).abs() < 0.01 && *z <= 0.0, "{tick}: {z}");
    }
    let level = |axis: &[f64]| (axis[500..].iter().map(|a| a * a).sum::<f64>() / 1500.0).sqrt();
    let axes = found.felt.axes();
    assert!((level(axes[0]) - 3.0 * 0.5f64.sqrt()).abs() < 0.01, "{}", level(axes[0]));
    assert!((level(axes[1]) - 0.5f64.sqrt()).abs() < 0.01, "gravity is no vibration: {}", level(axes[1]));

    let played =
        Trajectory::parse(&Source::new("s.csv", found.csv()), &TrajectoryOptions::default()).unwrap();
    assert!((played.duration_s() - 0.998).abs() < 1e-9 && played.has_force());
    for tick in [0, 140, 499] {
        let (sample, place) = (played.sample(tick as f64 * 0.002), found.position_mm[tick]);
        assert!(sample.position.iter().zip(place).all(|(a, b)| (a - b).abs() < 1e-4), "{tick}");
        assert!((sample.force.unwrap() + 0.5 * place[2]).abs() < 1e-4, "{tick}");
    }

    let text = table("t_s,force_n,speed_mm_s,acceleration_m_s2", 1000.0, 1.0, |_| vec![1.0, 50.0, 0.0]);
    std::fs::write(&path, text).unwrap();
    let found = recording(&path, &ColumnMap::default()).unwrap();
    let last = found.position_mm[499];
    assert!((last[0] - 50.0).abs() < 0.2 && last[1] == 0.0 && last[2] == -2.0, "{last:?}");
    assert!(recording(&folder.path().join("none.csv"), &ColumnMap::default()).is_err());
}
