//! The card that is written beside a model.

use std::fmt::Write as _;

use asperity_dataset::{MAX_FORCE_N, MAX_SPEED_MM_S};

use crate::arguments::Settings;
use crate::data::Data;
use crate::encoder::Preset;
use crate::evaluation::{AUDIBLE_M_S2, Evaluation, Level, Naming, RANGE_DB, Score, Strangers};
use crate::loss::{Aim, Target};

/// What the card says of the files themselves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sizes {
    /// Bytes of the encoder's file.
    pub encoder_bytes: u64,
    /// Bytes of the network's file.
    pub network_bytes: u64,
}

/// The card, in Markdown.
pub(crate) fn write(settings: &Settings, sizes: Sizes, data: &Data, evaluation: &Evaluation) -> String {
    let mut card = head(settings, sizes, data);
    // writing to a String cannot fail
    if evaluation.naming.images > 0 {
        let _ = write!(card, "\n## Names\n\n{}", names(&evaluation.naming));
    }
    let _ = write!(card, "\n## Vibration\n\n{}", vibration(settings, evaluation));
    if !evaluation.levels.is_empty() {
        let _ = write!(card, "\n## Mean or root mean square\n\n{}", levels(&evaluation.levels));
    }
    if !evaluation.strangers.surfaces.is_empty() {
        let _ = write!(card, "\n## Surfaces that were never seen\n\n{}", strangers(&evaluation.strangers));
    }
    let _ = write!(card, "\n## Every material\n\n{}", table(&evaluation.scores));
    card
}

fn head(settings: &Settings, sizes: Sizes, data: &Data) -> String {
    let count = |of: fn(&asperity_dataset::Subject) -> usize| data.seen.iter().map(of).sum::<usize>();
    let megabytes = |bytes: u64| bytes as f64 * 1e-6;
    let preset = match settings.preset {
        Preset::Paper => "the sizes of Heravi et al. 2024",
        Preset::Compact => "narrower than AlexNet (24, 64, 96, 96 and 256 channels; heads of 192 and 512)",
    };
    format!(
        "# A texture model

From a tactile image to a material's vector (`encoder.onnx`, {encoder:.1} MB, {preset}), and from a vector, the last ten forces and velocities to the
magnitudes of the next 0.1 s of acceleration (`texture.onnx`, {network:.1} MB, the layer sizes of Heravi et al. 2024). `materials.ron` has the vectors of
{materials} materials. Inputs: `image` [1, 3, 192, 256], 0 to 1; `force` [1, 10] in N; `speed` [1, 20] in mm/s, 10 vx, then 10 vy; `texture`
[1, 256]. Histories are oldest first, 2 ms apart. Output: `magnitudes` [1, 100], amplitudes in m/s^2 (2 |sum w x| / sum w, Hann window) at 10,
20, .. 1000 Hz. Trained range: 0 to {MAX_FORCE_N} N, 0 to {MAX_SPEED_MM_S} mm/s in any direction.

Data: `{origin}`. {images} images and {touches} touches of {materials} materials to train on; {held_images} images of other places, and strokes over
those, to judge by; {unseen} surfaces that were never trained on. Made data are physics with chosen figures, nothing measured: what holds here need not hold for
real surfaces.

The network aims at {target} and its errors are weighed {error}. Stage one took {naming} steps of {batch} images, stage two {feeling} of {touching} touches.
Everything below is written by `asperity-train evaluate`.
",
        encoder = megabytes(sizes.encoder_bytes),
        network = megabytes(sizes.network_bytes),
        materials = data.seen.len(),
        origin = settings.data.name(),
        images = count(|s| s.images.train.len()),
        held_images = count(|s| s.images.held.len()),
        touches = count(|s| s.examples.train.len()),
        unseen = data.unseen.len(),
        target = match settings.target {
            Target::Mean => "mean magnitudes, as in the paper,",
            Target::Rms => "root mean square magnitudes",
        },
        error = match settings.error {
            Aim::Euclidean => "in m/s^2, as in the paper",
            Aim::Relative => "in parts of what such a touch of the material comes to",
        },
        naming = settings.naming_steps,
        batch = settings.naming_batch,
        feeling = settings.feeling_steps,
        touching = settings.feeling_groups * settings.feeling_each,
    )
}

fn percent(part: f64) -> String {
    format!("{:.1} %", 100.0 * part)
}

fn names(naming: &Naming) -> String {
    let mut text = format!(
        "Of {} images of {} materials, at places that were never trained on, named rightly:

| | |
|---|---|
",
        naming.images, naming.classes
    );
    let mut row = |what: &str, part: f64| {
        let _ = writeln!(text, "| {what} | {} |", percent(part));
    };
    if let Some(part) = naming.classifier {
        row("classifier of stage one", part);
    }
    row("nearest stored vector", naming.vector);
    row(
        "linear classifier of image statistics (mean, deviation and radial power spectrum of each colour)",
        naming.statistics,
    );
    row("chance", 1.0 / naming.classes.max(1) as f64);
    if !naming.worst.is_empty() {
        text.push_str("\nNamed worst, and what they are taken for most often:\n\n| material | rightly | taken for |\n|---|---|---|\n");
        for (name, part, other) in &naming.worst {
            let _ = writeln!(text, "| {name} | {} | {other} |", percent(*part));
        }
    }
    text
}

