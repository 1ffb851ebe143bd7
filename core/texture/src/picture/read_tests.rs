use std::io::Cursor;

use image::{
    DynamicImage, GrayAlphaImage, GrayImage, ImageBuffer, ImageFormat, Luma, Rgb, RgbImage, RgbaImage,
};

use super::{IMAGE, Picture, read};

/// Reads a file of these bytes.
fn try_read(bytes: &[u8]) -> Result<Picture, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture");
    std::fs::write(&path, bytes).unwrap();
    read(&path).map_err(|e| e.to_string())
}

fn good(bytes: &[u8]) -> Picture {
    try_read(bytes).unwrap()
}

fn error(bytes: &[u8]) -> String {
    try_read(bytes).unwrap_err()
}

fn encoded(picture: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    picture.into().write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn png(picture: impl Into<DynamicImage>) -> Vec<u8> {
    encoded(picture, ImageFormat::Png)
}

fn pixel(picture: &Picture, row: usize, column: usize) -> [u8; 3] {
    let at = 3 * (row * IMAGE[1] + column);
    picture.image.pixels[at..at + 3].try_into().unwrap()
}

/// Every pixel has its own colour.
fn colours(width: u32, height: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| Rgb([x as u8, y as u8, (x + 2 * y) as u8]))
}

#[test]
fn a_wide_and_a_high_picture_give_their_middle() {
    // Columns 100 to 740 and rows 160 to 640 are the middle. Outside is white.
    let wide =
        RgbImage::from_fn(840, 480, |x, _| Rgb(if (100..740).contains(&x) { [9, 80, 7] } else { [255; 3] }));
    let high =
        RgbImage::from_fn(640, 800, |_, y| Rgb(if (160..640).contains(&y) { [9, 80, 7] } else { [255; 3] }));
    for (picture, said) in [
        (wide, "cropped from 840 x 480 to its middle 640 x 480"),
        (high, "cropped from 640 x 800 to its middle 640 x 480"),
    ] {
        let read = good(&png(picture));
        assert_eq!(read.notes, [said]);
        assert!(read.image.pixels.chunks(3).all(|p| p == [9, 80, 7]));
    }
}

#[test]
fn stripes_finer_than_a_pixel_become_their_mean() {
    // 1024 columns to 256: if every fourth were taken, stripes of 1.05 columns would alias to waves of 20.
    let stripes = RgbImage::from_fn(1024, 768, |x, _| {
        let wave = (f64::from(x) * std::f64::consts::TAU / 4.2).sin();
        Rgb([(127.5 + 100.0 * wave) as u8, 40, 90])
    });
    let picture = good(&png(stripes));
    let (low, high) =
        (4..252).map(|c| pixel(&picture, 100, c)[0]).fold((255, 0), |(l, h), x| (l.min(x), h.max(x)));
    assert!(low > 122 && high < 133, "{low} to {high}");
    assert_eq!(pixel(&picture, 100, 100)[1..], [40, 90]);
}

#[test]
fn a_small_picture_is_enlarged_and_that_is_said() {
    let ramp = RgbImage::from_fn(64, 48, |x, y| Rgb([4 * x as u8, 5 * y as u8, 3]));
    let picture = good(&png(ramp));
    assert_eq!(picture.notes, ["enlarged from 64 x 48 to 256 x 192, which adds no detail"]);
    // Output column c lies at input column (c + 0.5) / 4 - 0.5.
    for c in 4..252 {
        let want = 4.0 * ((c as f64 + 0.5) / 4.0 - 0.5);
        assert!((f64::from(pixel(&picture, 90, c)[0]) - want).abs() <= 1.0);
    }
}

#[test]
fn every_kind_of_picture_becomes_its_colours_and_notes() {
    let plain = colours(256, 192);
    let grey = GrayImage::from_fn(256, 192, |x, y| Luma([(x ^ y) as u8]));
    let alpha = GrayAlphaImage::from_fn(256, 192, |x, y| image::LumaA([(x ^ y) as u8, x as u8]));
    let clear = RgbaImage::from_fn(256, 192, |x, y| image::Rgba([x as u8, y as u8, 7, (x + y) as u8]));
    let deep: ImageBuffer<Rgb<u16>, Vec<u16>> =
        ImageBuffer::from_fn(256, 192, |x, y| Rgb([257 * x as u16, 257 * y as u16 + 100, 0]));
    let is_grey = "grey: its colours say nothing of slopes";
    let no_alpha = "its alpha is left out";
    let cases: [(&str, DynamicImage, &[&str], [u8; 3]); 6] = [
        ("the right size", plain.clone().into(), &[], [200, 17, 234]),
        ("grey", grey.clone().into(), &[is_grey], [217; 3]),
        ("grey in colours", DynamicImage::from(grey).into_rgb8().into(), &[is_grey], [217; 3]),
        ("grey with alpha", alpha.into(), &[no_alpha, is_grey], [217; 3]),
        ("alpha, which does not darken", clear.into(), &[no_alpha], [200, 17, 7]),
        (
            "16 bits, rounded",
            DynamicImage::ImageRgb16(deep),
            &["16 bits a channel, brought to 8"],
            [200, 17, 0],
        ),
    ];
    for (name, picture, notes, colour) in cases {
        let read = good(&png(picture));
        assert!(read.image.size == IMAGE && read.notes == notes, "{name}: {:?}", read.notes);
        assert_eq!(pixel(&read, 17, 200), colour, "{name}");
    }
    assert_eq!(good(&png(plain.clone())).image.pixels, plain.into_raw());
}

