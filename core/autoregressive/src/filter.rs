use asperity_dsp::Complex;
use asperity_numbers::polar;

/// Most coefficients of either polynomial.
pub const MAX_ORDER: usize = 64;

/// A texture at one speed and force: level of the noise and the two polynomials, in place: nothing is
/// allocated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filter {
    /// Standard deviation of the noise in m/s^2; 0 is silence.
    pub deviation: f64,
    /// Factor on the noise and on its moving average.
    pub gain: f64,
    orders: [usize; 2],
    ar: [f64; MAX_ORDER],
    ma: [f64; MAX_ORDER],
}

impl Filter {
    /// A silent filter of orders `[p, q]`, each at most [`MAX_ORDER`].
    pub(super) fn silent(orders: [usize; 2]) -> Self {
        let orders = orders.map(|n| n.min(MAX_ORDER));
        Self { deviation: 0.0, gain: 1.0, orders, ar: [0.0; MAX_ORDER], ma: [0.0; MAX_ORDER] }
    }

    /// A filter from `a_1 .. a_p`, `b_1 .. b_q`, at most [`MAX_ORDER`] each, and the noise's deviation in
    /// m/s^2, with a gain of 1. Stability is not checked.
    pub fn new(ar: &[f64], ma: &[f64], deviation: f64) -> Self {
        let mut filter = Self::silent([ar.len(), ma.len()]);
        filter.ar.iter_mut().zip(ar).for_each(|(to, x)| *to = *x);
        filter.ma.iter_mut().zip(ma).for_each(|(to, x)| *to = *x);
        filter.deviation = deviation;
        filter
    }

    /// `a_1 .. a_p`.
    pub fn ar(&self) -> &[f64] {
        &self.ar[..self.orders[0]]
    }

    /// `b_1 .. b_q`.
    pub fn ma(&self) -> &[f64] {
        &self.ma[..self.orders[1]]
    }

    /// Both polynomials, to write.
    pub(super) fn coefficients(&mut self) -> [&mut [f64]; 2] {
        [&mut self.ar[..self.orders[0]], &mut self.ma[..self.orders[1]]]
    }

    /// Power spectrum `S(w)` at `w` radians a sample, in (m/s^2)^2; its mean over all `w` is the variance.
    pub fn power(&self, w: f64) -> f64 {
        let at = |coefficients: &[f64]| {
            let z = polar(1.0, -w);
            coefficients.iter().rev().fold(Complex::new(0.0, 0.0), |sum, c| (sum + c) * z) + 1.0
        };
        (self.deviation * self.gain).powi(2) * at(self.ma()).norm_sqr() / at(self.ar()).norm_sqr()
    }

    /// Exact variance of the signal in (m/s^2)^2.
    pub fn variance(&self) -> f64 {
        let mut variance = [0.0];
        self.autocovariance(&mut variance);
        variance[0]
    }

    /// Exact autocovariance of the signal at lags 0, 1, .. `out.len() - 1`, in (m/s^2)^2.
    pub fn autocovariance(&self, out: &mut [f64]) {
        let q = self.ma().len();
        let mut of_ar = vec![0.0; out.len() + q];
        autocovariance(self.ar(), &mut of_ar);
        let b = |i: usize| if i == 0 { 1.0 } else { self.ma.get(i - 1).copied().unwrap_or(0.0) };
        // Correlation of the moving average's coefficients with themselves, over lags -q to q.
        let spread: Vec<f64> = (0..=q).map(|d| (d..=q).map(|i| b(i) * b(i - d)).sum()).collect();
        let scale = (self.deviation * self.gain).powi(2);
        for (lag, r) in out.iter_mut().enumerate() {
            let sides: f64 = (1..=q).map(|d| spread[d] * (of_ar[lag + d] + of_ar[lag.abs_diff(d)])).sum();
            *r = scale * (spread[0] * of_ar[lag] + sides);
        }
    }
}

/// Whether all roots of `1 + a_1 z^-1 + ..` lie within the unit circle. The step-down recursion tells: every
/// reflection coefficient is smaller than 1. False for coefficients that are not finite.
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
fn autocovariance(a: &[f64], out: &mut [f64]) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn near(found: &[f64], want: impl Fn(usize) -> f64) {
        for (i, x) in found.iter().enumerate() {
            let y = want(i);
            assert!((x - y).abs() < 1e-12 * (1.0 + y.abs()), "lag {i}: {x}, not {y}");
        }
    }

    #[test]
    fn first_order_has_textbook_covariance() {
        let mut r = [0.0; 20];
        // var / (1 - phi^2) phi^m
        Filter::new(&[-0.9], &[], 2.0).autocovariance(&mut r);
        near(&r, |m| 4.0 / (1.0 - 0.81) * 0.9f64.powi(m as i32));
        // MA(1): 1 + b^2, b, 0, ..
        Filter::new(&[], &[0.5], 1.0).autocovariance(&mut r);
        near(&r, |m| [1.25, 0.5].get(m).copied().unwrap_or(0.0));
        // ARMA(1, 1): r0 = (1 + 2 phi b + b^2) / (1 - phi^2), r1 = (1 + phi b)(phi + b) / (1 - phi^2)
        Filter::new(&[-0.6], &[0.3], 1.0).autocovariance(&mut r);
        let (r0, r1) = ((1.0 + 0.36 + 0.09) / 0.64, 1.18 * 0.9 / 0.64);
        near(&r, |m| if m == 0 { r0 } else { r1 * 0.6f64.powi(m as i32 - 1) });
    }

    #[test]
    fn covariance_is_the_transform_of_the_spectrum() {
        let ar = [-1.1, 0.9, -0.3, 0.1];
        assert!(is_stable(&ar));
        let filter = Filter::new(&ar, &[0.4, -0.2, 0.1], 1.5);
        let mut r = [0.0; 30];
        filter.autocovariance(&mut r);
        // A rectangle sum over one period of a smooth function.
        let n = 4096;
        near(&r, |m| {
            let sum: f64 = (0..n)
                .map(|i| {
                    let w = TAU * i as f64 / n as f64;
                    filter.power(w) * (w * m as f64).cos()
                })
                .sum();
            sum / n as f64
        });
    }
}
