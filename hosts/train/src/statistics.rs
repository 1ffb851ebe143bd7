//! Statistics of an encoder's features over its training pictures, and how well they tell other pictures.

use std::path::{Path, PathBuf};

use asperity_data::made;
use asperity_diagnostics::{Diagnostic, Source, file, fnv};
use asperity_numbers::Random;
use asperity_surfaces::tactile::Camera;
use asperity_surfaces::topography::MadeSurface;
use asperity_texture::picture::{self, IMAGE, Image, Quality};
use asperity_texture::statistics::{Layer, PICTURE, Statistics};
use asperity_texture::{Channels, Encoder, MAX_ENCODER_BYTES};
use clap::Args;
use rayon::prelude::*;

use crate::Failure;
use crate::data::{self, Origin, made_settings};
use crate::files::write_whole;
use crate::training::{settings_now, settings_of};

/// Pictures of a piece of a made surface.
const IMAGES: usize = 3;
/// Pieces to fit to, at most.
const PIECES: usize = 4;
/// A limit is [`MARGIN`] times the distance that this part of the pictures held out for calibration exceeds.
/// The margin is for other files than those: JPEG brings a shipped picture to 1.39 times that distance.
const EXCEED: f64 = 0.01;
const MARGIN: f64 = 1.5;
/// Axes of a layer, at most.
const AXES: usize = 20;
/// Least deviation of a feature over the largest one: dead channels must not decide.
const LEAST_DEVIATION: f64 = 0.01;
/// Other cameras see one surface in this many.
const OTHERS_EVERY: usize = 5;

/// Arguments of statistics.
#[derive(Args, Clone, Debug)]
pub(crate) struct FindStatistics {
    /// The model's folder.
    pub folder: PathBuf,
    /// Present place of the data if they have moved: `hatt:FOLDER` or `recordings:FOLDER`.
    #[arg(long, value_name = "SOURCE")]
    pub data: Option<Origin>,
    /// Folder of other pictures to judge by the statistics; repeatable.
    #[arg(long, value_name = "FOLDER")]
    pub also: Vec<PathBuf>,
}

/// Features of a picture in each layer, and whether its quality is refused.
#[derive(Clone)]
struct Look {
    features: Vec<Vec<f64>>,
    refused: bool,
}

/// A material's pictures: to fit, to calibrate, to judge.
struct Material {
    family: String,
    parts: [Vec<Look>; 3],
}

