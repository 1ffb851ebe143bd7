use asperity_data::{Expectation, Subject};
use asperity_texture::Encoder;
use asperity_texture::picture::Image;
use asperity_texture::{Assignment, BLENDED, Library, VECTOR_LEN};
use burn::tensor::Device;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::magnitudes::{Judge, Judged};
use super::statistics::Statistics;
use super::{Written, average};
use crate::Failure;
use crate::data::Data;
use crate::stages::mean_vector;

/// Accuracy of names for images of held-out places.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Naming {
    pub images: usize,
    pub classes: usize,
    /// Part named right by the classifier; none without its file.
    pub classifier: Option<f64>,
    /// Whether this is an earlier figure of the classifier, on the same images and vectors.
    #[serde(default)]
    pub judged_earlier: bool,
    /// Part with their own material's vector nearest.
    pub vector: f64,
    /// Part named right by a linear classifier of plain image statistics.
    pub statistics: f64,
    /// Materials with most errors of the classifier, or else of the vectors: name, part named right,
    /// most frequent wrong name.
    pub worst: Vec<(String, f64, String)>,
}

/// Nearest neighbours of surfaces that were never trained on.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Strangers {
    pub surfaces: Vec<Stranger>,
    pub families: Option<Families>,
}

/// Accuracy of the nearest material's family.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Families {
    /// Part of surfaces, by the mean of their images' vectors.
    pub surfaces: f64,
    pub images: f64,
    /// Part of images that the linear classifier of plain statistics gives a material of the right
    /// family.
    pub statistics: f64,
    pub chance: f64,
}

/// A surface that was never trained on.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Stranger {
    pub name: String,
    pub family: Option<String>,
    /// The material nearest to the mean of its images' vectors, with its family.
    pub neighbour: (String, Option<String>),
    /// Mean |error| of magnitudes in dB with its neighbour's vector, each of some images alone. None if
    /// nothing could be judged.
    pub nearest_db: Option<f64>,
    /// With the image's own vector.
    pub raw_db: Option<f64>,
    /// With a blend of the nearest, by one over distance.
    pub blend_db: Option<f64>,
    /// With the best vector of any trained material: a bound for every choice of neighbour.
    pub best_db: Option<f64>,
}

pub(crate) const ALONE: usize = 8;

fn all(subjects: &[Subject], part: fn(&Subject) -> &Vec<Image>) -> Vec<(usize, &Image)> {
    subjects.iter().enumerate().flat_map(|(n, s)| part(s).iter().map(move |image| (n, image))).collect()
}

fn vectors(encoder: &Encoder, images: &[(usize, &Image)]) -> Result<Vec<[f32; VECTOR_LEN]>, Failure> {
    Ok(images.par_iter().map(|(_, image)| encoder.encode(image)).collect::<Result<_, _>>()?)
}

/// The baseline, trained on the model's training data.
pub(super) fn statistics(data: &Data) -> Statistics {
    Statistics::trained(&all(&data.seen, |s| &s.images.train), data.seen.len())
}

/// Index of the material with the nearest vector.
fn nearest(library: &Library, vector: &[f32; VECTOR_LEN]) -> usize {
    let near = library.nearest(vector, 1);
    let name = near.first().map(|n| n.material.name.as_str());
    library.materials().iter().position(|m| Some(m.name.as_str()) == name).unwrap_or(0)
}

fn part_of(all: usize, some: usize) -> f64 {
    some as f64 / all.max(1) as f64
}

pub(super) fn naming(written: &Written, statistics: &Statistics, data: &Data) -> Result<Naming, Failure> {
    let held = all(&data.seen, |s| &s.images.held);
    let by_vector: Vec<usize> =
        vectors(&written.encoder, &held)?.iter().map(|v| nearest(&written.library, v)).collect();
    let images = || held.iter().map(|(_, image)| *image);
    let named = written.namer.as_ref().map(|namer| namer.names(images(), &Device::flex()));
    let rightly = |named: &[usize]| {
        part_of(held.len(), held.iter().zip(named).filter(|((class, _), named)| class == *named).count())
    };
    let by_statistics = statistics.names(&held);
    let judged = named.as_ref().unwrap_or(&by_vector);
    // How often each material's images got each name.
    let mut counts = vec![vec![0_usize; data.seen.len()]; data.seen.len()];
    held.iter().zip(judged).for_each(|((class, _), named)| counts[*class][*named] += 1);
    let mut worst: Vec<(String, f64, String)> = Vec::new();
    for (class, counts) in counts.iter_mut().enumerate() {
        let (all, right) = (counts.iter().sum::<usize>(), std::mem::take(&mut counts[class]));
        let most = (0..counts.len()).max_by_key(|n| counts[*n]).unwrap_or(0);
        if right < all {
            let name = |class: usize| data.seen[class].name.clone();
            worst.push((name(class), part_of(all, right), name(most)));
        }
    }
    worst.sort_by(|a, b| a.1.total_cmp(&b.1));
    worst.truncate(10);
    let now = Naming {
        images: held.len(),
        classes: data.seen.len(),
        classifier: named.as_ref().map(|named| rightly(named)),
        judged_earlier: false,
        vector: rightly(&by_vector),
        statistics: rightly(&by_statistics),
        worst,
    };
    Ok(now.or_earlier(written.named.as_ref()))
}

