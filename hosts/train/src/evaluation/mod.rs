//! Evaluation of a written model: everything in its model report.

mod looks;
mod magnitudes;
mod network;
mod statistics;

use asperity_data::{Example, Expectation, Subject, Truth, made};
use asperity_numbers::Random;
use asperity_surfaces::topography::MadeSurface;
use asperity_texture::Encoder;
use asperity_texture::Library;
use rayon::prelude::*;
use serde::Serialize;

pub(crate) use looks::{ALONE, Naming, Stranger, Strangers};
pub(crate) use magnitudes::{AUDIBLE_M_S2, RANGE_DB, Scatter, Score};
pub(crate) use network::Network;

use crate::arguments::Settings;
use crate::data::{Data, Origin, made_settings};
use crate::failure::Failure;
use crate::loss::{Target, square_of_noise};
use crate::stages::Namer;
use magnitudes::{Judge, Judged};

/// A written model.
pub(crate) struct Written {
    /// From an image to a vector.
    pub encoder: Encoder,
    /// From forces, velocities and a vector to magnitudes for the settings' target.
    pub network: Network,
    /// Network for the other target, if it was trained.
    pub other: Option<Network>,
    /// Result of stage one, from the run's folder.
    pub namer: Option<Namer>,
    /// Vectors.
    pub library: Library,
    /// Earlier result of naming, if any.
    pub named: Option<Naming>,
}

/// All results.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Evaluation {
    /// Naming of held-out images.
    pub naming: Naming,
    /// Held-out surfaces.
    pub strangers: Strangers,
    /// Errors of magnitudes on held-out strokes, for each material.
    pub scores: Vec<Score>,
    /// The same beyond the trained range of force and speed, with inputs clamped to it.
    pub beyond: Vec<Score>,
    /// Levels of the two targets, for each family.
    pub levels: Vec<Level>,
    /// Scatter of each material's magnitudes; none if the truth is not known.
    pub scatter: Vec<(String, Option<Scatter>)>,
    /// Scatter by family.
    pub scatter_by_family: Vec<(String, Option<Scatter>)>,
    /// Largest magnitude answered to no force, or to no speed, in m/s^2.
    pub silence_m_s2: f64,
}

/// Power of answers over the true power, over a family's materials, in dB. None for silence.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Level {
    /// The family.
    pub family: String,
    /// Level of the true means: the best result of a network for means.
    pub exact_mean_db: Option<f64>,
    /// Level of the network for means.
    pub mean_db: Option<f64>,
    /// Level of the network for power.
    pub rms_db: Option<f64>,
}

/// Root mean square over mean magnitude of a random texture: sqrt(4 / pi), in dB.
pub(crate) const MEAN_GAIN_DB: f64 = 1.05;

/// Test strokes, and places of each piece.
const STROKES: usize = 6;
const STROKE_S: f64 = 3.0;
const PLACES: usize = 8;

/// Number of places of held-out pieces for each touch of a made surface: within the trained range, and
/// beyond.
pub(crate) fn places(settings: &Settings) -> [usize; 2] {
    let pieces = made_settings(settings).pieces[1];
    [PLACES * pieces, PLACES / 2 * pieces]
}

/// Truth of a subject under test.
struct Known {
    within: Vec<Expectation>,
    /// Beyond the trained range, if it can be known.
    beyond: Option<Vec<Expectation>>,
}

/// Truths of all subjects of the data.
struct Truths {
    seen: Vec<Known>,
    unseen: Vec<Vec<Expectation>>,
}

/// Made surfaces get new strokes at many places; other subjects use their held-out examples.
fn truths(settings: &Settings, data: &Data) -> Result<Truths, Failure> {
    let read = |s: &Subject| s.examples.held.iter().map(|e| target_of(e, s.truth)).collect::<Vec<_>>();
    if settings.data != Origin::Made {
        let seen = data.seen.iter().map(|s| Known { within: read(s), beyond: None }).collect();
        return Ok(Truths { seen, unseen: data.unseen.iter().map(read).collect() });
    }
    // The same for all seeds, to compare models.
    let random = &mut Random::new(0x4e1d_00a7);
    let inside = (0..STROKES).map(|_| made::Drawn::new(STROKE_S, random)).collect::<Result<Vec<_>, _>>()?;
    let outside =
        (0..STROKES).map(|_| made::Drawn::beyond(STROKE_S, random)).collect::<Result<Vec<_>, _>>()?;
    let made = made_settings(settings);
    let [seen, unseen] = made::surfaces(settings.every as usize);
    let known = |surface: &MadeSurface| Known {
        within: made::expectations(surface, &made, &inside, PLACES),
        beyond: Some(made::expectations(surface, &made, &outside, PLACES / 2)),
    };
    let unknown = |surface: &MadeSurface| made::expectations(surface, &made, &inside, PLACES);
    Ok(Truths {
        seen: seen.par_iter().map(known).collect(),
        unseen: unseen.par_iter().map(unknown).collect(),
    })
}

/// An example as its own expectation.
fn target_of(example: &Example, truth: Truth) -> Expectation {
    let [mean, rms] = [Target::Mean, Target::Rms].map(|t| example.magnitudes.map(|m| t.of(m, truth)));
    // One frame tells nothing of the scatter of others.
    let square = (truth == Truth::Rms).then(|| square_of_noise(&rms)).filter(|square| *square > 0.0);
    let variance = square.map(|square| square - 1.0);
    Expectation { mean, rms, variance, example: Example { other: None, ..example.clone() } }
}

