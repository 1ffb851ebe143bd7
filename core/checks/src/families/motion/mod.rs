//! A stylus that does what no hand does, or whose places come late, twice or not at all.

mod gate;
mod stage;
mod teleport;
mod times;

use crate::case::{Case, Family};

pub(super) const CASES: &[Case] = &[
    Family::Motion.case(
        "teleport",
        true,
        teleport::teleport,
        [
            "the stylus is 200 mm further from one tick to the next, pressed down",
            "all is finite, no node fails, and 1 s later the actuator does what it does without the jump, within 1 dB, as draws of the same noise may differ, or 1 % of its peak",
        ],
    ),
    Family::Motion.case(
        "one_count_at_rest",
        true,
        gate::one_count,
        [
            "a hand rests on a wall, and x and y of its sensor flicker by one count of 0.055 mm (27.5 mm/s at 500 Hz before the filter), at once or in turns, at every period up to 60 ticks and by chance",
            "the gate stays shut: a low-pass w makes 1.05 sqrt(2) D w e^(-pi/4) of it at most, 4.7 mm/s at 20 Hz; of one that opens with speed, w is that at the speed at which the gate opens",
        ],
    ),
    Family::Motion.case(
        "around_the_gate",
        true,
        gate::around,
        [
            "the stylus moves, after a start of 0.5 s, 2 % slower than the gate opens (4.9 of 5 mm/s), then 2 % faster, then now this and now that, by an ideal sensor; and at 0.5 to 1.1 of that speed along, between and across the steps of one of 0.055 mm",
            "the gate stays shut at the one and opens once, within 0.3 s after it, at the other, and does not shut again between the two; in steps, whose ripple (up to 3 mm/s from crest to crest behind a 20 Hz filter) may open it sooner, it changes at most once",
        ],
    ),
    Family::Motion.case(
        "sampling_times",
        true,
        times::sampling,
        [
            "a circle at 60 mm/s is read at times that are off by up to a quarter of a tick, or a whole tick late now and then, or every place twice",
            "no node fails, the gate stays open, the speed is within 30 % (12 % a tick late and 14 % of jitter at 500 Hz by the step response of a 20 Hz filter, w e^(-pi/4) T; that where it is more, below 190 Hz), and 1 s later the actuator does what it does without, within 1 dB or 2 % of its peak",
        ],
    ),
    Family::Motion.case(
        "lost_ticks",
        true,
        times::lost,
        [
            "the engine loses 1, 2, 3 ticks and so on, 50 ms apart for 2.5 s, while the stylus goes on round a circle at 60 mm/s",
            "the speed is never above 66 mm/s, no node fails, and 1 s later the actuator does what it does without, within 1 dB or 2 % of its peak",
        ],
    ),
    Family::Motion.case(
        "a_gap_of_10_ms",
        true,
        times::gap,
        [
            "for 10 ms no place comes, once held as it was and once marked as not to be trusted, while the stylus goes on round a circle at 60 mm/s",
            "no node fails, the drive makes no larger step than a sine of 1000 Hz at its usual peak, no speed is told above 66 mm/s after a gap that was marked (97 after one that was not: 10 ms times w e^(-pi/4) more at 20 Hz), and 1 s later the actuator does what it does without, within 1 dB or 2 % of its peak",
        ],
    ),
];
