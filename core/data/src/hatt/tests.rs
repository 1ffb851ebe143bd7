//! Invented model sets in every form.

use super::*;
use crate::folder::write_picture as picture;
use asperity_autoregressive::line_spectrum;

/// Writes a model of a set.
type Part = fn(&[f64; 2], f64, f64) -> String;

const AR: [[f64; 2]; 4] = [[-1.2, 0.81], [-0.9, 0.7], [-0.4, 0.6], [0.1, 0.5]];
const PLACES: [[f64; 2]; 4] = [[20.0, 0.5], [200.0, 0.5], [20.0, 2.0], [200.0, 2.0]];

/// Numbers with a text between.
fn joined(numbers: &[f64], by: &str) -> String {
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(by)
}

/// Line spectral frequencies with a text between.
fn lsf(ar: &[f64], by: &str) -> String {
    joined(&line_spectrum::from_polynomial(ar).unwrap(), by)
}

fn set(head: &str, part: Part) -> String {
    let models: String = AR.iter().zip(PLACES).map(|(ar, [v, f])| part(ar, v, f)).collect();
    format!(
        "<?xml version=\"1.0\"?>\n<modelSet>\n<SampleRate>1000</SampleRate>\n{head}\n{models}</modelSet>\n"
    )
}

fn plain(ar: &[f64; 2], speed: f64, force: f64) -> String {
    let ar = joined(ar, " ");
    format!(
        "<model>\n<ARcoeff>{ar}</ARcoeff>\n<var>0.04</var>\n<gain>1.5</gain>\n<speedMod>{speed}</speedMod>\n\
         <forceMod>{force}</forceMod>\n</model>\n"
    )
}

