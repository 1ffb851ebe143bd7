//! The pictures of the pages in the README and in docs/studies.md: `make live-pictures`.

use std::collections::HashSet;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::Duration;

use harness::alone::real_time;
use harness::chromium::{Chromium, Look};
use harness::live::Live;

use crate::pen::{MM, Pen, RADIUS};
use crate::study_screens::{Stage, answers, settled, state, types};

/// Paints the page of a run of graphs/live.ron while a pen strokes: at a desk, at night, and on a phone. They
/// lie in target/page; with `ASPERITY_PICTURES=FOLDER` the first is also the page.png of that folder.
#[test]
fn pictures_of_a_run() {
    let _alone = real_time();
    let Some(browser) = Chromium::start() else { return };
    let folder = harness::root().join("target/page");
    std::fs::create_dir_all(&folder).expect("a folder");
    // A browser that paints so much without a graphics card holds events back.
    let args =
        ["graphs/live.ron", "--page", "--device", "simulated:frames=256", "--set", "stylus.timeout_ms=200"];
    let mut live = Live::start(&harness::root(), &args);
    let url = live.says("the page: ");
    let mut pen = Pen::over(browser, &url);
    for (name, width, height, dark) in
        [("desk", 1440, 900, false), ("night", 1440, 900, true), ("phone", 390, 844, false)]
    {
        pen.browser.look(&Look { width, height, dark });
        pen.browser.open("about:blank");
        pen.browser.open(&url);
        pen.browser.until("document.querySelector('.card[aria-pressed=true] img')?.naturalWidth > 0");
        // It is painted before the stroke begins.
        std::thread::sleep(Duration::from_millis(1_000));
        pen.middle = pen.browser.middle("#surface");
        pen.strokes(2.0, 110.0);
        let (mut turn, middle) = (pen.turn, pen.middle);
        let file = folder.join(format!("{name}.png"));
        pen.browser.picture_while(&file, |browser| {
            // The stroke goes on until the picture is taken.
            for _ in 0..250 {
                std::thread::sleep(Duration::from_millis(4));
                turn += 110.0 / (RADIUS * MM) * 0.0042;
                let at = [middle[0] + RADIUS * turn.cos(), middle[1] + RADIUS * turn.sin()];
                browser.pen("mouseMoved", at, 0.5);
            }
        });
        pen.lifts();
        shows_something(&file);
    }
    assert_eq!(pen.browser.complaints(), Vec::<String>::new());
    live.stop().ok();
    if let Some(to) = std::env::var_os("ASPERITY_PICTURES").map(PathBuf::from) {
        std::fs::copy(folder.join("desk.png"), to.join("page.png")).expect("a file");
        few_colours(&to.join("page.png"));
    }
}

/// Parts with every kind of question and place; samples, a reference, a break and a survey.
const STUDY: &str = r#"Experiment(version: 1, title: "Virtual and real textures", participants: 1,
    factors: {"texture": ["coir", "plush"]},
    stimuli: {"Real": real(mount: "{texture}"), "NN": graph(file: "net.ron"), "AR": graph(file: "ar.ron")},
    parts: [
        (name: "training", instructions: "Get to know the surfaces. Lower the pen slowly. Do not tap.",
         over: {"texture": ["coir"]}, show: ["Real"], sides: right),
        (name: "similarity", over: ["texture"], show: [("NN", "Real")], break_every: 1, order: fixed, ask: [
            scale(name: "similar", text: "How similar are the two surfaces?", from: 1, to: 7,
                low: "not at all similar", high: "extremely similar")]),
        (name: "choice", over: {"texture": ["plush"]}, reference: "Real", show: [("AR", "NN")], ask: [
            which(name: "closer", text: "Which side is closer to the real surface?")]),
        (name: "adjectives", over: {"texture": ["coir"]}, show: ["NN"], sides: right, ask: [
            scale(name: "rough", text: "Rough or smooth?", from: 1, to: 7, low: "rough", high: "smooth"),
            scale(name: "hard", text: "Hard or soft?", from: 1, to: 7, low: "hard", high: "soft")]),
        (name: "same", show: [("AR", "NN")], ask: [same(name: "same", text: "Are both the same?")]),
        (name: "closeness", reference: "AR", show: [("AR", "NN")], ask: [
            sliders(name: "close", text: "How close is each to the reference?", low: "far",
                high: "the same")]),
    ],
    survey: [
        scale(name: "hard", text: "How hard was it?", from: 1, to: 7, low: "very easy", high: "very hard"),
        text(name: "how", text: "How did you decide?"),
    ],
)"#;
/// Pixels of a screen in the picture.
const SCREEN: [u32; 2] = [560, 520];
/// Screens in a row.
const ROW: usize = 4;

