//! The picture of the page in the README: `make live-pictures`.

use std::fs::File;
use std::path::Path;
use std::time::Duration;

use harness::alone::real_time;
use harness::chromium::{Chromium, Look};
use harness::live::Live;

use crate::pen::{MM, Pen, RADIUS};

/// With `ASPERITY_PICTURES=FOLDER`: paints the page of a run of graphs/live.ron while a pen strokes. With
/// `ASPERITY_EVERY_SIZE` too: the page at other sizes.
#[test]
fn pictures_of_a_run() {
    let _alone = real_time();
    let Some(folder) = std::env::var_os("ASPERITY_PICTURES").map(std::path::PathBuf::from) else { return };
    let sizes =
        [("page", 1440, false), ("desk_dark", 1440, true), ("tablet", 900, false), ("phone", 390, false)];
    let many = if std::env::var_os("ASPERITY_EVERY_SIZE").is_some() { sizes.len() } else { 1 };
    for (name, width, dark) in &sizes[..many] {
        let Some((live, mut pen)) = painted(*width, *dark) else { return };
        pen.strokes(3.0, 110.0);
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
        live.stop().ok();
        few_colours(&file);
    }
}

/// A run, and a window on its whole page.
fn painted(width: u32, dark: bool) -> Option<(Live, Pen)> {
    let browser = Chromium::start()?;
    // A browser that paints so much without a graphics card holds events back.
    let args =
        ["graphs/live.ron", "--page", "--device", "simulated:frames=256", "--set", "stylus.timeout_ms=200"];
    let mut live = Live::start(&harness::root(), &args);
    let mut pen = Pen::over(browser, &live.says("the page: "));
    pen.browser.look(&Look { width, height: 800, dark });
    // It is laid out anew for the new width, and painted before the stroke begins.
    std::thread::sleep(Duration::from_millis(1_000));
    let height = pen.browser.eval("document.documentElement.scrollHeight").as_u64().expect("a height");
    pen.browser.look(&Look { width, height: u32::try_from(height).expect("a height"), dark });
    pen.middle = pen.browser.middle("#surface");
    Some((live, pen))
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
