//! Random numbers by index: skipping some does not change later ones.
//!
//! A counter is hashed by the finaliser of SplitMix64 (Steele, Lea, Flood 2014), which passes BigCrush
//! on successive counters.

/// Seed of a node from the graph's seed and the node's id. Two nodes differ, and renaming the graph
/// changes nothing.
pub fn seed_of(graph_seed: u64, id: &str) -> u64 {
    id.bytes().fold(mix(graph_seed), |h, b| mix(h ^ u64::from(b)))
}

/// A uniform 64-bit number for a seed and an index.
pub fn bits(seed: u64, index: u64) -> u64 {
    mix(mix(seed).wrapping_add(index.wrapping_mul(STEP)))
}

/// A uniform number in [0, 1) for a seed and an index.
pub fn uniform(seed: u64, index: u64) -> f64 {
    (bits(seed, index) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// Distance between successive states: 2^64 over the golden ratio, made odd.
pub const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// The number after a state of SplitMix64: the state advances by a step and is hashed.
#[inline]
pub fn mix(state: u64) -> u64 {
    let mut z = state.wrapping_add(STEP);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uniform_numbers_have_uniform_mean_and_variance() {
        let n = 100_000;
        let xs: Vec<f64> = (0..n).map(|i| uniform(7, i)).collect();
        let mean = xs.iter().sum::<f64>() / n as f64;
        let var = xs.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n as f64;
        assert!((mean - 0.5).abs() < 4e-3 && (var - 1.0 / 12.0).abs() < 1e-3, "{mean} {var}");
        assert!(xs.iter().all(|x| (0.0..1.0).contains(x)));
    }

    #[test]
    fn nodes_of_one_graph_have_different_seeds() {
        assert_ne!(seed_of(1, "a"), seed_of(1, "b"));
        assert_ne!(seed_of(1, "a"), seed_of(2, "a"));
        assert_eq!(seed_of(1, "a"), seed_of(1, "a"));
    }
}
