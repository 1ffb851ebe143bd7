//! Robustness of `rtpghi`.

mod common;
#[path = "common/survival.rs"]
mod survival;

use rtpghi::Rtpghi;

const BOTH: [[(&str, f64); 1]; 2] = [[("look_ahead", 0.0)], [("look_ahead", 1.0)]];

#[test]
fn rtpghi_keeps_every_magnitude_of_odd_frames() {
    BOTH.iter().for_each(|p| survival::odd_frames_come_out::<Rtpghi>(p));
}

#[test]
fn rtpghi_puts_out_each_frame_beside_missing_ones() {
    BOTH.iter().for_each(|p| survival::frames_beside_gaps_come_out::<Rtpghi>(p));
}

#[test]
fn rtpghi_counts_bad_magnitudes() {
    BOTH.iter().for_each(|p| survival::bad_magnitudes_are_counted::<Rtpghi>(p));
}

#[test]
fn rtpghi_advances_a_tone_by_the_true_hop() {
    BOTH.iter().for_each(|p| survival::a_tone_runs_on::<Rtpghi>(p, 2e-3));
}

#[test]
fn rtpghi_does_not_drift_in_a_million_frames() {
    BOTH.iter().for_each(|p| survival::hours_do_not_wear_the_phase::<Rtpghi>(p, 1e-6));
}

#[test]
fn reset_rtpghi_equals_a_fresh_one() {
    BOTH.iter().for_each(|p| survival::a_reset_node_is_a_fresh_one::<Rtpghi>(p));
}

#[test]
fn restored_rtpghi_continues() {
    survival::what_is_remembered_goes_on::<Rtpghi>(&BOTH[0], &BOTH[1]);
    survival::what_is_remembered_goes_on::<Rtpghi>(&BOTH[1], &BOTH[0]);
}