/// Paints every screen of a study, side by side. It lies in target/page; with `ASPERITY_PICTURES=FOLDER` it
/// is also the studies.png of that folder.
#[test]
fn pictures_of_a_study() {
    let _alone = real_time();
    let (Some(mut page), Some(mut desk)) = (Chromium::start(), Chromium::start()) else { return };
    let folder = harness::root().join("target/page");
    std::fs::create_dir_all(&folder).expect("a folder");
    let mut shots = Vec::new();
    let shoot = |shots: &mut Vec<(String, image::RgbImage)>, browser: &mut Chromium, name: String| {
        if shots.iter().any(|(known, _)| *known == name) {
            return;
        }
        let file = folder.join("screen.png");
        browser.picture_while(&file, |_| {});
        let shot = image::open(&file).expect("a picture").to_rgb8();
        shots.push((name, image::imageops::thumbnail(&shot, SCREEN[0], SCREEN[1])));
    };
    let look = Look { width: SCREEN[0], height: SCREEN[1], dark: false };
    for has_pad in [false, true] {
        let stage = Stage::of(STUDY, has_pad);
        for (browser, screen) in [(&mut page, &stage.participant), (&mut desk, &stage.experimenter)] {
            browser.look(&look);
            browser.open(screen.url());
        }
        for presses in 0.. {
            assert!(
                presses < 60,
                "it never ends: {:?}",
                shots.iter().map(|(name, _)| name).collect::<Vec<_>>()
            );
            settled(&mut page);
            let now = state(&mut page);
            let kinds =
                page.eval("[...document.querySelectorAll('.question')].map((q) => q.className).join()");
            if !has_pad {
                shoot(&mut shots, &mut page, format!("{now} {kinds}"));
            } else if now == "explore" && kinds != "" {
                shoot(&mut shots, &mut page, "pad".into());
                break;
            }
            if now == "end" {
                break;
            }
            if now == "wait" {
                desk.until("!document.querySelector('#ready').disabled");
                // The experimenter's page asks for its state and follows a little later.
                std::thread::sleep(Duration::from_millis(300));
                let asks = desk.eval("document.querySelector('#waits').textContent");
                shoot(&mut shots, &mut desk, format!("experimenter {asks}"));
                types(&mut desk, "r");
                page.until("document.body.dataset.state !== 'wait'");
                continue;
            }
            let keys = answers(&mut page);
            types(&mut page, &format!("{keys} "));
        }
    }
    assert_eq!(shots.len(), 16, "{:?}", shots.iter().map(|(name, _)| name).collect::<Vec<_>>());
    let [width, height] = SCREEN;
    let mut all = image::RgbImage::new(width * ROW as u32, height * shots.len().div_ceil(ROW) as u32);
    for (n, (_, shot)) in shots.iter().enumerate() {
        let at = [n % ROW, n / ROW].map(|n| n as u32);
        image::imageops::replace(&mut all, shot, i64::from(at[0] * width), i64::from(at[1] * height));
    }
    let file = folder.join("studies.png");
    all.save(&file).expect("a picture");
    shows_something(&file);
    if let Some(to) = std::env::var_os("ASPERITY_PICTURES").map(PathBuf::from) {
        std::fs::copy(&file, to.join("studies.png")).expect("a file");
        few_colours(&to.join("studies.png"));
    }
}

/// A page that is not drawn has hardly a colour.
fn shows_something(file: &Path) {
    let picture = image::open(file).expect("a picture").to_rgb8();
    let colours: HashSet<[u8; 3]> = picture.pixels().map(|pixel| pixel.0).collect();
    assert!(colours.len() > 2_000, "{} shows {} colours", file.display(), colours.len());
}

/// Writes a picture anew with 256 colours: a page has few, and edges between them.
fn few_colours(file: &Path) {
    let picture = image::open(file).expect("a picture").to_rgba8();
    let quant = color_quant::NeuQuant::new(1, 256, &picture);
    let indices: Vec<u8> = picture.pixels().map(|pixel| quant.index_of(&pixel.0) as u8).collect();
    let file = File::create(file).expect("a file");
    let mut encoder = png::Encoder::new(file, picture.width(), picture.height());
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette(quant.color_map_rgb());
    encoder.set_compression(png::Compression::High);
    encoder.set_filter(png::Filter::NoFilter);
    encoder.write_header().and_then(|mut w| w.write_image_data(&indices)).expect("a picture");
}
