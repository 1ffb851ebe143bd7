use asperity_dataset::{Expectation, Subject};
use asperity_world::material::{Library, VECTOR_LEN};
use asperity_world::tactile::Image;
use rayon::prelude::*;
use serde::Serialize;

use super::magnitudes::{Judge, Judged};
use super::statistics::Statistics;
use super::{Onnx, Written};
use crate::data::Data;
use crate::failure::Failure;

/// How often images of places that were held apart are given their material's name.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Naming {
    /// Images.
    pub images: usize,
    /// Names there are.
    pub classes: usize,
    /// Part that the classifier names rightly; none without its file.
    pub classifier: Option<f64>,
    /// Part whose nearest stored vector is their material's.
    pub vector: f64,
    /// Part that a linear classifier of plain image statistics names rightly.
    pub statistics: f64,
    /// Materials that the classifier names worst, or else the vectors: name, part named rightly, what they are taken for most often.
    pub worst: Vec<(String, f64, String)>,
}

/// Nearest neighbours of surfaces that were never trained on.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Strangers {
    /// Each of them.
    pub surfaces: Vec<Stranger>,
    /// Part of single images whose neighbour is of the right family.
    pub images_in_family: f64,
    /// The same of what a linear classifier of plain image statistics takes them for.
    pub statistics_in_family: f64,
    /// The same by chance.
    pub chance: f64,
}

/// A surface that was never trained on.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Stranger {
    /// Its name.
    pub name: String,
    /// Its family.
    pub family: String,
    /// The material nearest to the mean of its images' vectors, with its family.
    pub neighbour: (String, String),
    /// Mean |error| of magnitudes in dB: with the neighbour's vector, its own, and a blend of three neighbours'.
    pub nearest_db: f64,
    /// With its own vector.
    pub raw_db: f64,
    /// With a blend of the three nearest, by one over distance.
    pub blend_db: f64,
    /// With the vector of the trained material that is best of all: what no choice of neighbour can beat.
    pub best_db: f64,
}

/// Neighbours that are blended.
const BLENDED: usize = 3;

fn all<'a>(subjects: &'a [Subject], part: fn(&Subject) -> &Vec<Image>) -> Vec<(usize, &'a Image)> {
    subjects.iter().enumerate().flat_map(|(n, s)| part(s).iter().map(move |image| (n, image))).collect()
}

fn answers(onnx: &Onnx, images: &[(usize, &Image)]) -> Result<Vec<Vec<f32>>, Failure> {
    images.par_iter().map(|(_, image)| onnx.look(image)).collect()
}

/// Number of the largest.
fn largest(scores: &[f32]) -> usize {
    (0..scores.len()).max_by(|a, b| scores[*a].total_cmp(&scores[*b])).unwrap_or(0)
}

/// Numbers of a library's materials and their distances from a vector, nearest first.
fn neighbours(library: &Library, vector: &[f32]) -> Vec<(usize, f64)> {
    let away = |stored: &[f32; VECTOR_LEN]| {
        stored.iter().zip(vector).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt()
    };
    let mut all: Vec<(usize, f64)> =
        library.materials().iter().enumerate().map(|(n, m)| (n, away(&m.vector))).collect();
    all.sort_by(|a, b| a.1.total_cmp(&b.1));
    all
}

/// Judges names.
///
/// # Errors
/// What tract answers.
pub(super) fn naming(written: &Written, data: &Data) -> Result<Naming, Failure> {
    let held = all(&data.seen, |s| &s.images.held);
    let nearest: Vec<usize> = answers(&written.encoder, &held)?
        .iter()
        .map(|v| neighbours(&written.library, v).first().map_or(0, |(n, _)| *n))
        .collect();
    let named = match &written.classifier {
        Some(classifier) => Some(answers(classifier, &held)?.iter().map(|s| largest(s)).collect::<Vec<_>>()),
        None => None,
    };
    let rightly = |named: &[usize]| {
        held.iter().zip(named).filter(|((class, _), named)| class == *named).count() as f64 / held.len().max(1) as f64
    };
    let statistics = Statistics::trained(&all(&data.seen, |s| &s.images.train), data.seen.len());
    let by_statistics = statistics.names(&held);
    let judged = named.as_ref().unwrap_or(&nearest);
    let mut worst: Vec<(String, f64, String)> = data
        .seen
        .iter()
        .enumerate()
        .map(|(class, subject)| {
            let of: Vec<usize> =
                held.iter().zip(judged).filter(|((c, _), _)| *c == class).map(|(_, named)| *named).collect();
            let mut counts = vec![0_u32; data.seen.len()];
            of.iter().filter(|named| **named != class).for_each(|named| counts[*named] += 1);
            let most = (0..counts.len()).max_by_key(|n| counts[*n]).unwrap_or(0);
            let right = of.iter().filter(|named| **named == class).count() as f64 / of.len().max(1) as f64;
            (subject.name.clone(), right, data.seen[most].name.clone())
        })
        .collect();
    worst.sort_by(|a, b| a.1.total_cmp(&b.1));
    worst.truncate(10);
    worst.retain(|(_, right, _)| *right < 1.0);
    Ok(Naming {
        images: held.len(),
        classes: data.seen.len(),
        classifier: named.as_ref().map(|named| rightly(named)),
        vector: rightly(&nearest),
        statistics: rightly(&by_statistics),
        worst,
    })
}

