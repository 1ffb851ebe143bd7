//! From pictures to materials, as a user does it: `asperity encode`, `asperity materials`.

use std::path::Path;

use asperity_texture::{Library, LibraryMaterial};
use harness::{Ran, Room, files, networks, run};
use image::{Rgb, RgbImage};

/// Answer of these tests' encoder to a picture of one brightness `s`, from 0 to 1.
fn vector(s: f64) -> [f32; 256] {
    std::array::from_fn(|n| (s * (1.0 + n as f64 / 256.0)) as f32)
}

/// Distance of two brightnesses as vectors.
fn apart(a: f64, b: f64) -> f64 {
    (a - b).abs() * (0..256).map(|n| (1.0 + f64::from(n) / 256.0).powi(2)).sum::<f64>().sqrt()
}

/// Stripes around a colour: a picture without any is blank.
fn picture(path: &Path, size: [u32; 2], rgb: [u8; 3]) {
    let width = (size[0] / 128).max(1);
    let stripes = |x: u32, _| Rgb(rgb.map(|c| if (x / width).is_multiple_of(2) { c - 9 } else { c + 9 }));
    RgbImage::from_fn(size[0], size[1], stripes).save(path).expect("a picture");
}

/// A folder with an encoder, a library of three materials that names it, and a picture between two of them.
fn folder() -> Room {
    let dir = Room::new();
    let at = |name: &str| dir.join(name);
    for name in ["models", "materials", "pictures"] {
        std::fs::create_dir(at(name)).expect("a folder");
    }
    let encoder = networks::encoder(&[1.0 / 576.0; 576], 0.0);
    dir.write("models/e.onnx", networks::bytes(&encoder));
    let material = |(name, s): (&str, f64)| LibraryMaterial {
        name: name.into(),
        description: "Made for a test.".into(),
        family: Some("grey".into()),
        images: Vec::new(),
        image_mm: None,
        pattern: Default::default(),
        vector: Box::new(vector(s)),
    };
    let materials = [("dark", 0.1), ("middle", 0.5), ("bright", 0.9)].map(material).to_vec();
    let library = Library::new(at("materials/l.ron"), Some("../models/e.onnx".into()), materials);
    let text = library.to_ron().replace("materials: {", "// What follows was made.\n    materials: {");
    dir.write("materials/l.ron", text);
    // 0.4 on the mean of its colours.
    picture(&at("pictures/felt.png"), [256, 192], [82, 102, 122]);
    dir
}

fn text(dir: &Room) -> String {
    dir.text("materials/l.ron")
}

fn stored(dir: &Room, name: &str) -> LibraryMaterial {
    let library = Library::read(dir.join("materials/l.ron")).unwrap_or_else(|e| panic!("{e}"));
    library.material(name).unwrap_or_else(|e| panic!("{e}")).clone()
}

fn encode(dir: &Room, line: &str) -> Ran {
    dir.run(&format!("encode --library materials/l.ron {line}"))
}

#[test]
fn a_picture_becomes_a_material_that_a_graph_can_name() {
    let dir = folder();
    let before = text(&dir);
    let ran = encode(&dir, "pictures/felt.png --description 'Soft \"felt\".' --family wool").ok();
    let line = |name: &str| ran.out.lines().position(|l| l.starts_with(name)).expect(name);
    assert!(line("middle") < line("dark") && line("dark") < line("bright"), "{}", ran.out);
    assert!(ran.out.contains(&format!("middle   {:8.4}  grey", apart(0.4, 0.5))), "{}", ran.out);
    assert!(ran.out.contains("added `felt` to materials/l.ron: the vector of `middle`"), "{}", ran.out);
    let felt = stored(&dir, "felt");
    assert!(felt.description == "Soft \"felt\"." && felt.images == ["../pictures/felt.png"], "{felt:?}");
    assert_eq!((felt.family.as_deref(), *felt.vector), (Some("wool"), vector(0.5)));
    // The rest of the file is what it was, and nothing else is left.
    let after = text(&dir);
    let kept = before.strip_suffix("    },\n)\n").expect("an end");
    assert!(after.starts_with(kept) && after.ends_with("    },\n)\n"), "{after}");
    assert_eq!(files(&dir.join("materials")), ["l.ron"]);
    // It renders as the material whose vector it has.
    dir.write("g.ron", harness::shipped_graph());
    let render = |material: &str, out: &str| {
        let set = "--set texture.library=materials/l.ron --set texture.material";
        dir.run(&format!("render g.ron {set}={material} --seconds 1 --out {out}")).ok();
        dir.bytes(out)
    };
    assert_eq!(render("felt", "a.wav"), render("middle", "b.wav"));
}

