//! The report beside a model.

use std::fmt::Write as _;

use asperity_data::made::{BEYOND_FORCE_N, BEYOND_SPEED_MM_S};
use asperity_texture::BLENDED;

use crate::arguments::Settings;
use crate::data::{Data, Origin};
use crate::encoder::Preset;
use crate::evaluation::{
    ALONE, AUDIBLE_M_S2, Evaluation, Level, MEAN_GAIN_DB, Naming, RANGE_DB, Scatter, Score, Stranger,
    Strangers, average, places,
};
use crate::loss::{Aim, Target};

/// The report, in Markdown, with the sizes of the encoder's and the network's file in MB.
pub(crate) fn write(settings: &Settings, sizes_mb: [f64; 2], data: &Data, evaluation: &Evaluation) -> String {
    let Evaluation { naming, levels: all, strangers: unseen, scatter: each, .. } = evaluation;
    let when = |known: bool, text: &dyn Fn() -> String| if known { text() } else { String::new() };
    let scattered = each.iter().any(|(_, scatter)| scatter.is_some());
    let parts = [
        ("Goals", goals(evaluation)),
        ("Names", when(naming.images > 0, &|| names(naming))),
        ("Vibration", vibration(settings, evaluation)),
        ("Mean or root mean square", when(!all.is_empty(), &|| levels(settings, all))),
        ("Mean over root mean square", when(scattered, &|| scatter(&evaluation.scatter_by_family))),
        ("Surfaces that were never seen", when(!unseen.surfaces.is_empty(), &|| strangers(unseen))),
        ("Every material", table(&evaluation.scores)),
    ];
    let parts = parts.into_iter().filter(|(_, text)| !text.is_empty());
    let parts = parts.map(|(title, text)| format!("\n## {title}\n\n{text}"));
    std::iter::once(head(settings, sizes_mb, data)).chain(parts).collect()
}

fn head(settings: &Settings, [encoder, network]: [f64; 2], data: &Data) -> String {
    let count = |of: fn(&asperity_data::Subject) -> usize| data.seen.iter().map(of).sum::<usize>();
    let preset = match settings.preset {
        Preset::Paper => "the sizes of Heravi et al. 2024".to_owned(),
        Preset::Compact => {
            let [a, b, c, d, e] = Preset::Compact.channels();
            let [wide, narrow] = Preset::Compact.hidden();
            format!(
                "narrower than AlexNet ({a}, {b}, {c}, {d} and {e} channels; heads of {wide} and {narrow})"
            )
        }
    };
    let made = match settings.data {
        Origin::Made => {
            " Made data are physics with chosen figures, nothing measured: what holds here need not hold for
real surfaces. About half of neighbouring surfaces of a family overlap, within their pieces' spread, in \
what they are made from; the others are neighbours without. Settings
were chosen by the same held-out images and strokes as everything below is judged by."
        }
        Origin::Hatt(_) | Origin::Recordings(_) => "",
    };
    format!(
        "# A texture model

From a tactile image to a material's vector (`encoder.onnx`, {encoder:.1} MB, {preset}), and from a \
vector, the last ten forces and velocities to the
magnitudes of the next 0.1 s of acceleration (`texture.onnx`, {network:.1} MB,
that of Heravi et al. 2024 with a wider branch for speed). `materials.ron` has the vectors of
{materials} materials. Inputs: `image` [1, 3, 192, 256], 0 to 1; `force` [1, 10] in N; `speed` [1, 20] in \
mm/s, 10 vx, then 10 vy; `texture`
[1, 256]. Histories are oldest first, 2 ms apart. Output: `magnitudes` [1, 100], amplitudes in m/s^2 (2 \
|sum w x| / sum w, Hann window) at 10,
20, .. 1000 Hz.{scatter} Trained range: 0 to {force_n:.2} N, 0 to {speed_mm_s:.0} mm/s in any direction.

Data: `{origin}`. {images} images and {touches} touches of {materials} materials to train on; \
{held_images} other images, and other strokes, to judge by;
{unseen} surfaces that were never trained on.{made}

The network aims at {target} and its errors are weighed {error}. Stage one took {naming} steps of {batch} \
images, stage two {feeling} of {touching} touches,
with a weight of {weight} on naming by the vector, then {settling} for each target.
{anew}Everything below is written by `asperity-train evaluate`.
",
        scatter = match settings.target {
            Target::Mean => "",
            Target::Rms => {
                " Other outputs: `ratio` [1, 100], mean over root mean square of each amplitude, and
`variance` [1, 1], the variance of a frame's power over its squared mean."
            }
        },
        anew = settings.network_steps.map_or(String::new(), |steps| {
            format!(
                "
Then the network of every tick was trained anew on vectors of the finished encoder: {steps} steps, and {} \
of settling. The
network for the other target is that of the first training.
",
                settings.settling_steps
            )
        }),
        materials = data.seen.len(),
        force_n = data.reach.force_n,
        speed_mm_s = data.reach.speed_mm_s,
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
            Aim::Euclidean => "in m/s^2",
            Aim::Relative => "relative to the level of such a touch of the material",
        },
        naming = settings.naming_steps,
        weight = settings.naming_weight,
        batch = settings.naming_batch,
        feeling = settings.feeling_steps,
        touching = settings.feeling_groups * settings.feeling_each,
        settling = settings.settling_steps,
    )
}

