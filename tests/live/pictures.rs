//! The picture of the page in the README: `make live-pictures`.

use std::collections::HashMap;
use std::fs::File;
use std::io::BufReader;
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

/// Counts of colours.
type Counts = HashMap<[u8; 3], u32>;

/// Writes a picture anew with the 256 colours that it has most of: a page has few, and edges between them.
fn few_colours(file: &Path) {
    let mut reader = png::Decoder::new(BufReader::new(File::open(file).expect("a picture")))
        .read_info()
        .expect("a picture");
    let mut pixels = vec![0; reader.output_buffer_size().expect("a size")];
    let info = reader.next_frame(&mut pixels).expect("a picture");
    let step = info.color_type.samples();
    // Edges in 32 steps of each colour look like edges.
    let near = |p: &[u8]| [0, 1, 2].map(|i| p[i] >> 3);
    let mut counts: HashMap<[u8; 3], (u32, Counts)> = HashMap::new();
    for p in pixels.chunks_exact(step) {
        let (count, exact) = counts.entry(near(p)).or_default();
        *count += 1;
        *exact.entry([p[0], p[1], p[2]]).or_default() += 1;
    }
    let mut all: Vec<_> = counts.into_iter().collect();
    all.sort_by_key(|(near, (count, _))| (std::cmp::Reverse(*count), *near));
    let exact = |of: &Counts| *of.iter().max_by_key(|(c, n)| (**n, **c)).expect("a colour").0;
    let palette: Vec<[u8; 3]> = all.iter().take(256).map(|(_, (_, of))| exact(of)).collect();
    let far =
        |a: [u8; 3], b: [u8; 3]| (0..3).map(|i| (i32::from(a[i]) - i32::from(b[i])).pow(2)).sum::<i32>();
    let place = |(near, (_, of)): &([u8; 3], (u32, Counts))| {
        let colour = exact(of);
        (*near, (0..palette.len()).min_by_key(|&k| far(palette[k], colour)).unwrap_or(0) as u8)
    };
    let places: HashMap<[u8; 3], u8> = all.iter().map(place).collect();
    let indices: Vec<u8> = pixels.chunks_exact(step).map(|p| places[&near(p)]).collect();
    let mut encoder = png::Encoder::new(File::create(file).expect("a file"), info.width, info.height);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette(palette.concat());
    encoder.set_compression(png::Compression::High);
    encoder.set_filter(png::Filter::NoFilter);
    encoder.write_header().and_then(|mut w| w.write_image_data(&indices)).expect("a picture");
}