#[test]
fn a_new_material_may_keep_its_own_vector_or_take_a_blend() {
    let dir = folder();
    let near = |found: &LibraryMaterial, s: f64| {
        let worst = found.vector.iter().zip(vector(s)).fold(0.0, |w: f32, (a, b)| w.max((a - b).abs()));
        assert!(worst < 1e-5, "{}: {worst}", found.name);
    };
    encode(&dir, "pictures/felt.png --as raw --name own").ok();
    near(&stored(&dir, "own"), 0.4);
    // It is in the library now, and nearest to itself.
    let ran = encode(&dir, "pictures/felt.png --dry-run --neighbours 1").ok();
    assert!(ran.out.contains("own        0.0000") && !ran.out.contains("middle"), "{}", ran.out);
    let dir = folder();
    encode(&dir, "pictures/felt.png --as blend --neighbours 2 --name two")
        .ok()
        .says(&["a blend of the nearest 2"]);
    // 0.1 from 0.5 and 0.3 from 0.1.
    near(&stored(&dir, "two"), (0.5 / 0.1 + 0.1 / 0.3) / (1.0 / 0.1 + 1.0 / 0.3));
    // Unless told otherwise as many as the model's card is about.
    encode(&dir, "pictures/felt.png --as blend --dry-run").ok().says(&["a blend of the nearest 3"]);
}

/// A library keeps who may read it and one that may not be written is left alone.
#[cfg(unix)]
#[test]
fn library_keeps_its_permissions_and_read_only_is_untouched() {
    use std::os::unix::fs::PermissionsExt as _;
    let dir = folder();
    let library = dir.join("materials/l.ron");
    let mode = |mode: u32| {
        std::fs::set_permissions(&library, std::fs::Permissions::from_mode(mode)).expect("a mode")
    };
    mode(0o640);
    encode(&dir, "pictures/felt.png --name one").ok();
    assert_eq!(std::fs::metadata(&library).expect("a file").permissions().mode() & 0o777, 0o640);
    mode(0o444);
    let before = text(&dir);
    encode(&dir, "pictures/felt.png --name two").refused("may not be written");
    assert_eq!(text(&dir), before);
}

#[test]
fn those_who_add_at_the_same_time_all_add() {
    let dir = folder();
    let names: Vec<String> = (0..8).map(|n| format!("c{n}")).collect();
    std::thread::scope(|scope| {
        for name in &names {
            let line = format!("pictures/felt.png --name {name}");
            let dir = &dir;
            scope.spawn(move || encode(dir, &line).ok());
        }
    });
    names.iter().for_each(|name| drop(stored(&dir, name)));
}

#[test]
fn control_characters_of_a_file_name_are_escaped() {
    let dir = folder();
    let ran = encode(&dir, "pictures/\u{1b}[31m.png --name x").refused("\\u{1b}[31m.png");
    assert!(!ran.err.contains('\u{1b}'), "{}", ran.err);
}

#[test]
fn the_shipped_encoder_is_as_small_as_promised() {
    let bytes =
        std::fs::metadata(harness::graphs("models/surfaces/encoder.onnx")).expect("the encoder").len();
    assert!(bytes <= 12_000_000, "{bytes}");
}

#[test]
fn several_pictures_give_their_mean_and_how_far_they_are_apart() {
    let dir = folder();
    picture(&dir.join("pictures/second.png"), [640, 480], [204; 3]);
    let ran = encode(&dir, "pictures/felt.png pictures/second.png --as raw").ok().says(&[
        "pictures/second.png: grey",
        "pictures/felt.png: nearest `middle`",
        "pictures/second.png: nearest `bright`",
    ]);
    // Each is 0.2 from the mean.
    let spread = ran.out.split("spread of 2 pictures around their mean: ").nth(1).expect("a spread");
    for part in spread.split(", ").take(2) {
        let far: f64 = part.split(' ').next().and_then(|x| x.parse().ok()).expect("a number");
        assert!((far - apart(0.4, 0.6)).abs() < 0.05, "{spread}");
    }
    let felt = stored(&dir, "felt");
    assert!((felt.vector[0] - 0.6).abs() < 2e-3 && felt.description.contains("From 2 pictures"));
    assert_eq!(felt.images, ["../pictures/felt.png", "../pictures/second.png"]);
}