fn texture(text: &str) -> Texture {
    parse(&Source::new("m.xml", text)).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn error(text: &str) -> String {
    parse(&Source::new("m.xml", text)).unwrap_err().to_string()
}

#[test]
fn more_models_than_a_tick_can_search_are_refused() {
    let set = |models: usize| {
        let all: String = (0..models).map(|n| plain(&AR[n % 4], n as f64, 0.5)).collect();
        format!("<modelSet><SampleRate>1000</SampleRate>{all}</modelSet>")
    };
    assert_eq!(texture(&set(256)).models().len(), 256);
    assert!(error(&set(257)).contains("a texture of 257 models"));
}

#[test]
fn every_shape_of_a_set_gives_the_same_models() {
    let want = texture(&set("", plain));
    assert_eq!((want.rate_hz(), want.models().len()), (1000.0, 4));
    assert_eq!(want.models()[1].ar, AR[1]);
    let elements: Part = |ar, v, f| {
        let (ar, lsf) = (joined(ar, "</value>\n<value>"), lsf(ar, "</value> <value>"));
        format!(
            "<model1><ARCOEFF><value>{ar}</value></ARCOEFF>\
             <arlsf> <value>{lsf}</value> </arlsf><MAcoeff/><var><value>0.04</value></var>\
             <gain>1.5</gain><speedMod>{v}</speedMod><forceMod> {f} </forceMod></model1>"
        )
    };
    let attributes: Part = |ar, v, f| {
        let (ar, lsf) = (joined(ar, ", "), lsf(ar, " "));
        format!(
            "<Model ARcoeff=\"1, {ar}\" ARlsf='{lsf}' Var='0.04' gain='1.5' speedMod='{v}' forceMod='{f}'/>"
        )
    };
    let values: Part = |ar, v, f| {
        let [a, b] = ar;
        format!(
            "<m><ARcoeff value='{a}'/><ARcoeff><c value='{b}'/></ARcoeff><var value='0.04'/>\
             <gain value='1.5'/><speedMod value='{v}'/><forceMod value='{f}'/></m>"
        )
    };
    // The other sign; the frequencies tell.
    let turned: Part = |ar, v, f| {
        let (ar, lsf) = (joined(&ar.map(|a| -a), ";"), lsf(ar, " "));
        format!(
            "<m><ARcoeff>{ar}</ARcoeff><ARlsf>{lsf}</ARlsf><var>0.04</var><gain>1.5</gain>\
             <speedMod>{v}</speedMod><forceMod>{f}</forceMod></m>"
        )
    };
    let head = "<numMod>4</numMod><other>words</other>";
    for part in [elements, attributes, values, turned] {
        assert_eq!(texture(&set(head, part)).models(), want.models());
    }
    let listed: Part =
        |ar, _, _| format!("<m><ARcoeff>{}</ARcoeff><var>0.04</var><gain>1.5</gain></m>", joined(ar, " "));
    let lists = "<speedList>20 200 20 200</speedList><forceList>0.5 0.5 2 2</forceList>";
    assert_eq!(texture(&set(lists, listed)).models(), want.models());
}

#[test]
fn frequencies_alone_and_moving_averages_are_read() {
    let part: Part = |ar, v, f| {
        let (ar, ma) = (lsf(ar, " "), lsf(&[0.5], " "));
        format!(
            "<m><ARlsf>{ar}</ARlsf><MAcoeff>1 0.5</MAcoeff><MAlsf>{ma}</MAlsf><var>0.04</var>\
             <speedMod>{v}</speedMod><forceMod>{f}</forceMod></m>"
        )
    };
    let read = texture(&set("", part));
    for (m, ar) in read.models().iter().zip(AR) {
        assert!(m.ar.iter().zip(ar).all(|(x, y)| (x - y).abs() < 1e-12));
        assert_eq!((m.ma.as_slice(), m.gain), ([0.5].as_slice(), 1.0));
    }
}

#[test]
fn triangles_are_read_by_rows_and_by_columns_and_else_made() {
    let corners = |head: &str| {
        let mut all: Vec<[usize; 3]> = texture(&set(head, plain)).triangles().corners().to_vec();
        all.iter_mut().for_each(|t| t.sort_unstable());
        all.sort_unstable();
        all
    };
    // Cut along one diagonal, then the other.
    let (one, other) = (vec![[0, 1, 2], [1, 2, 3]], vec![[0, 1, 3], [0, 2, 3]]);
    assert_eq!(corners("<tri><value>1 2 3</value><value>2 4 3</value></tri>"), one);
    assert_eq!(corners("<tri>1 2 4, 1 4 3</tri>"), other);
    assert_eq!(corners("<tri>1 1 2 4 4 3</tri>"), other, "columns 1 1, 2 4, 4 3");
    assert_eq!(corners("<tri>1 2 3</tri>").len(), 2, "one does not tile the square");
    assert_eq!(corners("").len(), 2);
}

#[test]
fn bad_sets_are_refused_at_the_element() {
    let good = set("", plain);
    let without = |what: &str, by: &str| {
        assert!(good.contains(what), "{what}");
        error(&good.replacen(what, by, 1))
    };
    for (found, want) in [
        (error("<modelSet>\n<a></b>"), "m.xml:2:4: not an XML file"),
        (error("<a/>"), "m.xml:1:1: no `modelSet`"),
        (without("<SampleRate>1000</SampleRate>", ""), "m.xml:2:1: `SampleRate` is missing"),
        (without("1000", "1000 2000"), "m.xml:3:1: `SampleRate` holds 2 numbers, not one"),
        (without("1000", "1e9 Hz"), "m.xml:3:17: `Hz` in `SampleRate` is not a number"),
        (error(&set("<numMod>5</numMod>", plain)), "m.xml:2:1: `numMod` is 5, and there are 4 models"),
        (without("<var>0.04</var>", ""), "m.xml:5:1: `var` is missing"),
        (without("<var>0.04</var>", "<var>-1</var>"), "m.xml:5:1: the variance of a model is -1"),
        (without("<speedMod>20</speedMod>", "<speedMod>NaN</speedMod>"), "m.xml:9:11: `NaN` in `speedMod`"),
        (without("-1.2 0.81", "-2.2 1.21"), "m.xml:5:1: the autoregressive part of a model is not stable"),
        (without("-1.2 0.81", "-0.5"), "m.xml:2:1: model 2: 2 and 0 coefficients"),
        (
            error(&set("<tri>1 2 5</tri>", plain)),
            "m.xml:4:1: the corner 5 in `tri` is not the number of a model (1 to 4)",
        ),
        (error(&set("<tri>1 2 0</tri>", plain)), "m.xml:4:1: the corner 0 in"),
        (error(&set("<tri>1 2</tri>", plain)), "m.xml:4:1: `tri` holds 2 corners"),
        (
            without("<ARcoeff>", "<ARlsf>0.5 0.4</ARlsf><ARcoeff>"),
            "m.xml:6:1: `ARlsf` are not line spectral frequencies",
        ),
        (
            without("<ARcoeff>", "<ARlsf>1.5 2.9</ARlsf><ARcoeff>"),
            "m.xml:6:23: `ARcoeff` and `ARlsf` are not of one filter",
        ),
        (without("<ARcoeff>", "<ARlsf>1 2 3</ARlsf><ARcoeff>"), "m.xml:6:21: `ARcoeff` holds 2 numbers, and"),
        (error("<modelSet><SampleRate>1</SampleRate></modelSet>"), "m.xml:1:1: a texture without models"),
    ] {
        assert!(found.starts_with(want), "{found}\nwanted {want}");
    }
}

/// One entity of 100 kB, referenced 20,000 times, took 3.9 GB.
#[test]
fn entities_of_a_file_are_refused_at_the_first() {
    let text = format!("<!DOCTYPE modelSet\n[<!ENTITY e \"{}\">]>\n<modelSet>", "0.5 ".repeat(25_000));
    let found = error(&(text + &"&e;".repeat(20_000) + "</modelSet>"));
    assert!(found.starts_with("m.xml:2:2: an XML file that defines entities is not read"), "{found}");
}

/// A white model: `E|A|^2 = 6 / N var gain^2` in every bin.
fn white(ar: &[f64; 2], speed: f64, force: f64) -> String {
    plain(ar, speed, force).replace(&joined(ar, " "), "0")
}

#[test]
fn folder_gives_closed_form_and_own_pictures_per_material() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir_all(at("photographs")).unwrap();
    std::fs::write(at("Models_Paper.xml"), set("", white)).unwrap();
    std::fs::write(at("Paper_Plate.XML"), set("", plain)).unwrap();
    std::fs::write(at("Data_Paper.xml"), "<recording>not well formed").unwrap();
    std::fs::write(at(".hidden.xml"), "<modelSet>").unwrap();
    picture(&at("photographs/Paper 1.png"), 40);
    picture(&at("photographs/Image_Paper 2.png"), 80);
    picture(&at("photographs/Paper-Plate.png"), 120);
    picture(&at("photographs/Cork.png"), 200);
    let settings = Settings { examples: [300, 60], seed: 9 };
    let subjects = read(folder.path(), &settings).unwrap();
    let names: Vec<&str> = subjects.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["Paper", "Paper Plate"]);
    let greys = |s: &Subject| {
        let of = |images: &[asperity_texture::picture::Image]| {
            images.iter().map(|i| i.pixels[0]).collect::<Vec<_>>()
        };
        (of(&s.images.train), of(&s.images.held))
    };
    // `Image_Paper 2` sorts before `Paper 1`.
    assert_eq!(greys(&subjects[0]), (vec![80], vec![40]));
    assert_eq!(greys(&subjects[1]), (vec![120], vec![]));
    let (train, held) = (&subjects[0].examples.train, &subjects[0].examples.held);
    assert_eq!((train.len(), held.len(), subjects[0].truth), (300, 60, Truth::Rms));
    // Only examples without any touch may be equal.
    assert!(held.iter().filter(|h| h.force != [0.0; 10]).all(|h| !train.contains(h)));

    let full = (6.0f32 / 100.0 * 0.04 * 1.5 * 1.5).sqrt();
    let (mut steady, mut partly, mut silent) = (0, 0, 0);
    for e in train {
        assert!(e.magnitudes[50..].iter().all(|m| *m == 0.0), "nothing above half the rate");
        assert!(e.magnitudes[..50].iter().all(|m| (m - e.magnitudes[0]).abs() < 1e-6 && *m < full + 1e-6));
        // If each moment clearly touches or not, the weights tell the remaining part of the power.
        let moves = |i: usize| e.velocity[i].hypot(e.velocity[i + 10]) > 5.0;
        if (0..10).all(|i| e.force[i] == 0.0 || moves(i)) {
            let part: f32 = (0..10).filter(|i| e.force[*i] > 0.0).map(|i| 2.0 * (i + 1) as f32 / 110.0).sum();
            assert!((e.magnitudes[0] - full * part.sqrt()).abs() < 1e-6, "{e:?}");
            partly += usize::from(part > 0.0 && part < 0.999);
            steady += usize::from(part > 0.999);
        }
        if e.force == [0.0; 10] {
            silent += 1;
            assert_eq!(e.magnitudes, [0.0; BINS]);
        }
    }
    assert!(steady > 100 && partly > 20 && silent > 5, "{steady} {partly} {silent}");
    assert_eq!(subjects, read(folder.path(), &settings).unwrap());
    let other = read(folder.path(), &Settings { seed: 10, ..settings }).unwrap();
    assert_ne!(subjects[0].examples, other[0].examples);
}

