/// A square matrix, row by row.
pub(super) type Matrix<const N: usize> = [[f64; N]; N];

/// `e^A`: the Taylor series of `A / 2^s`, whose norm is at most 1/4, and `s` squares of it. Of a matrix whose last rows are 0 it carries a linear
/// system over a time in which its inputs are constant, exactly.
pub(super) fn exponential<const N: usize>(a: &Matrix<N>) -> Matrix<N> {
    let norm = a.iter().map(|row| row.iter().map(|x| x.abs()).sum::<f64>()).fold(0.0, f64::max);
    let squares = if norm > 0.25 { (norm / 0.25).log2().ceil().min(60.0) as i32 } else { 0 };
    let scaled = a.map(|row| row.map(|x| x * 0.5_f64.powi(squares)));
    let mut sum = identity::<N>();
    let mut term = identity::<N>();
    // 1 / 4^18 / 18! is below 1e-26.
    for k in 1..=18 {
        term = product(&term, &scaled).map(|row| row.map(|x| x / f64::from(k)));
        for (to, from) in sum.as_flattened_mut().iter_mut().zip(term.as_flattened()) {
            *to += from;
        }
    }
    (0..squares).fold(sum, |power, _| product(&power, &power))
}

fn identity<const N: usize>() -> Matrix<N> {
    std::array::from_fn(|i| std::array::from_fn(|k| if i == k { 1.0 } else { 0.0 }))
}

fn product<const N: usize>(a: &Matrix<N>, b: &Matrix<N>) -> Matrix<N> {
    std::array::from_fn(|i| std::array::from_fn(|k| (0..N).map(|j| a[i][j] * b[j][k]).sum()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_closed_form_of_a_rotation_that_shrinks_and_of_a_ramp() {
        for (s, w) in [(-0.3_f64, 2.0_f64), (-40.0, 300.0), (0.0, 1e-6)] {
            let e = exponential(&[[s, w], [-w, s]]);
            let want = [[w.cos(), w.sin()], [-w.sin(), w.cos()]].map(|row| row.map(|x| s.exp() * x));
            for (a, b) in e.as_flattened().iter().zip(want.as_flattened()) {
                assert!((a - b).abs() < 1e-12, "{s} {w}: {a}, not {b}");
            }
        }
        // x' = v, v' = u: the series ends.
        let e = exponential(&[[0.0, 3.0, 0.0], [0.0, 0.0, 3.0], [0.0, 0.0, 0.0]]);
        assert!((e[0][2] - 4.5).abs() < 1e-14 && (e[0][1] - 3.0).abs() < 1e-14 && e[2] == [0.0, 0.0, 1.0]);
    }
}
