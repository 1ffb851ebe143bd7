use std::io::Cursor;
use std::path::PathBuf;

use image::{
    DynamicImage, GrayAlphaImage, GrayImage, ImageBuffer, ImageFormat, Luma, Rgb, RgbImage, RgbaImage,
};

use super::{IMAGE, Picture, read};

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn with(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    fn read(&self, bytes: &[u8]) -> Picture {
        read(&self.with("picture", bytes)).unwrap_or_else(|e| panic!("{e}"))
    }

    fn error(&self, bytes: &[u8]) -> String {
        read(&self.with("picture", bytes)).unwrap_err().to_string()
    }
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
fn a_picture_of_the_right_size_comes_through_pixel_by_pixel() {
    let picture = Folder::new().read(&png(colours(256, 192)));
    assert_eq!(picture.notes, Vec::<String>::new());
    assert_eq!(picture.image.size, IMAGE);
    assert_eq!(picture.image.pixels, colours(256, 192).into_raw());
}

#[test]
fn a_wide_and_a_high_picture_give_their_middle() {
    let folder = Folder::new();
    // Columns 100 to 740 and rows 160 to 640 are the middle. Outside is white.
    let wide =
        RgbImage::from_fn(840, 480, |x, _| Rgb(if (100..740).contains(&x) { [9, 80, 7] } else { [255; 3] }));
    let high =
        RgbImage::from_fn(640, 800, |_, y| Rgb(if (160..640).contains(&y) { [9, 80, 7] } else { [255; 3] }));
    for (picture, said) in [
        (wide, "cropped from 840 x 480 to its middle 640 x 480"),
        (high, "cropped from 640 x 800 to its middle 640 x 480"),
    ] {
        let read = folder.read(&png(picture));
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
    let picture = Folder::new().read(&png(stripes));
    let (low, high) =
        (4..252).map(|c| pixel(&picture, 100, c)[0]).fold((255, 0), |(l, h), x| (l.min(x), h.max(x)));
    assert!(low > 122 && high < 133, "{low} to {high}");
    assert_eq!(pixel(&picture, 100, 100)[1..], [40, 90]);
}

#[test]
fn a_small_picture_is_enlarged_and_that_is_said() {
    let ramp = RgbImage::from_fn(64, 48, |x, y| Rgb([4 * x as u8, 5 * y as u8, 3]));
    let picture = Folder::new().read(&png(ramp));
    assert_eq!(picture.notes, ["enlarged from 64 x 48 to 256 x 192, which adds no detail"]);
    // Output column c lies at input column (c + 0.5) / 4 - 0.5.
    for c in 4..252 {
        let want = 4.0 * ((c as f64 + 0.5) / 4.0 - 0.5);
        assert!((f64::from(pixel(&picture, 90, c)[0]) - want).abs() <= 1.0);
    }
}

#[test]
fn grey_pictures_give_three_equal_channels_and_say_so() {
    let folder = Folder::new();
    let grey = GrayImage::from_fn(256, 192, |x, y| Luma([(x ^ y) as u8]));
    let alpha = GrayAlphaImage::from_fn(256, 192, |x, y| image::LumaA([(x ^ y) as u8, x as u8]));
    let coloured = DynamicImage::from(grey.clone()).into_rgb8();
    let a = folder.read(&png(grey));
    let b = folder.read(&png(alpha));
    let c = folder.read(&png(coloured));
    assert_eq!((&a.image, &a.image), (&b.image, &c.image));
    assert_eq!(pixel(&a, 5, 9), [12; 3]);
    let grey = "grey: its colours say nothing of slopes";
    assert_eq!(a.notes, [grey]);
    assert_eq!(b.notes, ["its alpha is left out", grey]);
    assert_eq!(c.notes, [grey]);
}

#[test]
fn alpha_is_left_out_and_does_not_darken() {
    let clear = RgbaImage::from_fn(256, 192, |x, y| image::Rgba([x as u8, y as u8, 7, (x + y) as u8]));
    let picture = Folder::new().read(&png(clear));
    assert_eq!(picture.notes, ["its alpha is left out"]);
    assert_eq!(pixel(&picture, 3, 200), [200, 3, 7]);
}

#[test]
fn sixteen_bits_are_rounded_to_eight() {
    let deep: ImageBuffer<Rgb<u16>, Vec<u16>> =
        ImageBuffer::from_fn(256, 192, |x, y| Rgb([257 * x as u16, 257 * y as u16 + 100, 0]));
    let picture = Folder::new().read(&png(DynamicImage::ImageRgb16(deep)));
    assert_eq!(picture.notes, ["16 bits a channel, brought to 8"]);
    assert_eq!(pixel(&picture, 17, 250), [250, 17, 0]);
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
    let picture = Folder::new().read(&bytes);
    assert_eq!(
        [pixel(&picture, 0, 0), pixel(&picture, 9, 5), pixel(&picture, 191, 254)],
        [[1, 2, 3], [10, 20, 30], [100, 110, 120]]
    );
}

#[test]
fn a_jpeg_is_read_and_turned_as_its_exif_says() {
    let folder = Folder::new();
    // Red left, blue right.
    let halves = RgbImage::from_fn(512, 384, |x, _| Rgb(if x < 256 { [200, 20, 20] } else { [20, 20, 200] }));
    let jpeg = encoded(halves, ImageFormat::Jpeg);
    let plain = folder.read(&jpeg);
    assert_eq!(plain.notes, Vec::<String>::new());
    let near = |a: [u8; 3], b: [u8; 3]| a.iter().zip(b).all(|(a, b)| a.abs_diff(b) < 12);
    assert!(near(pixel(&plain, 90, 20), [200, 20, 20]) && near(pixel(&plain, 90, 230), [20, 20, 200]));
    // Orientation 3: upside down. One entry of an IFD, big endian.
    let mut turned = jpeg[..2].to_vec();
    turned.extend([0xff, 0xe1, 0, 34]);
    turned.extend(b"Exif\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x03\0\0\0\0\0\0");
    turned.extend(&jpeg[2..]);
    let turned = folder.read(&turned);
    assert_eq!(turned.notes, ["turned as its EXIF data says"]);
    assert!(near(pixel(&turned, 90, 20), [20, 20, 200]) && near(pixel(&turned, 90, 230), [200, 20, 20]));
}

#[test]
fn picture_cut_off_anywhere_is_an_error_with_its_name() {
    let folder = Folder::new();
    for format in [ImageFormat::Png, ImageFormat::Jpeg] {
        let whole = encoded(colours(300, 200), format);
        for part in 1..24 {
            let e = folder.error(&whole[..whole.len() * part / 24]);
            assert!(e.contains("picture: ") && e.contains("cut off"), "{part} {e}");
        }
        // Data after the end does no harm.
        folder.read(&[&whole[..], b"more"].concat());
    }
}

#[test]
fn non_picture_is_an_error_with_its_real_type() {
    let folder = Folder::new();
    assert!(folder.error(b"").contains("this file is empty"));
    assert!(folder.error(b"name,force\nfelt,1.5\n").contains("no PNG, JPEG or BMP picture"));
    assert!(folder.error(b"GIF89a and so on").contains("no PNG, JPEG or BMP picture"));
    assert!(read(folder.0.path()).unwrap_err().to_string().contains("this is a folder"));
    let missing = read(&folder.0.path().join("none.png")).unwrap_err().to_string();
    assert!(missing.contains("none.png: cannot read this file"), "{missing}");
    let mut broken = png(colours(300, 200));
    let half = broken.len() / 2;
    broken[half..half + 40].fill(0x55);
    assert!(folder.error(&broken).contains("damaged"));
}

#[test]
fn pictures_of_wrong_size_are_refused_before_unpacking() {
    let folder = Folder::new();
    for (size, told) in [
        ((15, 300), "15 x 300 pixels (a tactile image has at least 16 x 16)"),
        ((300, 15), "at least 16 x 16"),
    ] {
        assert!(folder.error(&png(colours(size.0, size.1))).contains(told), "{size:?}");
    }
    assert_eq!(folder.read(&png(colours(16, 16))).image.size, IMAGE);
    // 3.6 thousand million pixels are announced, and a few bytes come.
    let mut bytes = Vec::new();
    let mut writer = png::Encoder::new(&mut bytes, 60_000, 60_000).write_header().unwrap();
    writer.write_chunk(png::chunk::IDAT, &[0x78, 0x9c, 0x63, 0x00]).unwrap();
    drop(writer);
    assert!(folder.error(&bytes).contains("at most 50000000 pixels"));
    // The smallest strip that is wide enough.
    let strip = folder.read(&png(colours(9000, 16)));
    assert!(strip.notes[0].contains("middle 21 x 16"), "{:?}", strip.notes);
}