#[test]
fn what_is_done_to_a_picture_is_said() {
    let dir = folder();
    picture(&dir.join("odd.png"), [100, 60], [20, 80, 90]);
    encode(&dir, "odd.png --dry-run")
        .ok()
        .says(&["odd.png: cropped from 100 x 60 to its middle 80 x 60", "odd.png: enlarged from 80 x 60"]);
}

#[test]
fn a_dry_run_tells_and_adds_nothing() {
    let dir = folder();
    let before = text(&dir);
    encode(&dir, "pictures/felt.png --dry-run")
        .ok()
        .says(&["`felt` would get the vector of `middle`; nothing was added"]);
    // To look where a known one lies is no mistake.
    encode(&dir, "pictures/felt.png --dry-run --name dark")
        .ok()
        .says(&["warning: the library has a material `dark` already"]);
    assert_eq!(text(&dir), before);
}

#[test]
fn whatever_is_wrong_is_said_and_the_library_stays_as_it_is() {
    let dir = folder();
    let before = text(&dir);
    let at = |name: &str| dir.join(name);
    dir.write("text.png", "no picture");
    dir.write("empty.png", "");
    let whole = dir.bytes("pictures/felt.png");
    dir.write("cut.png", &whole[..whole.len() / 2]);
    let network = networks::model(&networks::Net::random(1), networks::Spelling::default());
    dir.write("network.onnx", networks::bytes(&network));
    let broken = networks::encoder(&[1e38; 576], 0.0);
    dir.write("broken.onnx", networks::bytes(&broken));
    for (args, names) in [
        ("text.png", "text.png: error: no PNG, JPEG or BMP picture"),
        ("empty.png", "empty.png: error: this file is empty"),
        ("cut.png", "cut.png: error: this PNG picture is damaged or cut off"),
        ("pictures/felt.png none.png", "none.png: error: cannot read"),
        ("pictures", "pictures: error: this is a folder"),
        ("pictures/felt.png --name dark", "has a material `dark` already"),
        ("pictures/felt.png --name ' '", "--name"),
        ("pictures/felt.png --encoder none.onnx", "--encoder names this file"),
        ("pictures/felt.png --encoder text.png", "not an ONNX model"),
        ("pictures/felt.png --encoder network.onnx", "3 inputs, not 1"),
        ("pictures/felt.png --encoder broken.onnx", "not finite"),
        ("pictures/felt.png --as nope", "--as"),
        ("pictures/felt.png --neighbours 0", "--neighbours"),
        ("pictures/felt.png --neighbours -1", "--neighbours"),
        ("pictures/felt.png --family ' '", "--family"),
        ("", "IMAGE"),
    ] {
        encode(&dir, args).refused(names);
        assert_eq!(text(&dir), before, "{args:?}");
    }
    dir.run("encode pictures/felt.png --library none.ron").refused("--library names this file");
    // A library that names no encoder, and one whose encoder is gone.
    let lines = before.lines().filter(|line| !line.trim_start().starts_with("encoder:"));
    dir.write("plain.ron", lines.collect::<Vec<_>>().join("\n") + "\n");
    dir.run("encode pictures/felt.png --library plain.ron").refused("names no encoder").says(&["--encoder"]);
    std::fs::remove_file(at("models/e.onnx")).expect("a file");
    encode(&dir, "pictures/felt.png").refused("materials/l.ron names this file");
}

#[test]
fn materials_are_listed_with_their_pictures_and_what_is_missing() {
    let dir = folder();
    encode(&dir, "pictures/felt.png").ok();
    let list =
        |more: &[&str]| run(&dir, &[&["materials", "--library", "materials/l.ron"], more].concat()).ok().out;
    let out = list(&[]);
    assert!(out.contains("dark    grey  Made for a test.") && out.contains("4 materials"), "{out}");
    assert!(out.contains("materials/../pictures/felt.png\n") && !out.contains("missing"), "{out}");
    std::fs::remove_file(dir.join("pictures/felt.png")).expect("a file");
    assert!(list(&[]).contains("pictures/felt.png (missing)"));
    dir.write("l.json", list(&["--json"]));
    let all = dir.json("l.json");
    assert_eq!(all["encoder"]["missing"], false);
    assert_eq!(all["materials"][3]["name"], "felt");
    assert_eq!(all["materials"][3]["images"][0]["missing"], true);
    assert!(all["materials"][0]["family"] == "grey" && all["materials"][3]["family"].is_null());
    // Without a name it is the shipped one, from any folder.
    for folder in [harness::root().as_path(), &dir] {
        run(folder, &["materials"]).ok().says(&["canvas"]);
    }
}

