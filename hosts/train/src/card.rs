//! The card that is written beside a network.

use std::fmt::Write as _;

use crate::evaluation::{AUDIBLE_M_S2, Evaluation, GATE_MM_S, RANGE_DB, overall};
use crate::network::NetworkWeights;
use crate::training::Settings;
use asperity_dataset::{MAX_FORCE_N, MAX_SPEED_MM_S};

/// The evaluation as a table in Markdown.
pub(crate) fn table(evaluation: &Evaluation) -> String {
    let mut text = String::from(
        "| material | mean error, dB | 9 of 10 within, dB | bias, dB | mean spectrum alone, dB |\n|---|---|---|---|---|\n",
    );
    // writing to a String cannot fail
    for s in &evaluation.scores {
        let _ = writeln!(
            text,
            "| {} | {:.2} | {:.2} | {:+.2} | {:.2} |",
            s.material, s.mean_db, s.p90_db, s.bias_db, s.baseline_db
        );
    }
    let (mean, baseline) = overall(evaluation);
    let _ = writeln!(text, "| all | {mean:.2} | | | {baseline:.2} |");
    text
}

/// The card, in Markdown.
pub(crate) fn write(
    settings: &Settings,
    weights: &NetworkWeights,
    evaluation: &Evaluation,
    onnx: String,
    library: String,
) -> String {
    let Settings { steps, batch, seed, learning_rate } = settings;
    format!(
        "# {onnx}

A texture network with the layer sizes of Heravi et al. 2024: {parameters} parameters, {multiply_adds}
multiply-adds an evaluation. Inputs are `force` [1, 10] in N, `speed` [1, 20] in mm/s (10 vx, then 10 vy) and
`texture` [1, 256], a vector of `{library}`; histories are oldest first, 2 ms apart, zeros before the start. The
output `magnitudes` [1, 100] are the amplitudes in m/s^2 (2 |sum w x| / sum w, Hann window of 0.1 s) of the next
0.1 s of acceleration at 10, 20, .. 1000 Hz. Scaling is folded into the weights.

## What it knows

Twelve made materials, and nothing measured: it was trained on a law, which stands in the documentation of
`asperity_world::material`. Roughness has a spatial spectrum; speed turns it into a temporal one; level grows with
force and speed; hand and tool shape the rest. Direction does not matter to the law. Vectors other than the twelve
in `{library}` were never trained, and answers to them mean nothing.

Targets were the law's expected magnitudes after the last 20 ms of speed and force, which are taken to go on
(newest samples weigh most). Being means of Rayleigh-distributed magnitudes, they carry pi/4 of the signal's
power: a signal of just these magnitudes is 1.05 dB softer than the law's, and phase retrieval loses more, since
so smooth a frame belongs to no signal. Inputs were what the chain measures:
positions rounded to 0.055 mm, differences at 500 Hz, a second-order 20 Hz low-pass; the target took the same
filter without the rounding. Trained range: speeds of 0 to {MAX_SPEED_MM_S} mm/s in any direction, forces of 0 to
{MAX_FORCE_N} N, movement at 0.1 to 4 Hz, tremor of 8 to 12 Hz, contact made and lost, partly filled histories.

Made by `asperity-train --steps {steps} --batch {batch} --seed {seed} --learning-rate {learning_rate}`.

## How good

Error against the law's expected magnitudes on strokes of another kind than those trained (zigzags, circles and
lines at mean speeds of 20 to 220 mm/s and 0.4 to 3 N, with approach and lift-off), {frames} frames a material, frames
above {GATE_MM_S} mm/s in contact, bins of at least {AUDIBLE_M_S2} m/s^2 and within {RANGE_DB} dB of the frame's largest. The
last column is a baseline: always the material's mean spectrum over these very frames.

{table}
Largest magnitude answered to no force, or to no speed, over all materials: {silence:.5} m/s^2.
",
        parameters = weights.parameters(),
        multiply_adds = weights.multiply_adds(),
        frames = evaluation.frames,
        table = table(evaluation),
        silence = evaluation.silence_m_s2,
    )
}
