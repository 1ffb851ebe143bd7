//! Corrections for multiple tests.

/// Correction of p-values for multiple tests. Both control the family-wise error rate.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Correction {
    /// Multiplies each p-value by their number (Dunn 1961).
    Bonferroni,
    /// Step-down procedure, never weaker than [`Self::Bonferroni`] (Holm 1979).
    Holm,
}

/// Adjusted p-values of a family of tests.
#[derive(Clone, Debug, PartialEq)]
pub struct Adjusted {
    /// Adjusted p-values, 0 to 1, in the order given. None where the input was no p-value.
    pub p: Vec<Option<f64>>,
    /// Number of p-values in the family.
    pub n: usize,
    /// Number of inputs left out: NaN, or outside 0 to 1.
    pub excluded: usize,
    /// Correction that was made.
    pub correction: Correction,
}

/// Adjusts p-values. A larger p-value never becomes smaller than a smaller one.
pub fn adjust(p: &[f64], correction: Correction) -> Adjusted {
    let mut order: Vec<usize> = (0..p.len()).filter(|&i| (0.0..=1.0).contains(&p[i])).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let n = order.len();
    let mut adjusted = vec![None; p.len()];
    let mut largest: f64 = 0.0;
    for (rank, &i) in order.iter().enumerate() {
        let factor = if correction == Correction::Holm { n - rank } else { n };
        largest = largest.max(p[i] * factor as f64).min(1.0);
        adjusted[i] = Some(largest);
    }
    Adjusted { p: adjusted, n, excluded: p.len() - n, correction }
}