/// Name and family of the material that a picture of the shipped folder is nearest to.
fn nearest(picture: &str) -> (String, String) {
    let shipped = harness::graphs("models/surfaces").display().to_string();
    let files = format!("{shipped}/pictures/{picture}.jpg --library {shipped}/materials.ron");
    let out = Room::new().run(&format!("encode {files} --name new --dry-run")).ok().out;
    let mut lines = out.lines().skip_while(|line| !line.starts_with("nearest"));
    let parts: Vec<&str> = lines.nth(1).expect("a neighbour").split("  ").filter(|p| !p.is_empty()).collect();
    (parts[0].trim().to_owned(), parts[2].trim().to_owned())
}

/// It knows a surface by an unseen part of it, and a new surface by its family.
#[test]
fn shipped_encoder_knows_unseen_places_and_families() {
    // a picture of every sixteenth material, of a piece that was never trained on
    let library = Library::read(harness::graphs("models/surfaces/materials.ron")).expect("the library");
    assert_eq!(library.materials().len(), 96);
    let some = library.materials().iter().step_by(16);
    let picture = |m: &LibraryMaterial| m.images[0].replace("pictures/", "").replace(".jpg", "");
    let rightly: Vec<bool> = some.map(|m| nearest(&picture(m)).0 == m.name).collect();
    assert!(rightly.iter().filter(|r| !**r).count() <= 1, "{rightly:?}");
    // surfaces that were never trained on
    let strangers = [
        ("heavy_denim", "weave"),
        ("loop_pile", "carpet"),
        ("square_grating_2_mm", "grating"),
        ("pine", "wood"),
    ];
    let families = strangers.map(|(picture, family)| nearest(picture).1 == family);
    assert!(families.iter().filter(|r| !**r).count() <= 1, "{families:?}");
}

/// A folder with a copy of the shipped library, its encoder and statistics.
fn shipped() -> Room {
    let dir = Room::new();
    std::fs::create_dir(dir.join("materials")).expect("a folder");
    for (from, to) in [
        ("materials.ron", "l.ron"),
        ("encoder.onnx", "encoder.onnx"),
        ("encoder.statistics.ron", "encoder.statistics.ron"),
    ] {
        let from = harness::graphs("models/surfaces").join(from);
        std::fs::copy(from, dir.join("materials").join(to)).expect("a copy");
    }
    dir
}

/// A shipped picture.
fn shipped_picture(name: &str) -> RgbImage {
    let path = harness::graphs("models/surfaces/pictures").join(name);
    image::open(path).expect("a picture").into_rgb8()
}

/// Refuses a picture for this reason, and leaves the library as it is.
fn refuses(picture: &RgbImage, why: &str) {
    let dir = shipped();
    let before = text(&dir);
    picture.save(dir.join("new.png")).expect("a picture");
    encode(&dir, "new.png --accept-unlike").refused(why).says(&["new.png: error: this picture is"]);
    encode(&dir, "new.png --dry-run").refused(why);
    assert_eq!(text(&dir), before);
}

#[test]
fn encode_refuses_a_black_picture() {
    refuses(&RgbImage::new(640, 480), "blank: its contrast is 0.0 levels of 255, and 2 is the least");
}

#[test]
fn encode_refuses_a_white_picture() {
    refuses(&RgbImage::from_pixel(640, 480, Rgb([255; 3])), "blank");
}

#[test]
fn encode_refuses_a_saturated_picture() {
    let mut picture = shipped_picture("heavy_denim.jpg");
    picture.pixels_mut().for_each(|p| p.0 = p.0.map(|x| x.saturating_mul(3)));
    refuses(&picture, "% of its values are black or white, and 15 % is the most");
}

#[test]
fn encode_refuses_a_picture_out_of_focus() {
    for name in ["heavy_denim.jpg", "cut_pile.jpg", "sandpaper_P100.jpg"] {
        let blurred = image::imageops::blur(&shipped_picture(name), 3.0);
        refuses(&blurred, "out of focus");
    }
}

