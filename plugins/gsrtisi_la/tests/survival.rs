//! Robustness of `gsrtisi_la`.

#[path = "../../rtpghi/tests/common/mod.rs"]
mod common;
#[path = "../../rtpghi/tests/common/survival.rs"]
mod survival;

use gsrtisi_la::GsrtisiLa;

const SETTINGS: [[(&str, f64); 2]; 3] = [
    [("look_ahead", 0.0), ("iterations", 1.0)],
    [("look_ahead", 1.0), ("iterations", 2.0)],
    [("look_ahead", 4.0), ("iterations", 4.0)],
];

#[test]
fn gsrtisi_la_keeps_every_magnitude_of_odd_frames() {
    SETTINGS.iter().for_each(|p| survival::odd_frames_come_out::<GsrtisiLa>(p));
}

#[test]
fn gsrtisi_la_puts_out_each_frame_beside_missing_ones() {
    SETTINGS.iter().for_each(|p| survival::frames_beside_gaps_come_out::<GsrtisiLa>(p));
}

#[test]
fn gsrtisi_la_counts_bad_magnitudes() {
    SETTINGS.iter().for_each(|p| survival::bad_magnitudes_are_counted::<GsrtisiLa>(p));
}

#[test]
fn gsrtisi_la_advances_a_tone_by_the_true_hop() {
    SETTINGS.iter().for_each(|p| survival::a_tone_runs_on::<GsrtisiLa>(p, 2e-3));
}

#[test]
fn gsrtisi_la_is_stable_for_a_million_frames() {
    SETTINGS[..2].iter().for_each(|p| survival::hours_do_not_wear_the_phase::<GsrtisiLa>(p, 1e-3));
}

#[test]
fn reset_gsrtisi_la_equals_a_fresh_one() {
    SETTINGS.iter().for_each(|p| survival::a_reset_node_is_a_fresh_one::<GsrtisiLa>(p));
}

#[test]
fn restored_gsrtisi_la_continues() {
    survival::what_is_remembered_goes_on::<GsrtisiLa>(&SETTINGS[2], &SETTINGS[1]);
    survival::what_is_remembered_goes_on::<GsrtisiLa>(&SETTINGS[0], &SETTINGS[2]);
}