impl Naming {
    /// An earlier result with the classifier, if this one lacks it and all else is the same.
    fn or_earlier(self, earlier: Option<&Self>) -> Self {
        let same = |e: &&Self| {
            let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
            e.classifier.is_some()
                && [e.images, e.classes] == [self.images, self.classes]
                && near(e.vector, self.vector)
                && near(e.statistics, self.statistics)
        };
        match earlier.filter(same) {
            Some(earlier) if self.classifier.is_none() => Self { judged_earlier: true, ..earlier.clone() },
            _ => self,
        }
    }
}

/// Judges the neighbours of held-out surfaces by their true magnitudes.
pub(super) fn strangers(
    written: &Written,
    statistics: &Statistics,
    data: &Data,
    judge: &Judge<'_>,
    truths: Vec<Vec<Expectation>>,
) -> Result<Strangers, Failure> {
    let families: Vec<Option<String>> = data.seen.iter().map(|s| s.family.clone()).collect();
    let images = all(&data.unseen, |s| &s.images.train);
    let vectors = vectors(&written.encoder, &images)?;
    let materials = written.library.materials();
    let part_in_family = |named: &mut dyn Iterator<Item = usize>| {
        let pairs = images.iter().zip(named);
        let right = pairs.filter(|((s, _), named)| data.unseen[*s].family == families[*named]).count();
        part_of(images.len(), right)
    };
    let images_in_family = part_in_family(&mut vectors.iter().map(|v| nearest(&written.library, v)));
    let statistics_in_family = part_in_family(&mut statistics.names(&images).into_iter());
    let of = |(number, (subject, truth)): (usize, (&Subject, Vec<Expectation>))| {
        let own = images.iter().zip(&vectors).filter(|((s, _), _)| *s == number);
        let own: Vec<f32> = own.flat_map(|(_, v)| *v).collect();
        let mean = mean_vector(&own);
        let first = nearest(&written.library, &mean);
        let judged = Judged::of(truth, judge.target);
        // A user has one image, so this is the mean over single images.
        let images: Vec<&[f32]> = own.chunks_exact(VECTOR_LEN).collect();
        let some = images.iter().step_by((images.len() / ALONE).max(1)).take(ALONE);
        let alone: Vec<[f32; VECTOR_LEN]> = some.map(|v| mean_vector(v)).collect();
        // None if one of them is.
        let error = |how| -> Result<Option<f64>, Failure> {
            let one = |vector| judge.error_db(written.library.assign(vector, how).as_slice(), &judged);
            let errors = alone.iter().map(one).collect::<Result<Vec<Option<f64>>, Failure>>()?;
            let errors: Option<Vec<f64>> = errors.into_iter().collect();
            Ok(errors.and_then(|errors| average(errors.into_iter())))
        };
        let mut best_db = None;
        for material in materials {
            let error = judge.error_db(material.vector.as_slice(), &judged)?;
            best_db = error.map(|error| f64::min(error, best_db.unwrap_or(f64::INFINITY)));
        }
        Ok(Stranger {
            name: subject.name.clone(),
            family: subject.family.clone(),
            neighbour: (materials[first].name.clone(), families[first].clone()),
            nearest_db: error(Assignment::Nearest)?,
            raw_db: error(Assignment::Raw)?,
            blend_db: error(Assignment::Blend(BLENDED))?,
            best_db,
        })
    };
    let pairs: Vec<_> = data.unseen.iter().zip(truths).enumerate().collect();
    let surfaces = pairs.into_par_iter().map(of).collect::<Result<Vec<_>, Failure>>()?;
    let by_chance =
        |s: &Subject| part_of(families.len(), families.iter().filter(|f| **f == s.family).count());
    let chance = data.unseen.iter().map(by_chance).sum::<f64>() / data.unseen.len().max(1) as f64;
    let right = surfaces.iter().filter(|s: &&Stranger| s.family == s.neighbour.1).count();
    let known = data.unseen.iter().chain(&data.seen).all(|s| s.family.is_some());
    let families = known.then_some(Families {
        surfaces: part_of(surfaces.len(), right),
        images: images_in_family,
        statistics: statistics_in_family,
        chance,
    });
    Ok(Strangers { surfaces, families })
}
