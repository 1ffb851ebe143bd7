//! Midranks.

/// Midranks, starting at 1. Equal values share the mean of their ranks.
pub(crate) fn midranks(x: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..x.len()).collect();
    order.sort_by(|&a, &b| x[a].total_cmp(&x[b]));
    let mut ranks = vec![0.0; x.len()];
    let mut before = 0;
    for group in order.chunk_by(|&a, &b| x[a] == x[b]) {
        for &i in group {
            ranks[i] = before as f64 + (group.len() as f64 + 1.0) / 2.0;
        }
        before += group.len();
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tied_values_share_their_mean_rank() {
        assert_eq!(midranks(&[3.0, 0.0, 3.0, -0.0, 5.0]), [3.5, 1.5, 3.5, 1.5, 5.0]);
    }
}
