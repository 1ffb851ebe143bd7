//! Files read back; bad ones are refused with their place.

use proptest::prelude::*;

use super::super::testing::stable;
use super::*;
use asperity_numbers::Random;

fn parse(text: &str) -> Result<TextureFile, Diagnostic> {
    TextureFile::parse(&Source::new("t.ron", text))
}

fn error(text: &str) -> String {
    parse(text).unwrap_err().to_string()
}

/// A file with these models, one a line, from line 3 on.
fn with(models: &str, after: &str) -> String {
    format!(
        "Autoregressive(version: 1, description: \"d\", origin: \"o\", rate_hz: 1000,\n\
         models: [\n{models}\n], {after})"
    )
}

fn line(ar: &str, speed: f64, force: f64) -> String {
    format!("(speed_mm_s: {speed}, force_n: {force}, variance: 0.04, gain: 1.5, ar: [{ar}], ma: [0.3]),\n")
}

fn square() -> String {
    [[20.0, 0.5], [200.0, 0.5], [200.0, 2.0], [20.0, 2.0]].map(|[v, f]| line("-1.2, 0.81", v, f)).concat()
}

/// Models with random frequencies; they are always stable.
fn drawn(seed: u64, count: usize, orders: [usize; 2]) -> Vec<Model> {
    let mut random = Random::new(seed);
    let mut polynomial = |order: usize| stable(&mut random, order, if order > 30 { 0.9 } else { 0.3 });
    let polynomials: Vec<[Vec<f64>; 2]> = (0..count).map(|_| orders.map(&mut polynomial)).collect();
    let mut random = Random::new(seed ^ 0x55);
    polynomials
        .into_iter()
        .map(|[ar, ma]| Model {
            ar,
            ma,
            variance: 10f64.powf(random.range(-12.0, 2.0)),
            gain: random.range(0.0, 3.0),
            speed_mm_s: random.range(0.0, 400.0),
            force_n: random.range(0.0, 4.0),
        })
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn written_file_reads_back_to_the_same_bits(
        seed: u64, count in 1..30usize, p in 0..24usize, q in 0..6usize,
        rate_hz in 100.0..1e5f64, words in ".{0,40}",
    ) {
        let texture = Texture::new(rate_hz, drawn(seed, count, [p, q]), None).unwrap();
        let file = TextureFile { description: words.clone(), origin: words, texture };
        let text = file.to_ron().unwrap();
        let read = parse(&text).unwrap();
        prop_assert_eq!(&read, &file);
        for (x, y) in read.texture.models().iter().zip(file.texture.models()) {
            prop_assert!(x.ar.iter().zip(&y.ar).all(|(x, y)| x.to_bits() == y.to_bits()));
            prop_assert_eq!(x.variance.to_bits(), y.variance.to_bits());
        }
        prop_assert_eq!(read.to_ron().unwrap(), text);
    }
}