/// Fits, calibrates and writes the statistics of a model's encoder, and prints their rates.
pub(crate) fn find(asked: &FindStatistics) -> Result<(), Failure> {
    let settings = settings_now(&asked.folder, &settings_of(&asked.folder)?, asked.data.as_ref())?;
    let path = asked.folder.join("encoder.onnx");
    let bytes = file::read(&path, MAX_ENCODER_BYTES)?;
    // Deeper layers told no more, and took two of three pictures of a family that was left out for unlike.
    let layers: Vec<Channels> = vec![("image.0.relu".to_owned(), settings.preset.channels()[0])];
    let names: Vec<String> =
        std::iter::once(PICTURE.to_owned()).chain(layers.iter().map(|l| l.0.clone())).collect();
    let encoder = Encoder::with_layers(&bytes, &path, layers)?;
    let look = |image: &Image| -> Result<Look, Diagnostic> {
        let refused = Quality::of(image).fault().is_some();
        Ok(Look { features: encoder.look(image)?.features, refused })
    };
    let all = |images: &[Image]| images.iter().map(look).collect::<Result<Vec<Look>, Diagnostic>>();

    let made = made::Settings { images: IMAGES, ..made_settings(&settings) };
    let [train, held] = made.pieces;
    let pieces = |surface: &MadeSurface, pieces| all(&made::pictures(surface, &made, pieces, |_| {}));
    let surfaces = made::surfaces(settings.every as usize);
    let mut materials = Vec::new();
    if settings.data == Origin::Made {
        for (surfaces, fitted) in surfaces.iter().zip([train.min(PIECES), 0]) {
            let of = |surface: &MadeSurface| {
                let middle = train + held / 2;
                let parts = [0..fitted, train..middle, middle..train + held];
                let [fit, calibrate, judge] = parts.map(|part| pieces(surface, part));
                let family = surface.family.name().to_owned();
                Ok(Material { family, parts: [fit?, calibrate?, judge?] })
            };
            materials.extend(surfaces.par_iter().map(of).collect::<Result<Vec<_>, Diagnostic>>()?);
        }
    } else {
        let data = data::load(&settings)?;
        for (subjects, fits) in [(&data.seen, true), (&data.unseen, false)] {
            for subject in subjects {
                let (calibrate, judge) = subject.images.held.split_at(subject.images.held.len() / 2);
                let fit = if fits { &subject.images.train[..] } else { &[] };
                let family = subject.family.clone().unwrap_or_default();
                materials.push(Material { family, parts: [all(fit)?, all(calibrate)?, all(judge)?] });
            }
        }
    }
    let everyone: Vec<&Material> = materials.iter().collect();
    let fitted = Statistics { encoder: fnv(&bytes), layers: fit(&names, &everyone) };
    let text = fitted.to_ron();
    let beside = Statistics::beside(&path);
    // What is judged is what is read.
    let statistics = Statistics::parse(&Source::new(&beside, text.as_str()), &bytes)?;
    println!("| pictures | number | refused | unlike | both |\n|---|---|---|---|---|");
    let judged = |of: &[&Material]| -> Vec<Look> { of.iter().flat_map(|m| m.parts[2].clone()).collect() };
    let (seen, unseen): (Vec<&Material>, Vec<&Material>) =
        everyone.iter().partition(|m| !m.parts[0].is_empty());
    row("held out", &statistics.layers, &judged(&seen));
    row("of materials never trained on", &statistics.layers, &judged(&unseen));
    let mut families: Vec<&str> = materials.iter().map(|m| m.family.as_str()).collect();
    families.dedup();
    families.sort_unstable();
    families.dedup();
    let mut left_out = Vec::new();
    for family in &families {
        let (of, others): (Vec<&Material>, Vec<&Material>) =
            everyone.iter().partition(|m| m.family == *family);
        if others.iter().any(|m| !m.parts[0].is_empty()) {
            let layers = fit(&names, &others);
            let judged = judged(&of);
            row(&format!("of the family {family}, left out"), &layers, &judged);
            let unlike = judged.iter().filter(|look| strangeness(&layers, look) > 1.0).count();
            left_out.push(unlike as f64 / judged.len().max(1) as f64);
        }
    }
    let mean = left_out.iter().sum::<f64>() / left_out.len().max(1) as f64;
    println!("| mean of families, left out | | | {:.1} % | |", 100.0 * mean);
    if settings.data == Origin::Made {
        let surfaces: Vec<&MadeSurface> = surfaces[0].iter().step_by(OTHERS_EVERY).collect();
        for (name, vary, change) in SENSORS {
            let of = |surface: &&MadeSurface| {
                let mut images = made::pictures(surface, &made, train + held - 1..train + held, vary);
                images.iter_mut().for_each(change);
                all(&images)
            };
            row(
                name,
                &statistics.layers,
                &surfaces.par_iter().map(of).collect::<Result<Vec<_>, _>>()?.concat(),
            );
        }
    }
    for (name, draw) in DRAWN {
        let random = &mut Random::new(settings.seed);
        let images: Vec<Image> = (0..32).map(|_| draw(random)).collect();
        row(name, &statistics.layers, &all(&images)?);
    }
    for folder in &asked.also {
        row(&folder.display().to_string(), &statistics.layers, &all(&pictures_in(folder)?)?);
    }
    write_whole(&beside, text.as_bytes())?;
    eprintln!("wrote {}", beside.display());
    Ok(())
}

/// Prints a row of the table.
fn row(name: &str, layers: &[Layer], looks: &[Look]) {
    let part = |of: &dyn Fn(&Look) -> bool| {
        100.0 * looks.iter().filter(|look| of(look)).count() as f64 / looks.len().max(1) as f64
    };
    let unlike = |look: &Look| strangeness(layers, look) > 1.0;
    let [refused, unlike, both] =
        [part(&|look| look.refused), part(&unlike), part(&|look| look.refused || unlike(look))];
    println!("| {name} | {} | {refused:.1} % | {unlike:.1} % | {both:.1} % |", looks.len());
}

/// Largest distance of a picture over its layer's limit.
fn strangeness(layers: &[Layer], look: &Look) -> f64 {
    let ratios = layers.iter().zip(&look.features).map(|(layer, x)| layer.distance(x) / layer.limit);
    ratios.fold(0.0, f64::max)
}