/// Judges the neighbours of what was never trained on, whose true magnitudes are given.
///
/// # Errors
/// What tract answers.
pub(super) fn strangers(
    written: &Written,
    data: &Data,
    judge: &Judge<'_>,
    truths: Vec<Vec<Expectation>>,
) -> Result<Strangers, Failure> {
    let family = |s: &Subject| s.family.clone().unwrap_or_default();
    let families: Vec<String> = data.seen.iter().map(family).collect();
    let images = all(&data.unseen, |s| &s.images.train);
    let vectors = answers(&written.encoder, &images)?;
    let materials = written.library.materials();
    let near = |vector: &[f32]| neighbours(&written.library, vector);
    let part_in_family = |named: &mut dyn Iterator<Item = usize>| {
        let right = images.iter().zip(named).filter(|((s, _), named)| family(&data.unseen[*s]) == families[*named]).count();
        right as f64 / images.len().max(1) as f64
    };
    let images_in_family = part_in_family(&mut vectors.iter().map(|v| near(v).first().map_or(0, |(n, _)| *n)));
    let statistics = Statistics::trained(&all(&data.seen, |s| &s.images.train), data.seen.len());
    let statistics_in_family = part_in_family(&mut statistics.names(&images).into_iter());
    let of = |(number, (subject, truth)): (usize, (&Subject, Vec<Expectation>))| {
        let own: Vec<&Vec<f32>> =
            images.iter().zip(&vectors).filter(|((s, _), _)| *s == number).map(|(_, v)| v).collect();
        let raw: Vec<f32> =
            (0..VECTOR_LEN).map(|i| own.iter().map(|v| v[i]).sum::<f32>() / own.len().max(1) as f32).collect();
        let near = near(&raw);
        let (first, _) = near.first().copied().unwrap_or((0, 0.0));
        let judged = Judged::of(truth, judge.target);
        let mut best_db = f64::INFINITY;
        for material in materials {
            best_db = best_db.min(judge.error_db(material.vector.as_slice(), &judged)?);
        }
        Ok(Stranger {
            name: subject.name.clone(),
            family: family(subject),
            neighbour: (materials[first].name.clone(), families[first].clone()),
            nearest_db: judge.error_db(materials[first].vector.as_slice(), &judged)?,
            raw_db: judge.error_db(&raw, &judged)?,
            blend_db: judge.error_db(&blend(&written.library, &near[..BLENDED.min(near.len())]), &judged)?,
            best_db,
        })
    };
    let pairs: Vec<_> = data.unseen.iter().zip(truths).enumerate().collect();
    let surfaces = pairs.into_par_iter().map(of).collect::<Result<Vec<_>, Failure>>()?;
    let chance = data
        .unseen
        .iter()
        .map(|s| families.iter().filter(|f| **f == family(s)).count() as f64 / families.len().max(1) as f64)
        .sum::<f64>()
        / data.unseen.len().max(1) as f64;
    Ok(Strangers { surfaces, images_in_family, statistics_in_family, chance })
}

/// Vectors blended by one over their distance.
fn blend(library: &Library, near: &[(usize, f64)]) -> Vec<f32> {
    let weights: Vec<f64> = near.iter().map(|(_, away)| 1.0 / away.max(1e-9)).collect();
    let total: f64 = weights.iter().sum();
    let of = |i: usize| {
        near.iter().zip(&weights).map(|((n, _), w)| w / total * f64::from(library.materials()[*n].vector[i])).sum::<f64>() as f32
    };
    (0..VECTOR_LEN).map(of).collect()
}