fn lines<const N: usize>(rows: impl Iterator<Item = [String; N]>) -> String {
    rows.map(|cells| format!("| {} |\n", cells.join(" | "))).collect()
}

fn cell(name: &str) -> String {
    name.replace(char::is_control, " ").replace('|', "\\|")
}

fn percent(part: f64) -> String {
    format!("{:.1} %", 100.0 * part)
}

/// A figure in dB, or a dash for none.
fn decibels(figure: Option<f64>) -> String {
    figure.map_or_else(|| "-".to_owned(), |db| format!("{db:.2}"))
}

fn judged(scores: &[Score]) -> impl Iterator<Item = &Score> + Clone {
    scores.iter().filter(|s| s.bins > 0)
}

/// Part of the materials that the model beats this baseline on.
fn beaten(scores: &[Score], which: usize) -> Option<f64> {
    average(judged(scores).map(|s| f64::from(u8::from(s.beats()[which]))))
}

fn goals(evaluation: &Evaluation) -> String {
    let naming = &evaluation.naming;
    let mut text = String::from("| goal | figure | |\n|---|---|---|\n");
    let mut row = |goal: &str, figure: String, reached: bool| {
        let _ = writeln!(text, "| {goal} | {figure} | {} |", if reached { "reached" } else { "**short**" });
    };
    if naming.images > 0 {
        let top = naming.classifier.unwrap_or(naming.vector);
        let by = if naming.classifier.is_some() { "the classifier" } else { "the nearest vector" };
        row(&format!("names of held-out images, by {by}: 95 % rightly"), percent(top), top >= 0.95);
        let figure = format!("{} against {}", percent(1.0 - top), percent(1.0 - naming.statistics));
        row(
            "half the errors of plain image statistics or fewer",
            figure,
            2.0 * (1.0 - top) <= 1.0 - naming.statistics,
        );
    }
    for (which, rival) in ["(a), the mean spectrum,", "(b), the nearest touch,"].into_iter().enumerate() {
        if let Some(part) = beaten(&evaluation.scores, which) {
            row(&format!("better than {rival} for 90 % of materials"), percent(part), part >= 0.9);
        }
    }
    if let Some(families) = &evaluation.strangers.families {
        let figure =
            format!("{} of surfaces, {} of images", percent(families.surfaces), percent(families.images));
        row("a new surface's neighbour is of its family: 80 %", figure, families.images >= 0.8);
    }
    text
}

fn names(naming: &Naming) -> String {
    let mut text = format!(
        "Of {} images that were never trained on, of {} materials, named rightly:

| | |
|---|---|
",
        naming.images, naming.classes
    );
    let mut row = |what: &str, part: Option<f64>| {
        let figure =
            part.map_or_else(|| "not judged: without the run's `naming.checkpoint`".to_owned(), percent);
        let _ = writeln!(text, "| {what} | {figure} |");
    };
    let classifier = match naming.judged_earlier {
        true => "classifier of stage one, as judged earlier on the same images and vectors",
        false => "classifier of stage one",
    };
    row(classifier, naming.classifier);
    row("nearest stored vector", Some(naming.vector));
    row(
        "linear classifier of image statistics (mean, deviation and radial power spectrum of each colour)",
        Some(naming.statistics),
    );
    row("chance", Some(1.0 / naming.classes.max(1) as f64));
    if !naming.worst.is_empty() {
        text.push_str(
            "\nNamed worst, with the name that they get most often:\n\n| material | right | taken for \
             |\n|---|---|---|\n",
        );
        text +=
            &lines(naming.worst.iter().map(|(name, part, other)| [cell(name), percent(*part), cell(other)]));
    }
    text
}

