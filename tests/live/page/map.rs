//! A scene on the page: its map, what is felt, and its strokes saved and rendered again.

use std::path::Path;
use std::time::{Duration, Instant};

use base64::Engine as _;
use harness::Room;
use harness::chromium::Chromium;
use harness::live::{CARD, Live};
use serde_json::json;

use super::{Kept, with_browser};
use crate::pen::MM;

/// A low table and a block on it whose top is 30 mm up.
const SCENE: &str = r#"Scene(
    version: 1,
    input: stroke(extent_mm: 60, speed_mm_s: 120, duration_s: 600),
    device: (damping_ns_per_m: 2),
    gain: 0.5,
    actuator: (profile: "hapcoil_one", handle_mass_g: 100),
    output: audio_out(volts_at_full_scale: 1, amps_per_volt: 1),
    surfaces: {
        "table": (shape: rectangle(size_mm: (60, 60)), place_mm: (-30, 0, 0), material: "canvas", effects: (
            stiffness: (stiffness_n_per_mm: 0.5), texture: WAVE)),
        "block": (shape: box(size_mm: (60, 60, 20)), place_mm: (30, 0, 20), effects: (
            stiffness: (stiffness_n_per_mm: 0.5), damping: (damping_ns_per_m: 0.5),
            friction: viscous_coulomb(coefficient: 0.3), texture: WAVE)),
    },
)
"#;
const WAVE: &str =
    "waveform(segments: [(0, 0), (0.5, 4), (1, 0), (1.5, -4), (2, 0)], reference_speed_mm_s: 80)";

const PLAYING: &str = "document.querySelector('#condition').dataset.is === 'playing'";

fn run(room: &Room, scene: &str) -> (Live, String) {
    room.write("s.ron", scene.replace("WAVE", WAVE));
    let args = ["s.ron", "--hand", "pointer", "--page", "--device", CARD, "--set", "stylus.timeout_ms=2000"];
    let mut live = Live::start(room, &args);
    let url = live.says("the page: ");
    (live, url)
}

/// A pen with tilt at so many mm from the middle of the surface. Waits for nothing.
fn pen(browser: &mut Chromium, event: &str, middle: [f64; 2], [x, y]: [f64; 2], tilt: [i32; 2]) {
    browser.send(
        "Input.dispatchMouseEvent",
        json!({
            "type": event, "x": middle[0] + x / MM, "y": middle[1] - y / MM, "pointerType": "pen",
            "force": if event == "mouseReleased" { 0.0 } else { 0.5 }, "tiltX": tilt[0], "tiltY": tilt[1],
            "button": "left", "buttons": u8::from(event != "mouseReleased"), "clickCount": 1,
        }),
    );
}

/// Strokes to and fro about a place for a while, and lifts.
fn strokes(browser: &mut Chromium, middle: [f64; 2], at: [f64; 2], tilt: [i32; 2], seconds: f64) {
    let began = Instant::now();
    pen(browser, "mousePressed", middle, at, tilt);
    while began.elapsed().as_secs_f64() < seconds {
        std::thread::sleep(Duration::from_millis(8));
        let x = at[0] + 10.0 * (8.0 * began.elapsed().as_secs_f64()).sin();
        pen(browser, "mouseMoved", middle, [x, at[1]], tilt);
    }
    pen(browser, "mouseReleased", middle, at, tilt);
}

fn shows(browser: &mut Chromium, selector: &str, text: &str) {
    browser.until(&format!(
        "document.querySelector({})?.textContent.includes({})",
        json!(selector),
        json!(text)
    ));
}

/// Presses a button of the strokes.
fn presses(browser: &mut Chromium, button: &str) {
    let all = "[...document.querySelectorAll('#strokes button')]";
    browser.eval(&format!("{all}.find((one) => one.textContent === '{button}').click()"));
}

/// Opens the page and waits for its map.
fn opened(kept: &mut Kept, url: &str, dark: bool) -> (Chromium, [f64; 2]) {
    let mut browser = kept.0.take().expect("it was given back");
    browser.look(&harness::chromium::Look { width: 1200, height: 900, dark });
    browser.open(url);
    browser.until(PLAYING);
    browser.until("document.querySelector('#map .surfaces button') !== null");
    let middle = browser.middle("#surface");
    (browser, middle)
}