#[test]
fn given_triangles_are_kept_and_missing_ones_made() {
    let corners =
        |after: &str| parse(&with(&square(), after)).unwrap().texture.triangles().corners().to_vec();
    let (one, other) = ([[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]);
    assert_eq!(corners("triangles: [[0, 1, 2], [0, 2, 3]]"), one);
    assert_eq!(corners("triangles: [(0, 1, 3), (1, 2, 3)]"), other);
    assert_eq!(corners("").len(), 2);
    for given in [one, other] {
        let file = parse(&with(&square(), &format!("triangles: {given:?}"))).unwrap();
        assert_eq!(parse(&file.to_ron().unwrap()).unwrap().texture.triangles().corners(), given);
    }
    // One model, and models on a line, have none.
    let on_a_line = line("0.1", 10.0, 1.0) + &line("0.2", 30.0, 1.0) + &line("0.3", 20.0, 1.0);
    for models in [line("0.1", 10.0, 1.0), on_a_line] {
        let file = parse(&with(&models, "")).unwrap();
        assert_eq!(parse(&file.to_ron().unwrap()).unwrap(), file);
    }
}

#[test]
fn gain_and_moving_average_may_be_left_out() {
    let file = parse(&with("(speed_mm_s: 1, force_n: 2, variance: 3, ar: [])", "")).unwrap();
    let model = Model { ar: vec![], ma: vec![], variance: 3.0, gain: 1.0, speed_mm_s: 1.0, force_n: 2.0 };
    assert_eq!((file.texture.models(), file.texture.rate_hz()), ([model].as_slice(), 1000.0));
    assert_eq!((file.description.as_str(), file.origin.as_str()), ("d", "o"));
}

#[test]
fn model_without_ar_or_any_coefficients_reads_back() {
    for orders in [[0, 1], [0, 0]] {
        let texture = Texture::new(100.0, drawn(0, 1, orders), None).unwrap();
        let file = TextureFile { description: String::new(), origin: String::new(), texture };
        assert_eq!(parse(&file.to_ron().unwrap()).unwrap(), file);
    }
}

#[test]
fn every_error_has_its_place() {
    let good = square();
    let second = |what: &str, by: &str| {
        let at = good.find("200").unwrap() - 12;
        let (before, after) = good.split_at(at);
        assert!(after.contains(what), "{what}");
        error(&with(&format!("{before}{}", after.replacen(what, by, 1)), ""))
    };
    for (found, want) in [
        // From `Model::check`.
        (second("-1.2, 0.81", "-2.2, 1.21"), "t.ron:4:1: the autoregressive part of a model is not stable"),
        (second("[0.3]", "[1.3]"), "t.ron:4:1: the moving-average part of a model is not of minimum phase"),
        (second("-1.2, 0.81", &"0, ".repeat(65)), "t.ron:4:64: 65 coefficients"),
        (second("[0.3]", &format!("[{}]", "0, ".repeat(65))), "t.ron:4:82: 65 coefficients"),
        (second("0.04", "-0.04"), "t.ron:4:43: -0.04 (m/s^2)^2 is out of range"),
        (second("1.5", "-1"), "t.ron:4:55: -1 is out of range"),
        (second("200", "-200"), "t.ron:4:14: -200 mm/s is out of range"),
        (second("0.5", "-0.5"), "t.ron:4:28: -0.5 N is out of range"),
        (second("0.04", "NaN"), "t.ron:4:43: not a finite number"),
        (second("0.81", "inf"), "t.ron:4:71: not a finite number"),
        (second("0.81", "\"x\""), "t.ron:4:71: expected a number"),
        // From `Texture::new`.
        (second("-1.2, 0.81", "0.5"), "t.ron:4:1: 1 and 1 coefficients, where the first has 2 and 1"),
        (second("[0.3]", "[]"), "t.ron:4:1: 2 and 0 coefficients, where the first has 2 and 1"),
        (error(&with("", "")), "t.ron:2:9: a texture of 0 models"),
        (error(&with(&good, "").replace("1000", "0")), "t.ron:1:68: 0 Hz is out of range"),
        // From the file.
        (second("200", "20"), "t.ron:4:1: a second model at 20 mm/s and 0.5 N"),
        (second("0.04", "1e12"), "t.ron:4:1: a model whose signal has a root mean square of"),
        (second("gain", "gian"), "t.ron:4:49: unknown field `gian` (did you mean `gain`?)"),
        (second("variance: 0.04,", ""), "t.ron:4:1: the field `variance` is missing"),
        (error(&with(&good, "triangles: [[0, 1, 2], [0, 2, 4]]")), "t.ron:8:34: 4 is out of range"),
        (error(&with(&good, "triangles: [[0, 1, 2], [0, 2, -1]]")), "t.ron:8:34: -1 is out of range"),
        (error(&with(&good, "triangles: [[0, 1, 2], [0, 2, 2.5]]")), "t.ron:8:34: expected a whole number"),
        (error(&with(&good, "triangles: [[0, 1, 2]]")), "t.ron:8:15: triangles that do not tile the hull"),
        (error(&with(&good, "triangles: [[0, 1]]")), "t.ron:8:16: 2 corners of a triangle"),
        (error(&with(&good, "triangles: [[0, 1, 1]]")), "t.ron:8:16: a triangle with one corner twice"),
        (
            error(&with(&good, &format!("triangles: [{}]", "[0, 1, 2], ".repeat(9)))),
            "t.ron:8:15: 9 triangles between 4 models",
        ),
        (error(&with(&good, "").replace("version: 1", "version: 2")), "t.ron:1:25: 2 is out of range"),
        (error("Autoregressive(version: 1)"), "t.ron:1:1: the field `description` is missing"),
        (error("Library(version: 1)"), "t.ron:1:1: expected `Autoregressive(...)`"),
    ] {
        assert!(found.starts_with(want), "{found}\nwanted {want}");
    }
    let twice = parse(&with(&(line("0.1", 20.0, 1.0) + &line("0.2", 20.0, 1.0)), "")).unwrap_err();
    assert_eq!(twice.related.len(), 1);
    assert!(
        TextureFile::read("no/such.ron").unwrap_err().to_string().starts_with("no/such.ron: cannot read")
    );
}

#[test]
fn hostile_files_are_refused_early() {
    let many = error(&with(&"(),".repeat(300_000), ""));
    assert!(many.starts_with("t.ron:2:9: a texture of 300000 models (1 to 256)"), "{many}");
    let million = error(&with(&line("-0.5", 1.0, 1.0).repeat(1_000_000), ""));
    assert!(million.starts_with("t.ron: a texture of ") && million.contains("1048576"), "{million}");
    // Poles close together near the circle: stable, but louder than any sample can hold.
    let mut ar = [0.0; 21];
    ar[0] = 1.0;
    for _ in 0..20 {
        for i in (1..ar.len()).rev() {
            ar[i] -= 0.99 * ar[i - 1];
        }
    }
    let list: Vec<String> = ar[1..].iter().map(|x| format!("{x:?}")).collect();
    let loud = error(&with(&line(&list.join(", "), 1.0, 1.0), ""));
    assert!(loud.starts_with("t.ron:3:1:"), "{loud}");
    assert!(loud.contains("root mean square") || loud.contains("not stable"), "{loud}");
}

/// As many models as a file may have, with the most coefficients and the longest numbers, by the length of
/// a few of them.
#[test]
fn largest_texture_fits_into_a_file() {
    let file = |models: Vec<Model>| TextureFile {
        description: "d".into(),
        origin: "o".into(),
        texture: Texture::new(1000.0, models, None).unwrap(),
    };
    let long = |m| Model { variance: 1.234_567_890_123_456_7e-10, ..m };
    let models: Vec<Model> = drawn(3, 8, [MAX_ORDER, MAX_ORDER]).into_iter().map(long).collect();
    assert!(file(models).to_ron().unwrap().len() * MAX_MODELS / 8 < MAX_BYTES);
    let models = [drawn(3, MAX_MODELS, [1, 0]), drawn(4, 1, [1, 0])].concat();
    assert_eq!(file(models).to_ron().unwrap_err().to_string(), "a texture of 257 models (1 to 256)");
}
