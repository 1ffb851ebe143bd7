//! The sender's clock, mapped to ours.
//!
//! A packet cannot arrive before it was sent, so the packet that was fastest tells most: the offset is the least difference between
//! arrival and the sender's time that was seen, and creeps up so that a sender whose clock runs slower is followed (V. Paxson, "On
//! calibrating measurements of packet transit times", SIGMETRICS 1998, is about the same minimum). Jitter of the network
//! then does not move the samples. A constant delay, or a lead that a sender adds to its time tags, cannot be seen and is taken out.

/// How fast the offset may creep up: 200 parts in a million, twice what the crystals of two machines differ by.
const CREEP: f64 = 2e-4;
/// A sample that would be older than this, or a sender's time that steps back by as much, means that its clock was set anew.
const ANEW_NS: f64 = 1e9;

/// Maps a sender's times to ours.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    /// The offset in ns, when it was last looked at, and the sender's time then.
    state: Option<(f64, u64, f64)>,
}

/// What a sender's time comes to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Mapped {
    /// Our time, at most the arrival.
    At(u64),
    /// The same, and the sender's clock was set anew: what came before does not join on.
    Anew(u64),
    /// Older than what came before.
    Late,
}

impl Clock {
    /// Our time of what the sender says was at `sent_ns` and arrived at `arrived_ns`. Both finite.
    pub(super) fn map(&mut self, sent_ns: f64, arrived_ns: u64) -> Mapped {
        let difference = arrived_ns as f64 - sent_ns;
        let Some((offset, then, before)) = self.state else {
            self.state = Some((difference, arrived_ns, sent_ns));
            return Mapped::At(arrived_ns);
        };
        let crept = offset + CREEP * arrived_ns.saturating_sub(then) as f64;
        if before - sent_ns > ANEW_NS || difference - crept > ANEW_NS {
            self.state = Some((difference, arrived_ns, sent_ns));
            return Mapped::Anew(arrived_ns);
        }
        if sent_ns < before {
            return Mapped::Late;
        }
        let offset = crept.min(difference);
        // A sender that leaps ahead would drag the offset down for good.
        let leapt = sent_ns - before > arrived_ns.saturating_sub(then) as f64 + ANEW_NS;
        self.state = Some((offset, arrived_ns, sent_ns));
        let ours = ((sent_ns + offset).max(0.0) as u64).min(arrived_ns);
        if leapt { Mapped::Anew(ours) } else { Mapped::At(ours) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jitter_of_the_network_does_not_move_the_samples_and_a_slow_clock_is_followed() {
        // 250 samples a second for two minutes by a clock that is 80 ppm slow and hours off; 1 ms of delay, up to 8 ms of jitter.
        let mut clock = Clock::default();
        let mut state = 1u64;
        let mut worst = (0.0f64, 0.0f64);
        for k in 0..30_000u64 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let jitter = (state >> 40) as f64 / (1u64 << 24) as f64 * 8e6;
            let truth = 1e9 + k as f64 * 4e6;
            let sent = truth * (1.0 - 80e-6) + 1e13;
            let arrived = (truth + 1e6 + jitter) as u64;
            let Mapped::At(ours) = clock.map(sent, arrived) else { panic!("sample {k}") };
            if k > 250 {
                let error = ours as f64 - (truth + 1e6);
                worst = (worst.0.min(error), worst.1.max(error));
            }
        }
        assert!(worst.0 > -0.5e6 && worst.1 < 0.5e6, "{worst:?} ns");
    }

    #[test]
    fn a_senders_clock_that_is_set_back_begins_anew_and_a_packet_out_of_order_is_late() {
        let mut clock = Clock::default();
        assert_eq!(clock.map(5e9, 1_000_000), Mapped::At(1_000_000));
        assert_eq!(clock.map(5.010e9, 11_000_000), Mapped::At(11_000_000));
        assert_eq!(clock.map(5.005e9, 12_000_000), Mapped::Late);
        assert_eq!(clock.map(5.020e9, 21_000_000), Mapped::At(21_000_000));
        assert_eq!(clock.map(1e9, 30_000_000), Mapped::Anew(30_000_000));
        assert_eq!(clock.map(1.010e9, 40_000_000), Mapped::At(40_000_000));
        // Set ahead by an hour, then going on as before.
        let Mapped::Anew(at) = clock.map(3600e9, 50_000_000) else { panic!() };
        assert_eq!(at, 50_000_000);
        let Mapped::At(at) = clock.map(3600.01e9, 60_000_000) else { panic!() };
        assert!((59_990_000..=60_000_000).contains(&at), "{at}");
    }

    #[test]
    fn wild_times_do_no_harm() {
        let mut clock = Clock::default();
        for (k, sent) in [1e300, -1e300, 0.0, f64::MAX, f64::MIN, 1e18, -5.0].into_iter().enumerate() {
            let arrived = 1_000_000 * k as u64;
            if let Mapped::At(at) | Mapped::Anew(at) = clock.map(sent, arrived) {
                assert!(at <= arrived);
            }
        }
    }
}