#[test]
fn a_palette_gives_its_colours() {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 256, 192);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Two);
    encoder.set_palette(vec![1, 2, 3, 10, 20, 30, 100, 110, 120, 255, 250, 245]);
    // Four pixels a byte: 0, 1, 2, 3.
    encoder.write_header().unwrap().write_image_data(&vec![0b00_01_10_11; 64 * 192]).unwrap();
    let picture = good(&bytes);
    assert_eq!(
        [pixel(&picture, 0, 0), pixel(&picture, 9, 5), pixel(&picture, 191, 254)],
        [[1, 2, 3], [10, 20, 30], [100, 110, 120]]
    );
}

#[test]
fn a_jpeg_is_read_and_turned_as_its_exif_says() {
    // Red left, blue right.
    let halves = RgbImage::from_fn(512, 384, |x, _| Rgb(if x < 256 { [200, 20, 20] } else { [20, 20, 200] }));
    let jpeg = encoded(halves, ImageFormat::Jpeg);
    let plain = good(&jpeg);
    assert_eq!(plain.notes, Vec::<String>::new());
    let near = |a: [u8; 3], b: [u8; 3]| a.iter().zip(b).all(|(a, b)| a.abs_diff(b) < 12);
    assert!(near(pixel(&plain, 90, 20), [200, 20, 20]) && near(pixel(&plain, 90, 230), [20, 20, 200]));
    // Orientation 3: upside down. One entry of an IFD, big endian.
    let mut turned = jpeg[..2].to_vec();
    turned.extend([0xff, 0xe1, 0, 34]);
    turned.extend(b"Exif\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x03\0\0\0\0\0\0");
    turned.extend(&jpeg[2..]);
    let turned = good(&turned);
    assert_eq!(turned.notes, ["turned as its EXIF data says"]);
    assert!(near(pixel(&turned, 90, 20), [20, 20, 200]) && near(pixel(&turned, 90, 230), [200, 20, 20]));
}

#[test]
fn picture_cut_off_anywhere_is_an_error_with_its_name() {
    for format in [ImageFormat::Png, ImageFormat::Jpeg] {
        let whole = encoded(colours(300, 200), format);
        for part in 1..24 {
            let e = error(&whole[..whole.len() * part / 24]);
            assert!(e.contains("picture: ") && e.contains("cut off"), "{part} {e}");
        }
        // Data after the end does no harm.
        good(&[&whole[..], b"more"].concat());
    }
}

#[test]
fn non_picture_is_an_error_with_its_real_type() {
    assert!(error(b"").contains("this file is empty"));
    assert!(error(b"name,force\nfelt,1.5\n").contains("no PNG, JPEG or BMP picture"));
    assert!(error(b"GIF89a and so on").contains("no PNG, JPEG or BMP picture"));
    for (path, wanted) in
        [(env!("CARGO_MANIFEST_DIR"), "a folder"), ("none.png", "none.png: cannot read this file")]
    {
        let e = read(path.as_ref()).unwrap_err().to_string();
        assert!(e.contains(wanted), "{e}");
    }
    let mut broken = png(colours(300, 200));
    let half = broken.len() / 2;
    broken[half..half + 40].fill(0x55);
    assert!(error(&broken).contains("damaged"));
}

#[test]
fn pictures_of_wrong_size_are_refused_before_unpacking() {
    for (size, told) in [
        ((15, 300), "15 x 300 pixels (a tactile image has at least 16 x 16)"),
        ((300, 15), "at least 16 x 16"),
    ] {
        assert!(error(&png(colours(size.0, size.1))).contains(told), "{size:?}");
    }
    assert_eq!(good(&png(colours(16, 16))).image.size, IMAGE);
    // 3.6 thousand million pixels are announced, and a few bytes come.
    let mut bytes = Vec::new();
    let mut writer = png::Encoder::new(&mut bytes, 60_000, 60_000).write_header().unwrap();
    writer.write_chunk(png::chunk::IDAT, &[0x78, 0x9c, 0x63, 0x00]).unwrap();
    drop(writer);
    assert!(error(&bytes).contains("at most 50000000 pixels"));
    // The smallest strip that is wide enough.
    let strip = good(&png(colours(9000, 16)));
    assert!(strip.notes[0].contains("middle 21 x 16"), "{:?}", strip.notes);
}