fn average(scores: &[Score], figure: impl Fn(&Score) -> f64) -> f64 {
    scores.iter().map(figure).sum::<f64>() / scores.len().max(1) as f64
}

fn vibration(settings: &Settings, evaluation: &Evaluation) -> String {
    let scores = &evaluation.scores;
    let beats =
        |which: usize| scores.iter().filter(|s| s.beats()[which]).count() as f64 / scores.len().max(1) as f64;
    let of = |figure: fn(&Score) -> f64| format!("{:.2}", average(scores, figure));
    let out = |figure: fn(&Score) -> f64| format!("{:.2}", average(&evaluation.beyond, figure));
    let truth = match settings.target {
        Target::Mean => "mean",
        Target::Rms => "root mean square",
    };
    format!(
        "Mean of |error| in dB against the {truth} magnitudes of strokes that were never trained on, each made at many places of pieces that were never
trained on; bins of at least {AUDIBLE_M_S2} m/s^2 and within {RANGE_DB} dB of the frame's largest; average over materials. Beyond: strokes at up to 450 mm/s or
6.5 N, inputs held to the trained range as the node holds them.

| | within | beyond | model is better for |
|---|---|---|---|
| model | {} | {} | |
| (a) always the material's mean spectrum | {} | {} | {} of materials |
| (b) the training touch nearest in force and speed | {} | {} | {} of materials |
| the mean of the twenty nearest | {} | {} | |
| (c) two signals of the same touch | {} | {} | |

Bias of the model: {:+.2} dB within, {:+.2} dB beyond. Largest magnitude answered to no force, or to no speed: {:.4} m/s^2.
",
        of(|s| s.model_db),
        out(|s| s.model_db),
        of(|s| s.constant_db),
        out(|s| s.constant_db),
        percent(beats(0)),
        of(|s| s.nearest_db),
        out(|s| s.nearest_db),
        percent(beats(1)),
        of(|s| s.smooth_db),
        out(|s| s.smooth_db),
        of(|s| s.floor_db),
        out(|s| s.floor_db),
        average(scores, |s| s.bias_db),
        average(&evaluation.beyond, |s| s.bias_db),
        evaluation.silence_m_s2,
    )
}

fn levels(levels: &[Level]) -> String {
    let mut text = String::from(
        "Power of the answers over the true power of held-out strokes. A network trained on the squared error of magnitudes answers their mean, which is too quiet where
they are random, and right where they are not: a gain of 1.05 dB for all overdrives gratings.

| family | trained on magnitudes, dB | the same with 1.05 dB of gain | trained on power, dB |
|---|---|---|---|
",
    );
    for level in levels {
        let _ = writeln!(
            text,
            "| {} | {:+.2} | {:+.2} | {:+.2} |",
            level.family, level.mean_db, level.gained_db, level.rms_db
        );
    }
    text
}

fn strangers(strangers: &Strangers) -> String {
    let surfaces = &strangers.surfaces;
    let count = surfaces.len().max(1) as f64;
    let right = surfaces.iter().filter(|s| s.family == s.neighbour.1).count() as f64 / count;
    let mean =
        |figure: fn(&crate::evaluation::Stranger) -> f64| surfaces.iter().map(figure).sum::<f64>() / count;
    let mut text = format!(
        "The material with the nearest vector is of the right family for {} of {} surfaces, and for {} of single images; a linear classifier of image
statistics takes {} of images for a material of the right family; chance is {}. Mean of |error| in dB with the neighbour's vector {:.2}, with the surface's own {:.2},
with a blend of the three nearest {:.2}; the best of all stored vectors would give {:.2}.

| surface | family | neighbour | its family | nearest, dB | own, dB | blend, dB | best, dB |
|---|---|---|---|---|---|---|---|
",
        percent(right),
        surfaces.len(),
        percent(strangers.images_in_family),
        percent(strangers.statistics_in_family),
        percent(strangers.chance),
        mean(|s| s.nearest_db),
        mean(|s| s.raw_db),
        mean(|s| s.blend_db),
        mean(|s| s.best_db),
    );
    for s in surfaces {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {:.1} | {:.1} | {:.1} | {:.1} |",
            s.name, s.family, s.neighbour.0, s.neighbour.1, s.nearest_db, s.raw_db, s.blend_db, s.best_db
        );
    }
    text
}

fn table(scores: &[Score]) -> String {
    let mut text = String::from(
        "Mean of |error| in dB, as above.

| material | model | 9 of 10 within | bias | (a) mean spectrum | (b) nearest touch | twenty nearest | (c) two signals |
|---|---|---|---|---|---|---|---|
",
    );
    for s in scores {
        let _ = writeln!(
            text,
            "| {} | {:.2} | {:.2} | {:+.2} | {:.2} | {:.2} | {:.2} | {:.2} |",
            s.material, s.model_db, s.p90_db, s.bias_db, s.constant_db, s.nearest_db, s.smooth_db, s.floor_db
        );
    }
    text
}