fn vibration(settings: &Settings, evaluation: &Evaluation) -> String {
    let [places, places_beyond] = places(settings);
    let figure = match settings.target {
        Target::Mean => "mean",
        Target::Rms => "root mean square",
    };
    let truth = match &settings.data {
        Origin::Recordings(_) => "the magnitudes of single recorded frames of held-out strokes, which are \
                                  random about what can be known"
            .to_owned(),
        Origin::Hatt(_) => {
            format!("the models' {figure} magnitudes on strokes that were never trained on")
        }
        Origin::Made => format!(
            "the {figure} magnitudes, over {places} places (beyond: {places_beyond}) of pieces that were \
             never trained on, of strokes that were never trained on"
        ),
    };
    let beyond = if evaluation.beyond.is_empty() {
        String::new()
    } else {
        format!(
            " Beyond: strokes at up to {BEYOND_SPEED_MM_S:.0} mm/s or
{BEYOND_FORCE_N:.1} N; inputs are held to the trained range as the node holds them, those of (b) too."
        )
    };
    let mut text = format!(
        "Mean of |error| in dB against {truth}; bins of at least
{AUDIBLE_M_S2} m/s^2 and within {RANGE_DB} dB of the frame's largest; average over materials.{beyond} A \
rival that is one
signal, as (b) is, carries a single signal's noise; the mean of twenty has little of it. (c) is no limit \
for the model: it has the noise of two single signals, and the
model is judged by what is true on average.

| | within | beyond | model is better for |
|---|---|---|---|
"
    );
    type Figure = fn(&Score) -> Option<f64>;
    let rows: [(&str, Figure, Option<usize>); 5] = [
        ("model", |s| Some(s.model_db), None),
        ("(a) always the material's mean spectrum", |s| Some(s.constant_db), Some(0)),
        ("(b) the training touch nearest in force and speed", |s| Some(s.nearest_db), Some(1)),
        ("the mean of the twenty nearest", |s| Some(s.smooth_db), Some(2)),
        ("(c) two signals of the same touch", |s| s.floor_db, None),
    ];
    for (what, figure, rival) in rows {
        let better = rival
            .and_then(|which| beaten(&evaluation.scores, which))
            .map_or_else(String::new, |part| format!("{} of materials", percent(part)));
        let [within, out] =
            [&evaluation.scores, &evaluation.beyond].map(|s| decibels(average(judged(s).filter_map(figure))));
        let _ = writeln!(text, "| {what} | {within} | {out} | {better} |");
    }
    let bias = |scores: &[Score]| average(judged(scores).map(|s| s.bias_db));
    let _ = write!(text, "\nBias of the model: {} dB within", decibels(bias(&evaluation.scores)));
    if let Some(db) = bias(&evaluation.beyond) {
        let _ = write!(text, ", {db:.2} dB beyond");
    }
    let _ = writeln!(
        text,
        ". Largest magnitude answered to no force, or to no speed: {:.4} m/s^2.",
        evaluation.silence_m_s2
    );
    let silent = evaluation.scores.len() - judged(&evaluation.scores).count();
    if silent > 0 {
        let _ = writeln!(
            text,
            "{silent} of {} materials have nothing to be judged by and count nowhere.",
            evaluation.scores.len()
        );
    }
    text
}

