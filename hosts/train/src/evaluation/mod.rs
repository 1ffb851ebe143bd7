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

pub(crate) struct Written {
    pub encoder: Encoder,
    /// For the settings' target.
    pub network: Model,
    pub other: Option<Model>,
    pub namer: Option<Namer>,
    pub library: Library,
    pub named: Option<Naming>,
}

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
    pub mean_db: Option<f64>,
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

fn target_of(example: &Example, truth: Truth) -> Expectation {
    let [mean, rms] = [Target::Mean, Target::Rms].map(|t| example.magnitudes.map(|m| t.of(m, truth)));
    // One frame tells nothing of the scatter of others.
    let square = (truth == Truth::Rms).then(|| square_of_noise(&rms)).filter(|square| *square > 0.0);
    let variance = square.map(|square| square - 1.0);
    Expectation { mean, rms, variance, example: Example { other: None, ..example.clone() } }
}

pub(crate) fn average(figures: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = figures.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
    (count > 0.0).then(|| sum / count)
}

struct Judgement {
    score: Score,
    beyond: Option<Score>,
    /// Levels of the true means, the network for means and the network for power, in dB.
    levels: [Option<f64>; 3],
    scatter: Option<Scatter>,
}

pub(crate) fn evaluate(written: &Written, settings: &Settings, data: &Data) -> Result<Evaluation, Failure> {
    let (seen, unseen) = truths(settings, data)?;
    let target = settings.target;
    let judge = Judge { network: &written.network, target, reach: data.reach };
    eprintln!("judging names of held-out images");
    let statistics = looks::statistics(data);
    let naming = looks::naming(written, &statistics, data)?;
    eprintln!("judging vibration of {} materials", data.seen.len());
    let [for_means, for_power] = match target {
        Target::Mean => [Some(&written.network), written.other.as_ref()],
        Target::Rms => [written.other.as_ref(), Some(&written.network)],
    };
    let scattering = for_power.filter(|network| network.answers_scatter());
    let judged: Vec<Judgement> = (data.seen.par_iter().zip(&seen))
        .map(|(subject, truth)| {
            let vector = written.library.material(&subject.name)?.vector.as_slice();
            let judged = Judged::of(truth.within.clone(), target);
            let beyond = truth.beyond.clone().map(|beyond| Judged::of(beyond, target));
            let level = |network: Option<&Model>| network.map_or(Ok(None), |n| judged.level_db(n, vector));
            Ok(Judgement {
                score: judge.score(subject, vector, &judged)?,
                beyond: beyond.map(|beyond| judge.score(subject, vector, &beyond)).transpose()?,
                levels: [judged.mean_level_db(), level(for_means)?, level(for_power)?],
                scatter: scattering.map_or(Ok(None), |network| judged.scatter(network, vector))?,
            })
        })
        .collect::<Result<_, Failure>>()?;
    eprintln!("judging {} unseen surfaces", data.unseen.len());
    let strangers = looks::strangers(written, &statistics, data, &judge, unseen)?;
    let silence_m_s2 = magnitudes::loudest_silence(&written.network, &written.library, data.reach)?;
    // Each family with its materials, in the order of the first, and last all.
    let mut families: Vec<(String, Vec<&Judgement>)> = Vec::new();
    for (family, judged) in data.seen.iter().map(|s| &s.family).zip(&judged) {
        let Some(family) = family else { continue };
        match families.iter_mut().find(|(known, _)| known == family) {
            Some((_, all)) => all.push(judged),
            None => families.push((family.clone(), vec![judged])),
        }
    }
    if !judged.is_empty() {
        families.push(("all".to_owned(), judged.iter().collect()));
    }
    let level = |(family, all): &(String, Vec<&Judgement>)| {
        let [exact_mean_db, mean_db, rms_db] =
            [0, 1, 2].map(|k| average(all.iter().filter_map(|j| j.levels[k])));
        Level { family: family.clone(), exact_mean_db, mean_db, rms_db }
    };
    let levels = families.iter().filter(|_| written.other.is_some()).map(level).collect();
    let of_family = |(family, all): &(String, Vec<&Judgement>)| {
        let mean =
            |figure: fn(&Scatter) -> f64| average(all.iter().filter_map(|j| j.scatter.as_ref()).map(figure));
        let known = || {
            let (ratio_answered, variance_answered) =
                (mean(|s| s.ratio_answered)?, mean(|s| s.variance_answered)?);
            let (ratio, variance) = (mean(|s| s.ratio)?, mean(|s| s.variance)?);
            Some(Scatter { ratio, ratio_answered, variance, variance_answered })
        };
        (family.clone(), known())
    };
    let scatters = scattering.is_some();
    let scatter_by_family = families.iter().filter(|_| scatters).map(of_family).collect();
    let scatter = data.seen.iter().zip(&judged).filter(|_| scatters);
    let scatter = scatter.map(|(subject, judged)| (subject.name.clone(), judged.scatter)).collect();
    let (scores, beyond): (Vec<Score>, Vec<Option<Score>>) =
        judged.into_iter().map(|judged| (judged.score, judged.beyond)).unzip();
    let beyond = beyond.into_iter().flatten().collect();
    Ok(Evaluation { naming, strangers, scores, beyond, levels, scatter_by_family, scatter, silence_m_s2 })
}
