//! Monic polynomials `1 + a_1 z^-1 + .. + a_p z^-p`, given by `a_1 .. a_p`.

/// Whether all roots lie within the unit circle. The step-down recursion tells: every reflection
/// coefficient is smaller than 1. False for coefficients that are not finite.
pub fn is_stable(a: &[f64]) -> bool {
    let mut lower = a.to_vec();
    while let Some(k) = lower.pop() {
        if k.is_nan() || k.abs() >= 1.0 {
            return false;
        }
        step_down(&mut lower, k);
    }
    true
}

/// Steps from order p down to p - 1. `lower` holds the coefficients without the last, which is `k`.
fn step_down(lower: &mut [f64], k: f64) {
    let scale = 1.0 / (1.0 - k * k);
    let n = lower.len();
    for i in 0..n.div_ceil(2) {
        let (x, y) = (lower[i], lower[n - 1 - i]);
        lower[i] = (x - k * y) * scale;
        lower[n - 1 - i] = (y - k * x) * scale;
    }
}

/// Autocovariance at lags `0 .. out.len()` of unit white noise through `1 / A`, `A` stable.
///
/// Stepping down gives the predictors of all lower orders. Each gives one more lag (Levinson's
/// recursion, run backwards, then forwards).
pub(super) fn autocovariance(a: &[f64], out: &mut [f64]) {
    let mut predictors = vec![a.to_vec()];
    let mut variance = 1.0;
    for _ in 0..a.len() {
        let mut lower = predictors.last().cloned().unwrap_or_default();
        let k = lower.pop().unwrap_or(0.0);
        variance /= 1.0 - k * k;
        step_down(&mut lower, k);
        predictors.push(lower);
    }
    predictors.reverse();
    for lag in 0..out.len() {
        let predictor = predictors[lag.min(a.len())].iter().enumerate();
        out[lag] =
            if lag == 0 { variance } else { -predictor.map(|(i, c)| c * out[lag - 1 - i]).sum::<f64>() };
    }
}