/// Layers fitted to the first parts of materials, with limits calibrated on the second parts.
fn fit(names: &[String], materials: &[&Material]) -> Vec<Layer> {
    let fitted: Vec<&[Look]> = materials.iter().map(|m| &m.parts[0][..]).filter(|p| !p.is_empty()).collect();
    let features = |number: usize| -> Vec<Vec<&[f64]>> {
        fitted.iter().map(|looks| looks.iter().map(|look| &look.features[number][..]).collect()).collect()
    };
    // A centre for each material tells more of the picture itself. In the encoder one centre for all told as
    // much as many.
    let layer = |(number, name): (usize, &String)| fit_layer(name, &features(number), name == PICTURE);
    let mut layers: Vec<Layer> = names.iter().enumerate().map(layer).collect();
    let looks: Vec<&Look> = materials.iter().flat_map(|m| &m.parts[1]).collect();
    let quantile = |mut all: Vec<f64>| {
        all.sort_by(f64::total_cmp);
        all.get(((1.0 - EXCEED) * all.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(1.0)
    };
    for (number, layer) in layers.iter_mut().enumerate() {
        layer.limit = quantile(looks.iter().map(|look| layer.distance(&look.features[number])).collect());
    }
    // All layers together keep the rate.
    let factor = MARGIN * quantile(looks.iter().map(|look| strangeness(&layers, look)).collect());
    layers.iter_mut().for_each(|layer| layer.limit *= factor);
    layers
}

/// A layer fitted to the features of each material's pictures, without a limit yet.
fn fit_layer(name: &str, materials: &[Vec<&[f64]>], centred: bool) -> Layer {
    let all: Vec<&[f64]> = materials.iter().flatten().copied().collect();
    let len = all.first().map_or(0, |x| x.len());
    let mean_of = |rows: &[Vec<f64>]| -> Vec<f64> {
        (0..len).map(|i| rows.iter().map(|x| x[i]).sum::<f64>() / rows.len().max(1) as f64).collect()
    };
    let owned: Vec<Vec<f64>> = all.iter().map(|x| x.to_vec()).collect();
    let mean = mean_of(&owned);
    let square =
        |i: usize| owned.iter().map(|x| (x[i] - mean[i]).powi(2)).sum::<f64>() / owned.len().max(1) as f64;
    let mut deviation: Vec<f64> = (0..len).map(|i| square(i).sqrt()).collect();
    let most = deviation.iter().copied().fold(1e-6, f64::max);
    deviation.iter_mut().for_each(|d| *d = d.max(LEAST_DEVIATION * most));
    let mut layer = Layer {
        name: name.to_owned(),
        limit: 1.0,
        mean,
        deviation,
        rest: 1.0,
        axes: Vec::new(),
        centres: vec![vec![0.0; len]],
    };
    let scaled: Vec<Vec<Vec<f64>>> =
        materials.iter().map(|m| m.iter().map(|x| layer.scaled(x)).collect()).collect();
    let centres: Vec<Vec<f64>> = scaled.iter().map(|m| mean_of(m)).collect();
    let mut covariance = vec![0.0; len * len];
    for (rows, centre) in scaled.iter().zip(&centres) {
        for row in rows {
            let apart: Vec<f64> =
                row.iter().zip(centre).map(|(x, c)| if centred { x - c } else { *x }).collect();
            for i in 0..len {
                for j in 0..len {
                    covariance[i * len + j] += apart[i] * apart[j] / all.len() as f64;
                }
            }
        }
    }
    if centred {
        layer.centres = centres;
    }
    let mut axes = principal(covariance, len);
    let kept = AXES.min(len.saturating_sub(1));
    let others = axes.split_off(kept);
    layer.rest = (others.iter().map(|(v, _)| v).sum::<f64>() / others.len().max(1) as f64).max(1e-6);
    layer.axes = axes.into_iter().map(|(v, axis)| (v.max(1e-6), axis)).collect();
    layer
}

/// Variances and axes of a covariance, largest first, by Jacobi's rotations.
fn principal(mut a: Vec<f64>, len: usize) -> Vec<(f64, Vec<f64>)> {
    let mut axes: Vec<f64> = (0..len * len).map(|i| f64::from(i / len == i % len)).collect();
    const SWEEPS: usize = 30;
    for _ in 0..SWEEPS {
        for p in 0..len {
            for q in p + 1..len {
                let off = a[p * len + q];
                if off.abs() < 1e-12 {
                    continue;
                }
                let theta = (a[q * len + q] - a[p * len + p]) / (2.0 * off);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = (t * t + 1.0).sqrt().recip();
                let s = t * c;
                let turn = |m: &mut [f64], i: usize, j: usize| {
                    (m[i], m[j]) = (c * m[i] - s * m[j], s * m[i] + c * m[j]);
                };
                for k in 0..len {
                    turn(&mut a, k * len + p, k * len + q);
                }
                for k in 0..len {
                    turn(&mut a, p * len + k, q * len + k);
                    turn(&mut axes, p * len + k, q * len + k);
                }
            }
        }
    }
    let mut all: Vec<(f64, Vec<f64>)> =
        (0..len).map(|i| (a[i * len + i], axes[i * len..][..len].to_vec())).collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    all
}

/// All pictures of a folder and of the folders within.
fn pictures_in(folder: &Path) -> Result<Vec<Image>, Diagnostic> {
    let fail = |e: std::io::Error| Diagnostic::new(format!("cannot read this folder: {e}")).in_file(folder);
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder)
        .and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect())
        .map_err(fail)?;
    paths.sort();
    let mut images = Vec::new();
    for path in paths {
        let picture = path.extension().is_some_and(|e| ["png", "jpg", "jpeg", "bmp"].iter().any(|p| e == *p));
        if path.is_dir() {
            images.extend(pictures_in(&path)?);
        } else if picture {
            images.push(picture::read(&path)?.image);
        }
    }
    Ok(images)
}