#[test]
fn map_names_the_surface_that_is_touched_at_any_height() {
    with_browser(|kept| {
        let room = Room::new();
        let (live, url) = run(&room, SCENE);
        let (mut browser, middle) = opened(kept, &url, false);
        shows(&mut browser, "#map .surfaces", "tablecanvasstiffness, waveform");
        shows(&mut browser, "#map .surfaces", "blockno materialstiffness, damping, friction, waveform");
        shows(&mut browser, ".felt .touches dd", "nothing");
        let force = "parseFloat(document.querySelector('.felt .force dd').textContent)";
        for (name, x) in [("table (canvas)", -30.0), ("block", 30.0)] {
            pen(&mut browser, "mousePressed", middle, [x, 5.0], [0, 0]);
            shows(&mut browser, ".felt .touches dd", name);
            // Half of 6.6 mm into 0.5 N/mm, whatever the height of the surface.
            browser.until(&format!("Math.abs({force} - 1.65) < 0.1"));
            shows(&mut browser, ".felt .active dd", "stiffness");
            shows(&mut browser, "#map .surfaces .touched b", name.split(' ').next().expect("a word"));
            pen(&mut browser, "mouseReleased", middle, [x, 5.0], [0, 0]);
            shows(&mut browser, ".felt .touches dd", "nothing");
        }
        // What is pressed in the list comes to the middle.
        browser.click("#map .surfaces button:nth-child(1)");
        let middle = browser.middle("#surface");
        pen(&mut browser, "mousePressed", middle, [0.0, 0.0], [0, 0]);
        shows(&mut browser, ".felt .touches dd", "table");
        pen(&mut browser, "mouseReleased", middle, [0.0, 0.0], [0, 0]);
        assert_eq!(browser.complaints(), Vec::<String>::new());
        browser.open("about:blank");
        kept.0 = Some(browser);
        live.stop().ok();
        Ok(())
    });
}

#[test]
fn scene_of_10000_surfaces_is_drawn_in_part_and_says_so() {
    with_browser(|kept| {
        let room = Room::new();
        let tile = |i: i32| {
            let [x, y] = [10 * (i % 100) - 500, 10 * (i / 100) - 500];
            let shape = format!("shape: rectangle(size_mm: (10, 10)), place_mm: ({x}, {y}, 0)");
            // One texture is enough for the scene to have an output.
            let texture = if i == 0 { ", texture: WAVE" } else { "" };
            format!("\"t{i}\": ({shape}, effects: (stiffness: (stiffness_n_per_mm: 0.5){texture})),\n")
        };
        let (before, _) = SCENE.split_once("surfaces: {").expect("surfaces");
        let tiles: String = (0..10_000).map(tile).collect();
        let (live, url) = run(&room, &format!("{before}surfaces: {{\n{tiles}}},\n)"));
        let (mut browser, middle) = opened(kept, &url, false);
        shows(&mut browser, "#map .head", "400 of 10\u{2009}000 surfaces are drawn");
        let listed = browser.eval("document.querySelectorAll('#map .surfaces button').length");
        assert_eq!(listed, 60);
        shows(&mut browser, "#map", "more are not listed");
        // A surface under the pen is always among them.
        browser.click("#map .ways button:nth-child(2)");
        pen(&mut browser, "mousePressed", middle, [0.0, 0.0], [0, 0]);
        shows(&mut browser, ".felt .touches dd", "t");
        assert_eq!(browser.complaints(), Vec::<String>::new());
        browser.open("about:blank");
        kept.0 = Some(browser);
        live.stop().ok();
        Ok(())
    });
}

/// Waits for a file that is downloaded.
fn downloaded(file: &Path) -> Vec<u8> {
    harness::live::until("a download", || std::fs::metadata(file).is_ok_and(|meta| meta.len() > 0));
    std::fs::read(file).expect("a file")
}

