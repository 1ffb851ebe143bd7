//! Pictures for tests.

use std::path::Path;

/// Writes a grey picture of 320 x 240 pixels.
pub(crate) fn picture(path: &Path, grey: u8) {
    let file = std::fs::File::create(path).unwrap();
    let mut encoder = png::Encoder::new(file, 320, 240);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&vec![grey; 320 * 240 * 3]).unwrap();
}
