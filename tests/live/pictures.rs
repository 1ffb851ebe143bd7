//! The picture of the page in the README: `make live-pictures`.

use std::collections::HashSet;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::Duration;

use harness::alone::real_time;
use harness::chromium::{Chromium, Look};
use harness::live::Live;

use crate::pen::{MM, Pen, RADIUS};

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