#[test]
fn stroke_of_the_page_is_saved_and_rendered_as_by_the_command() {
    with_browser(|kept| {
        let room = Room::new();
        let (live, url) = run(&room, SCENE);
        let (mut browser, middle) = opened(kept, &url, true);
        let folder = json!({ "behavior": "allow", "downloadPath": room.display().to_string() });
        browser.call("Page.setDownloadBehavior", folder);
        shows(&mut browser, "#strokes", "Your last strokes stand here");
        strokes(&mut browser, middle, [-30.0, 0.0], [0, 0], 1.0);
        shows(&mut browser, "#strokes select", "Stroke 1");
        // Present values count, not those of the file.
        let slider = "document.querySelector('[data-param=\"strength.gain\"]')";
        browser.eval(&format!(
            "(() => {{ const s = {slider}; s.value = 800; \
             s.dispatchEvent(new Event('input', {{ bubbles: true }})); }})()"
        ));
        std::thread::sleep(Duration::from_millis(300));
        let gain = browser.eval(&format!("{slider}.parentElement.querySelector('.figure input').value"));
        presses(&mut browser, "Save stroke");
        let csv = String::from_utf8(downloaded(&room.join("stroke1.csv"))).expect("text");
        let mut lines = csv.lines();
        assert_eq!(lines.next(), Some("t_s,x_mm,y_mm,z_mm,force_n"));
        let rows: Vec<Vec<f64>> =
            lines.map(|line| line.split(',').map(|x| x.parse().expect("a number")).collect()).collect();
        assert!(rows.len() > 40 && rows[0][0] == 0.0, "{} rows", rows.len());
        assert!(
            rows[..rows.len() - 1]
                .iter()
                .all(|row| (row[3] + 3.3).abs() < 0.1 && (row[4] - 1.65).abs() < 0.1)
        );
        presses(&mut browser, "Render again");
        browser.until("document.querySelector('#strokes audio') !== null");
        shows(&mut browser, "#strokes .result", "peak");
        let wav = browser.eval(
            "(async () => { const r = await fetch(document.querySelector('#strokes audio').src); \
             const b = new Uint8Array(await r.arrayBuffer()); let s = ''; \
             for (let i = 0; i < b.length; i += 8192) s += String.fromCharCode(...b.subarray(i, i + 8192)); \
             return btoa(s); })()",
        );
        browser.until("document.querySelector('#strokes audio').readyState >= 1");
        let wav =
            base64::engine::general_purpose::STANDARD.decode(wav.as_str().expect("text")).expect("base64");
        let line = format!(
            "render s.ron --input stroke1.csv --set strength.gain={} --out cli.wav",
            gain.as_str().expect("a number")
        );
        room.run(&line).ok();
        assert!(wav == room.bytes("cli.wav"), "the page's render is not the command's");
        let (samples, _) = room.wav("cli.wav");
        assert!(samples.iter().any(|x| x.abs() > 1e-4), "it is silent");

        // Played again, it is felt again, and is no stroke of its own.
        presses(&mut browser, "Play again");
        shows(&mut browser, ".felt .touches dd", "table");
        shows(&mut browser, ".felt .touches dd", "nothing");
        assert_eq!(browser.eval("document.querySelectorAll('#strokes option').length"), 1);

        // A pen that leans says so, on the page and in the file.
        pen(&mut browser, "mousePressed", middle, [-30.0, 0.0], [30, -20]);
        shows(&mut browser, "#where", "tilt 30°, 20°");
        strokes(&mut browser, middle, [-30.0, 0.0], [30, -20], 0.4);
        shows(&mut browser, "#strokes select", "Stroke 2");
        presses(&mut browser, "Save stroke");
        let csv = String::from_utf8(downloaded(&room.join("stroke2.csv"))).expect("text");
        assert!(csv.starts_with("t_s,x_mm,y_mm,z_mm,force_n,tilt_x_deg,tilt_y_deg\n"), "{csv:.99}");
        assert!(csv.lines().nth(3).is_some_and(|line| line.ends_with(",30,20")), "{csv:.200}");

        // A graph that has changed on the disk is not the one that runs.
        room.write("s.ron", SCENE.replace("WAVE", WAVE).replace("gain: 0.5", "gain: 0.25"));
        presses(&mut browser, "Render again");
        shows(&mut browser, "#strokes", "has changed since it was read");
        browser.complaints();
        browser.open("about:blank");
        kept.0 = Some(browser);
        live.stop().ok();
        Ok(())
    });
}