#[test]
fn folders_that_will_not_do_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let fails = |want: &str| {
        let found = read(folder.path(), &Settings::default()).unwrap_err().to_string();
        assert!(found.contains(want), "{found}");
    };
    fails("no model sets in this folder");
    std::fs::write(folder.path().join("Cork.xml"), set("", plain)).unwrap();
    fails("no picture of this material");
    std::fs::create_dir(folder.path().join("10 kHz")).unwrap();
    std::fs::write(folder.path().join("10 kHz/models_cork.xml"), set("", plain)).unwrap();
    fails("a second material of the name of");
    std::fs::remove_file(folder.path().join("10 kHz/models_cork.xml")).unwrap();
    std::fs::write(folder.path().join("Bark.xml"), "\n").unwrap();
    fails("this file is empty");
    let loud = set("", plain).replacen("<gain>1.5", "<gain>1e30", 1);
    std::fs::write(folder.path().join("Bark.xml"), loud).unwrap();
    fails("the noise of this model comes to 2e29 m/s^2");
    assert!(read(&folder.path().join("none"), &Settings::default()).is_err());
}

#[test]
fn xml_of_20000_attributes_is_refused_at_once() {
    let attributes: String = (0..20_000).map(|i| format!(" a{i}=\"1\"")).collect();
    let began = std::time::Instant::now();
    let said = error(&format!("<modelSet{attributes}/>"));
    assert!(said.contains("an element of very many attributes (at most 1000 are read)"), "{said}");
    assert!(began.elapsed().as_secs_f64() < 0.1, "{:?}", began.elapsed());
}