/// Warns of a picture, lists its nearest materials all the same, and adds it only if asked.
fn is_unlike(picture: &RgbImage) {
    let dir = shipped();
    let before = text(&dir);
    picture.save(dir.join("new.png")).expect("a picture");
    let why = "new.png: error: this picture is unlike those that the encoder was trained on: distance";
    encode(&dir, "new.png").refused(why).says(&["nearest ", "`--accept-unlike` adds it all the same"]);
    assert_eq!(text(&dir), before);
    encode(&dir, "new.png --dry-run").ok().says(&["warning: new.png: this picture is unlike"]);
    let report = encode(&dir, "new.png --json --accept-unlike").json();
    let found = &report["images"][0]["strangeness"];
    assert!(found["unlike"] == true && found["distance"].as_f64() > found["limit"].as_f64(), "{report}");
    assert_eq!(report["material"]["added"], true);
    stored(&dir, "new");
}

#[test]
fn encode_tells_a_screenshot_is_unlike() {
    // Windows with lines of text.
    let colour = |x: u32, y: u32| match (x, y) {
        (_, 0..20) => [40, 60, 120],
        (0..200, _) if y % 14 < 8 && x * 7919 % 11 < 6 => [30; 3],
        (0..200, _) => [250; 3],
        _ if y % 20 < 10 && x * 6271 % 13 < 7 => [20, 120, 40],
        _ => [230, 236, 240],
    };
    is_unlike(&RgbImage::from_fn(640, 480, |x, y| Rgb(colour(x, y))));
}

/// As those of a GelSight with marker dots under other lights.
#[test]
fn encode_tells_a_gel_with_marker_dots_is_unlike() {
    let mut picture = shipped_picture("beech.jpg");
    for (x, y, p) in picture.enumerate_pixels_mut() {
        let [u, v] = [x % 24, y % 24].map(|i| f64::from(i) - 12.0);
        p.0 = if u * u + v * v < 12.0 { [25; 3] } else { [p[0].saturating_add(60), p[1], p[2]] };
    }
    is_unlike(&picture);
}

#[test]
fn encode_tells_a_grey_picture_is_unlike() {
    let mut picture = shipped_picture("denim.jpg");
    picture.pixels_mut().for_each(|p| p.0 = [p[0]; 3]);
    is_unlike(&picture);
}

/// Every picture of a library's materials and strangers, and new ones of made surfaces.
#[test]
fn encode_accepts_pictures_as_it_was_trained_on() {
    use asperity_surfaces::tactile::{Camera, Press, indentation};
    let dir = shipped();
    let mut all: Vec<String> = files(&harness::graphs("models/surfaces/pictures"))
        .into_iter()
        .map(|name| harness::graphs("models/surfaces/pictures").join(name).display().to_string())
        .collect();
    let random = &mut asperity_numbers::Random::new(20);
    for (number, surface) in asperity_surfaces::topography::made_surfaces().iter().enumerate().step_by(9) {
        let press = Press { place_mm: [7.0, 9.0], turn: 0.4, depth_mm: 0.4 };
        let piece = surface.patch((1024, 0.02), 77);
        let made = Camera::USUAL.picture(&indentation(&piece, &press, Camera::USUAL.grid()), random);
        let picture = RgbImage::from_raw(256, 192, made.pixels).expect("a picture");
        let path = dir.join(format!("{number}.png"));
        picture.save(&path).expect("a picture");
        all.push(path.display().to_string());
    }
    let report = encode(&dir, &format!("{} --name new --dry-run --json", all.join(" "))).json();
    let images = report["images"].as_array().expect("images");
    let unlike: Vec<_> = images.iter().filter(|i| i["strangeness"]["unlike"] != false).collect();
    assert!(images.len() == all.len() && unlike.is_empty(), "{unlike:#?}");
}

#[test]
fn encoder_without_statistics_says_that_it_cannot_tell() {
    let dir = folder();
    encode(&dir, "pictures/felt.png --dry-run").ok().says(&["e.statistics.ron", "cannot be told"]);
    // Those of another encoder are refused, and a damaged file.
    let other = harness::shipped("models/surfaces/encoder.statistics.ron");
    dir.write("models/e.statistics.ron", &other);
    encode(&dir, "pictures/felt.png")
        .refused("e.statistics.ron:4:14: error: these are statistics of another");
    dir.write("models/e.statistics.ron", &other[..other.len() / 2]);
    encode(&dir, "pictures/felt.png").refused("e.statistics.ron:");
}