fn levels(settings: &Settings, levels: &[Level]) -> String {
    let losses = match settings.error {
        Aim::Euclidean => "squared errors of magnitudes, and of power",
        Aim::Relative => {
            "a likelihood whose least is at the mean magnitude, and one whose least is at the power"
        }
    };
    let text = format!(
        "Power over the true power of held-out strokes, in dB, mean over materials. The mean of a random \
         magnitude carries {MEAN_GAIN_DB} dB less than its power asks for, and that of a
sure one nothing less: the first two columns are of the true means, without a network, and of the same \
with a gain of {MEAN_GAIN_DB} dB. What is below 0 in the
first is too quiet, what is above 0 in the second is overdriven. The networks were trained on {losses}.

| family | true mean | with gain | network for the mean | with gain | network for power |
|---|---|---|---|---|---|
"
    );
    let signed = |db: Option<f64>| db.map_or_else(|| "-".to_owned(), |db| format!("{db:+.2}"));
    let gained = |db: Option<f64>| signed(db.map(|db| db + MEAN_GAIN_DB));
    let row = |Level { family, exact_mean_db, mean_db, rms_db }: &Level| {
        let [exact, mean] = [*exact_mean_db, *mean_db].map(|db| [signed(db), gained(db)].join(" | "));
        [family.clone(), exact, mean, signed(*rms_db)]
    };
    text + &lines(levels.iter().map(row))
}

fn scatter(families: &[(String, Option<Scatter>)]) -> String {
    let text = String::from(
        "The ratio is mean over root mean square magnitude at one material, force and velocity: 0.886 for \
         noise, 1 for
a steady line. The variance is that of a frame's power over its squared mean; power is the sum of all squared
magnitudes. True figures are over the places of the held-out strokes above. All are weighted by true power
within a material, and are means over materials.

| family | true ratio | network | true variance | network |
|---|---|---|---|---|
",
    );
    let known = |s: &Scatter| {
        [s.ratio, s.ratio_answered, s.variance, s.variance_answered].map(|x| format!("{x:.3}")).join(" | ")
    };
    let row = |(family, scatter): &(String, Option<Scatter>)| {
        [cell(family), scatter.as_ref().map_or("- | - | - | -".to_owned(), known)]
    };
    text + &lines(families.iter().map(row))
}

fn strangers(strangers: &Strangers) -> String {
    let surfaces = &strangers.surfaces;
    let mean = |figure: fn(&Stranger) -> Option<f64>| decibels(average(surfaces.iter().filter_map(figure)));
    let mut text = String::new();
    if let Some(families) = &strangers.families {
        let _ = writeln!(
            text,
            "The material with the nearest vector is of the right family for {} of {} surface{}, and for \
             {} of single images; a linear classifier of image
statistics takes {} of images for a material of the right family; chance is {}.
",
            percent(families.surfaces),
            surfaces.len(),
            if surfaces.len() == 1 { "" } else { "s" },
            percent(families.images),
            percent(families.statistics),
            percent(families.chance),
        );
    }
    let _ = write!(
        text,
        "Mean of |error| in dB, of up to {ALONE} single images each, with the neighbour's vector {}, with \
         the image's own {}, with a blend of the {BLENDED} nearest {}; the best of all stored vectors
would give {}.

| surface | family | neighbour | its family | nearest, dB | own, dB | blend, dB | best, dB |
|---|---|---|---|---|---|---|---|
",
        mean(|s| s.nearest_db),
        mean(|s| s.raw_db),
        mean(|s| s.blend_db),
        mean(|s| s.best_db),
    );
    let row = |s: &Stranger| {
        let family = |family: &Option<String>| cell(family.as_deref().unwrap_or("-"));
        let names = [cell(&s.name), family(&s.family), cell(&s.neighbour.0), family(&s.neighbour.1)];
        let errors = [s.nearest_db, s.raw_db, s.blend_db, s.best_db].map(decibels);
        [names.join(" | "), errors.join(" | ")]
    };
    text + &lines(surfaces.iter().map(row))
}

fn table(scores: &[Score]) -> String {
    let text = String::from(
        "Mean of |error| in dB, as above.

| material | model | 9 of 10 within | bias | (a) mean spectrum | (b) nearest touch | twenty nearest | (c) \
two signals |
|---|---|---|---|---|---|---|---|
",
    );
    let row = |s: &Score| {
        let rivals = [s.constant_db, s.nearest_db, s.smooth_db].map(|db| format!("{db:.2}"));
        let model = format!("{:.2} | {:.2} | {:+.2}", s.model_db, s.p90_db, s.bias_db);
        [cell(&s.material), model, rivals.join(" | "), decibels(s.floor_db)]
    };
    text + &lines(judged(scores).map(row))
}