/// A sensor other than those trained on: its name, its camera, and a change of its pictures.
type Sensor = (&'static str, fn(&mut Camera), fn(&mut Image));

const SENSORS: [Sensor; 14] = [
    ("lights turned by 30 degrees", |c| c.turn += 0.52, |_| {}),
    ("lights turned by 60 degrees", |c| c.turn += 1.05, |_| {}),
    ("red and blue swapped", |_| {}, |image| pixels(image).for_each(|p| p.swap(0, 2))),
    ("one light, grey", |_| {}, |image| pixels(image).for_each(|p| p.fill(p[0]))),
    (
        "half as bright",
        |c| (c.light, c.ambient) = (c.light.map(|x| 0.5 * x), c.ambient.map(|x| 0.5 * x)),
        |_| {},
    ),
    (
        "twice as bright",
        |c| (c.light, c.ambient) = (c.light.map(|x| 2.0 * x), c.ambient.map(|x| 2.0 * x)),
        |_| {},
    ),
    ("uneven light", |c| (c.fall, c.near) = (0.8, 0.5), |_| {}),
    ("0.02 mm a pixel", |c| c.pixel_mm = 0.02, |_| {}),
    ("0.08 mm a pixel", |c| c.pixel_mm = 0.08, |_| {}),
    ("noise of 0.03", |c| c.noise = 0.03, |_| {}),
    ("noise of 0.08", |c| c.noise = 0.08, |_| {}),
    ("lens blurs by 0.12 mm", |c| c.blur_mm = 0.12, |_| {}),
    ("marker dots", |_| {}, dotted),
    ("blurred by 2 pixels", |_| {}, blurred),
];

fn pixels(image: &mut Image) -> impl Iterator<Item = &mut [u8]> {
    image.pixels.chunks_exact_mut(3)
}

/// Prints black dots of 6 pixels, 24 apart.
fn dotted(image: &mut Image) {
    for (at, pixel) in image.pixels.chunks_exact_mut(3).enumerate() {
        let [x, y] = [at % IMAGE[1], at / IMAGE[1]].map(|i| (i % 24) as f64 - 12.0);
        if x * x + y * y < 9.0 {
            pixel.iter_mut().for_each(|v| *v /= 6);
        }
    }
}

/// Blurs by a deviation of 2 pixels: eight times by the weights 1/4, 1/2, 1/4 both ways.
fn blurred(image: &mut Image) {
    let [rows, columns] = IMAGE;
    let mut levels: Vec<f64> = image.pixels.iter().map(|x| f64::from(*x)).collect();
    for (stride, len) in [(3, columns), (3 * columns, rows)] {
        for _ in 0..8 {
            let before = levels.clone();
            for (at, level) in levels.iter_mut().enumerate() {
                let place = at / stride % len;
                let next = if place + 1 < len { at + stride } else { at };
                let last = if place > 0 { at - stride } else { at };
                *level = 0.25 * before[last] + 0.5 * before[at] + 0.25 * before[next];
            }
        }
    }
    image.pixels.iter_mut().zip(levels).for_each(|(p, x)| *p = x.round() as u8);
}

/// Pictures that no tactile sensor takes.
type Drawn = (&'static str, fn(&mut Random) -> Image);

const DRAWN: [Drawn; 4] = [
    ("colour gradients", gradient),
    ("white noise", noise),
    ("screens", screen),
    ("overlapping discs", discs),
];

fn drawn(mut colour: impl FnMut(f64, f64) -> [f64; 3]) -> Image {
    let [rows, columns] = IMAGE;
    let all = (0..rows * columns).flat_map(|at| colour((at % columns) as f64, (at / columns) as f64));
    Image { size: IMAGE, pixels: all.map(|x| x.clamp(0.0, 255.0).round() as u8).collect() }
}

fn any_colour(random: &mut Random) -> [f64; 3] {
    [(); 3].map(|()| random.range(0.0, 255.0))
}

/// From one colour to another, with a camera's noise.
fn gradient(random: &mut Random) -> Image {
    let (from, to, turn) = (any_colour(random), any_colour(random), random.range(0.0, 1.0));
    drawn(|x, y| {
        let part = turn * x / 256.0 + (1.0 - turn) * y / 192.0;
        std::array::from_fn(|i| from[i] + part * (to[i] - from[i]) + 1.5 * random.normal())
    })
}

fn noise(random: &mut Random) -> Image {
    let level = random.range(5.0, 80.0);
    drawn(|_, _| [(); 3].map(|()| 128.0 + level * random.normal()))
}

/// Windows with lines of text.
fn screen(random: &mut Random) -> Image {
    let windows: Vec<([f64; 4], [f64; 3], [f64; 3])> = (0..6)
        .map(|_| {
            let [x, y] = [random.range(-40.0, 200.0), random.range(-40.0, 150.0)];
            let size = [x, y, x + random.range(60.0, 200.0), y + random.range(40.0, 150.0)];
            (size, any_colour(random), any_colour(random))
        })
        .collect();
    let seed = random.bits();
    drawn(|x, y| {
        let over = windows.iter().rev().find(|([l, t, r, b], ..)| x >= *l && x < *r && y >= *t && y < *b);
        let Some(([left, top, ..], paper, ink)) = over else { return [236.0; 3] };
        let (column, row) = (((x - left) / 3.0) as u64, ((y - top) / 9.0) as u64);
        let letter = Random::new(seed ^ (row << 20) ^ column).chance(0.6) && (y - top) % 9.0 < 5.0;
        if letter { *ink } else { *paper }
    })
}

/// Discs of all sizes over each other, as things in photographs are (Lee, Mumford, Huang 2001).
fn discs(random: &mut Random) -> Image {
    let discs: Vec<([f64; 3], [f64; 3])> = (0..600)
        .map(|_| {
            let radius = 3.0 / (1.0 - 0.99 * random.unit()).sqrt();
            ([random.range(0.0, 256.0), random.range(0.0, 192.0), radius], any_colour(random))
        })
        .collect();
    drawn(|x, y| {
        let over =
            discs.iter().find(|([u, v, radius], _)| (x - u).powi(2) + (y - v).powi(2) < radius * radius);
        over.map_or([128.0; 3], |(_, colour)| *colour)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn principal_axes_of_a_known_covariance() {
        // Variances 5 and 1 along the diagonals of the first two, 2 along the third.
        let found = principal(vec![3.0, 2.0, 0.0, 2.0, 3.0, 0.0, 0.0, 0.0, 2.0], 3);
        for ((variance, axis), (wanted, along)) in
            found.iter().zip([(5.0, [1.0, 1.0, 0.0]), (2.0, [0.0, 0.0, 1.0]), (1.0, [1.0, -1.0, 0.0])])
        {
            let dot = axis.iter().zip(along).map(|(a, b)| a * b).sum::<f64>();
            let length = along.iter().map(|x| x * x).sum::<f64>().sqrt();
            assert!((variance - wanted).abs() < 1e-9 && (dot.abs() - length).abs() < 1e-9, "{found:?}");
        }
    }

    #[test]
    fn few_calibration_pictures_are_unlike() {
        let random = &mut Random::new(4);
        let mut look = |from: f64| Look {
            features: vec![vec![from + random.normal(), random.normal()]],
            refused: false,
        };
        let material = |look: &mut dyn FnMut(f64) -> Look, from: f64| {
            let mut some = |count: usize| (0..count).map(|_| look(from)).collect::<Vec<_>>();
            Material { family: String::new(), parts: [some(200), some(500), some(0)] }
        };
        let materials = [material(&mut look, 0.0), material(&mut look, 30.0)];
        let layers = fit(&[PICTURE.to_owned()], &materials.iter().collect::<Vec<_>>());
        let looks = materials.iter().flat_map(|m| &m.parts[1]);
        let unlike = looks.filter(|look| strangeness(&layers, look) > 1.0).count();
        assert!(unlike <= 4, "{unlike}");
        // Between the two centres there is nothing.
        let between = Look { features: vec![vec![15.0, 0.0]], refused: false };
        assert!(strangeness(&layers, &between) > 2.0);
    }
}
