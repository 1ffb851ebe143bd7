//! Interpolation between rows at any spacing.

/// Slopes of every axis at the rows; see [`pchip_slopes`].
pub(super) fn slopes(time: &[f64], position: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let [x, y, z] = [0, 1, 2].map(|axis| {
        let values: Vec<f64> = position.iter().map(|p| p[axis]).collect();
        pchip_slopes(time, &values)
    });
    x.into_iter().zip(y).zip(z).map(|((x, y), z)| [x, y, z]).collect()
}

/// Slopes of the shape-preserving piecewise cubic (PCHIP) through `(x, y)`: F. N. Fritsch, J. Butland, "A
/// method for constructing local monotone piecewise cubic interpolants", SIAM J. Sci. Stat. Comput. 5, 1984,
/// with three-point ends limited as there. `x` rises strictly. Both have one length, 2 or more.
fn pchip_slopes(x: &[f64], y: &[f64]) -> Vec<f64> {
    let step: Vec<f64> = x.windows(2).map(|w| w[1] - w[0]).collect();
    let secant: Vec<f64> = y.windows(2).zip(&step).map(|(w, h)| (w[1] - w[0]) / h).collect();
    let mut slope = vec![0.0; y.len()];
    let ends = secant.len();
    if ends <= 1 {
        slope.fill(secant.first().copied().unwrap_or(0.0));
        return slope;
    }
    for k in 1..ends {
        let (a, b) = (secant[k - 1], secant[k]);
        if a * b > 0.0 {
            let (wa, wb) = (2.0 * step[k] + step[k - 1], step[k] + 2.0 * step[k - 1]);
            slope[k] = (wa + wb) / (wa / a + wb / b);
        }
    }
    slope[0] = end_slope(step[0], step[1], secant[0], secant[1]);
    slope[ends] = end_slope(step[ends - 1], step[ends - 2], secant[ends - 1], secant[ends - 2]);
    slope
}

/// Slope at an end, from the two nearest steps and secants, nearest first.
fn end_slope(h0: f64, h1: f64, m0: f64, m1: f64) -> f64 {
    let d = ((2.0 * h0 + h1) * m0 - h0 * m1) / (h0 + h1);
    if d * m0 <= 0.0 {
        0.0
    } else if m0 * m1 <= 0.0 && d.abs() > 3.0 * m0.abs() {
        3.0 * m0
    } else {
        d
    }
}

/// The cubic with values `y0`, `y1` and slopes `d0`, `d1` over a step `h`, at the part `s` of it.
pub(super) fn hermite(y0: f64, y1: f64, d0: f64, d1: f64, h: f64, s: f64) -> f64 {
    let rise = y1 - y0;
    let (a, b) = (h * d0 - rise, rise - h * d1);
    y0 + s * (rise + (1.0 - s) * ((1.0 - s) * a + s * b))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ```python
    /// from scipy.interpolate import PchipInterpolator as P
    /// x = [0, 0.021, 0.05, 0.062, 0.11, 0.14]; y = [0, 1.5, 2.0, 5.0, 4.0, 4.5]
    /// p = P(x, y); print(p.derivative()(x), p([0.01, 0.04, 0.055, 0.08, 0.12, 0.139]))
    /// ```
    #[test]
    fn slopes_and_values_are_those_of_scipy() {
        let x = [0.0, 0.021, 0.05, 0.062, 0.11, 0.14];
        let y = [0.0, 1.5, 2.0, 5.0, 4.0, 4.5];
        let d = pchip_slopes(&x, &y);
        for (got, want) in d.iter().zip(SCIPY_SLOPES) {
            assert!((got - want).abs() < 1e-9 * (1.0 + want.abs()), "{d:?}");
        }
        for (t, want) in [0.01, 0.04, 0.055, 0.08, 0.12, 0.139].into_iter().zip(SCIPY_VALUES) {
            let i = x.partition_point(|v| *v <= t) - 1;
            let h = x[i + 1] - x[i];
            let got = hermite(y[i], y[i + 1], d[i], d[i + 1], h, (t - x[i]) / h);
            assert!((got - want).abs() < 1e-9, "{t}: {got} {want}");
        }
    }

    const SCIPY_SLOPES: [f64; 6] =
        [94.18719211822662, 28.713629402756503, 36.67262969588551, 0.0, 0.0, 31.08974358974358];
    const SCIPY_VALUES: [f64; 6] = [
        0.883275209212878,
        1.7700956733457556,
        3.1908666269131376,
        4.68359375,
        4.060541310541311,
        4.469318732193732,
    ];
}