/// Evaluates a model on held-out data.
///
/// # Errors
/// A network that fails to run; a material missing in the library.
pub(crate) fn evaluate(written: &Written, settings: &Settings, data: &Data) -> Result<Evaluation, Failure> {
    let truths = truths(settings, data)?;
    let judge = Judge { network: &written.network, target: settings.target, reach: data.reach };

    eprintln!("judging names of held-out images");
    let statistics = looks::statistics(data);
    let naming = looks::naming(written, &statistics, data)?;
    eprintln!("judging vibration of {} materials", data.seen.len());
    let judged: Vec<(Judged, Score, Option<Score>)> = (data.seen.par_iter().zip(&truths.seen))
        .map(|(subject, truth)| {
            let vector = written.library.material(&subject.name)?.vector.as_slice();
            let judged = Judged::of(truth.within.clone(), settings.target);
            let score = judge.score(subject, vector, &judged)?;
            let beyond = match &truth.beyond {
                Some(beyond) => {
                    Some(judge.score(subject, vector, &Judged::of(beyond.clone(), settings.target))?)
                }
                None => None,
            };
            Ok((judged, score, beyond))
        })
        .collect::<Result<_, Failure>>()?;
    let levels = match &written.other {
        Some(other) => levels(written, other, settings.target, data, &judged)?,
        None => Vec::new(),
    };
    let powerful = match settings.target {
        Target::Rms => Some(&written.network),
        Target::Mean => written.other.as_ref(),
    };
    let mut scatter = Vec::new();
    if let Some(network) = powerful.filter(|network| network.answers_scatter()) {
        for (subject, (judged, _, _)) in data.seen.iter().zip(&judged) {
            let vector = written.library.material(&subject.name)?.vector.as_slice();
            scatter.push((subject, judged.scatter(network, vector)?));
        }
    }
    eprintln!("judging {} unseen surfaces", data.unseen.len());
    let strangers = looks::strangers(written, &statistics, data, &judge, truths.unseen)?;
    let (mut scores, mut beyond) = (Vec::new(), Vec::new());
    for (_, score, out) in judged {
        scores.push(score);
        beyond.extend(out);
    }
    let silence_m_s2 = magnitudes::loudest_silence(&written.network, &written.library, data.reach)?;
    let figures = |s: &Option<Scatter>| match s {
        Some(s) => [s.ratio, s.ratio_answered, s.variance, s.variance_answered].map(Some),
        None => [None; 4],
    };
    let families =
        by_family(scatter.iter().map(|(s, scatter)| (s.family.clone(), figures(scatter))).collect());
    let of_family = |(family, figures): (String, [Option<f64>; 4])| {
        let known = match figures {
            [Some(ratio), Some(ratio_answered), Some(variance), Some(variance_answered)] => {
                Some(Scatter { ratio, ratio_answered, variance, variance_answered })
            }
            _ => None,
        };
        (family, known)
    };
    Ok(Evaluation {
        naming,
        strangers,
        scores,
        beyond,
        levels,
        scatter_by_family: families.into_iter().map(of_family).collect(),
        scatter: scatter.into_iter().map(|(s, scatter)| (s.name.clone(), scatter)).collect(),
        silence_m_s2,
    })
}

/// Levels of both targets by family, and last over all.
fn levels(
    written: &Written,
    other: &Network,
    target: Target,
    data: &Data,
    judged: &[(Judged, Score, Option<Score>)],
) -> Result<Vec<Level>, Failure> {
    let (mean, rms) = match target {
        Target::Mean => (&written.network, other),
        Target::Rms => (other, &written.network),
    };
    let mut all = Vec::new();
    for (subject, (judged, _, _)) in data.seen.iter().zip(judged) {
        let vector = written.library.material(&subject.name)?.vector.as_slice();
        let level = |network: &Network| judged.level_db(network, vector);
        all.push((subject.family.clone(), [judged.mean_level_db(), level(mean)?, level(rms)?]));
    }
    let level = |(family, [exact_mean_db, mean_db, rms_db]): (String, [Option<f64>; 3])| Level {
        family,
        exact_mean_db,
        mean_db,
        rms_db,
    };
    Ok(by_family(all).into_iter().map(level).collect())
}

/// Means of figures over each family's materials with figures, and last over all; nothing without
/// materials.
fn by_family<const N: usize>(
    all: Vec<(Option<String>, [Option<f64>; N])>,
) -> Vec<(String, [Option<f64>; N])> {
    if all.is_empty() {
        return Vec::new();
    }
    let mut families: Vec<String> = Vec::new();
    for family in all.iter().filter_map(|(family, ..)| family.as_ref()) {
        if !families.contains(family) {
            families.push(family.clone());
        }
    }
    let means = |family: Option<&str>| {
        let of: Vec<_> =
            all.iter().filter(|(f, ..)| family.is_none_or(|family| f.as_deref() == Some(family))).collect();
        let average = |figure: usize| {
            let known: Vec<f64> = of.iter().filter_map(|(_, figures)| figures[figure]).collect();
            (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
        };
        (family.unwrap_or("all").to_owned(), std::array::from_fn(average))
    };
    families.iter().map(|f| means(Some(f))).chain([means(None)]).collect()
}
