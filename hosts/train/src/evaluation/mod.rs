//! Evaluation of a written model: everything in its model report.

mod looks;
mod magnitudes;
mod statistics;

use asperity_data::{Example, Expectation, Subject, Truth, made};
use asperity_diagnostics::Diagnostic;
use asperity_numbers::Random;
use asperity_surfaces::topography::MadeSurface;
use asperity_texture::{Encoder, Library, Model};
use rayon::prelude::*;
use serde::Serialize;

pub(crate) use looks::{ALONE, Naming, Stranger, Strangers};
pub(crate) use magnitudes::{AUDIBLE_M_S2, RANGE_DB, Scatter, Score};

use crate::Failure;
use crate::arguments::Settings;
use crate::data::{Data, Origin, made_settings};
use crate::loss::{Target, square_of_noise};
use crate::stages::Namer;
use magnitudes::{Judge, Judged};

/// A written model.
pub(crate) struct Written {
    pub encoder: Encoder,
    /// For the settings' target.
    pub network: Model,
    /// Network for the other target, if it was trained.
    pub other: Option<Model>,
    /// Result of stage one, from the run's folder.
    pub namer: Option<Namer>,
    pub library: Library,
    /// Earlier result of naming, if any.
    pub named: Option<Naming>,
}

/// All results.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Evaluation {
    pub naming: Naming,
    pub strangers: Strangers,
    /// Errors of magnitudes on held-out strokes, for each material.
    pub scores: Vec<Score>,
    /// The same beyond the trained range of force and speed, with inputs clamped to it.
    pub beyond: Vec<Score>,
    pub levels: Vec<Level>,
    /// Scatter of each material's magnitudes; none if the truth is not known.
    pub scatter: Vec<(String, Option<Scatter>)>,
    pub scatter_by_family: Vec<(String, Option<Scatter>)>,
    /// Largest magnitude answered to no force, or to no speed, in m/s^2.
    pub silence_m_s2: f64,
}

/// Power of answers over the true power, over a family's materials, in dB. None for silence.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Level {
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

/// Truths of the seen and the unseen subjects. Made surfaces get new strokes at many places; other subjects
/// use their held-out examples.
fn truths(settings: &Settings, data: &Data) -> Result<(Vec<Known>, Vec<Vec<Expectation>>), Failure> {
    let read = |s: &Subject| s.examples.held.iter().map(|e| target_of(e, s.truth)).collect::<Vec<_>>();
    if settings.data != Origin::Made {
        let seen = data.seen.iter().map(|s| Known { within: read(s), beyond: None }).collect();
        return Ok((seen, data.unseen.iter().map(read).collect()));
    }
    // The same for all seeds, to compare models.
    let random = &mut Random::new(0x4e1d_00a7);
    let mut drawn = |draw: fn(f64, &mut Random) -> Result<made::Drawn, Diagnostic>| {
        (0..STROKES).map(|_| draw(STROKE_S, random)).collect::<Result<Vec<_>, _>>()
    };
    let (inside, outside) = (drawn(made::Drawn::new)?, drawn(made::Drawn::beyond)?);
    let made = made_settings(settings);
    let [seen, unseen] = made::surfaces(settings.every as usize);
    let within = |surface: &MadeSurface| made::expectations(surface, &made, &inside, PLACES);
    let known = |surface: &MadeSurface| Known {
        within: within(surface),
        beyond: Some(made::expectations(surface, &made, &outside, PLACES / 2)),
    };
    Ok((seen.par_iter().map(known).collect(), unseen.par_iter().map(within).collect()))
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
pub(crate) fn evaluate(written: &Written, settings: &Settings, data: &Data) -> Result<Evaluation, Failure> {
    let (seen, unseen) = truths(settings, data)?;
    let judge = Judge { network: &written.network, target: settings.target, reach: data.reach };

    eprintln!("judging names of held-out images");
    let statistics = looks::statistics(data);
    let naming = looks::naming(written, &statistics, data)?;
    eprintln!("judging vibration of {} materials", data.seen.len());
    let judged: Vec<(Judged, Score, Option<Score>)> = (data.seen.par_iter().zip(&seen))
        .map(|(subject, truth)| {
            let vector = written.library.material(&subject.name)?.vector.as_slice();
            let judged = Judged::of(truth.within.clone(), settings.target);
            let score = judge.score(subject, vector, &judged)?;
            let beyond = truth.beyond.clone().map(|beyond| Judged::of(beyond, settings.target));
            let beyond = beyond.map(|beyond| judge.score(subject, vector, &beyond)).transpose()?;
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
    let strangers = looks::strangers(written, &statistics, data, &judge, unseen)?;
    let (mut scores, mut beyond) = (Vec::new(), Vec::new());
    for (_, score, out) in judged {
        scores.push(score);
        beyond.extend(out);
    }
    let silence_m_s2 = magnitudes::loudest_silence(&written.network, &written.library, data.reach)?;
    let figures = |s: Scatter| [s.ratio, s.ratio_answered, s.variance, s.variance_answered].map(Some);
    let of_subjects = scatter.iter().map(|(s, known)| (s.family.clone(), known.map_or([None; 4], figures)));
    let of_family = |(family, [ratio, ratio_answered, variance, variance_answered]): (_, [_; 4])| {
        let known = || {
            let (ratio_answered, variance_answered) = (ratio_answered?, variance_answered?);
            Some(Scatter { ratio: ratio?, ratio_answered, variance: variance?, variance_answered })
        };
        (family, known())
    };
    let scatter_by_family = by_family(of_subjects.collect()).into_iter().map(of_family).collect();
    let scatter = scatter.into_iter().map(|(s, scatter)| (s.name.clone(), scatter)).collect();
    Ok(Evaluation { naming, strangers, scores, beyond, levels, scatter_by_family, scatter, silence_m_s2 })
}

/// Levels of both targets by family, and last over all.
fn levels(
    written: &Written,
    other: &Model,
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
        let level = |network: &Model| judged.level_db(network, vector);
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
