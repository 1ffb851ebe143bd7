//! Friedman's test of repeated measures.

use crate::ranks::midranks;
use crate::special::{chi_square_tail, f_tail};
use crate::{Error, Outcome, Variant};

/// Both outcomes of Friedman's test, with the effect size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friedman {
    /// Test by the chi-square approximation, corrected for ties (Friedman 1937). n counts rows.
    pub chi_square: Outcome,
    /// Test by the F approximation (Iman and Davenport 1980). n counts rows.
    ///
    /// The degrees of freedom are k - 1 - 2/n and n - 1 times that (Marozzi 2014), as in Pingouin.
    pub f: Outcome,
    /// Kendall's coefficient of concordance, corrected for ties, 0 to 1 (Kendall and Smith 1939).
    pub w: f64,
}

/// Friedman's test that k conditions do not differ.
///
/// `table` has one row for each person and one column for each condition: at least 2 rows of equal length,
/// at least 3 columns. Rows with a number that is not finite are left out. Both p-values are approximations:
/// with 25 rows, 3 columns and no ties, each rejects 5.2 % of true null hypotheses at the 5 % level.
pub fn friedman<R: AsRef<[f64]>>(table: &[R]) -> Result<Friedman, Error> {
    let conditions = table.first().map_or(0, |row| row.as_ref().len());
    if let Some(row) = table.iter().map(AsRef::as_ref).find(|row| row.len() != conditions) {
        return Err(Error::Lengths(conditions, row.len()));
    }
    let rows: Vec<&[f64]> =
        table.iter().map(AsRef::as_ref).filter(|row| row.iter().all(|v| v.is_finite())).collect();
    if rows.len() < 2 {
        return Err(Error::TooFew { n: rows.len(), least: 2 });
    }
    if conditions < 3 {
        return Err(Error::TooFew { n: conditions, least: 3 });
    }
    let (n, k) = (rows.len() as f64, conditions as f64);
    let center = (k + 1.0) / 2.0;
    let mut sums = vec![0.0; conditions];
    let mut within = 0.0;
    for row in &rows {
        for (sum, rank) in sums.iter_mut().zip(midranks(row)) {
            *sum += rank - center;
            within += (rank - center).powi(2);
        }
    }
    // Squares of all ranks, times n: the squares of the rank sums if all rows ranked alike.
    let most = n * within;
    if most == 0.0 {
        return Err(Error::NoVariation);
    }
    let reached: f64 = sums.iter().map(|s| s * s).sum();
    let w = reached / most;
    let outcome = |statistic, p, variant| Outcome {
        n: rows.len(),
        excluded: table.len() - rows.len(),
        statistic,
        p,
        variant,
    };
    let (chi, freedom) = (n * (k - 1.0) * w, k - 1.0);
    let chi_square = outcome(chi, chi_square_tail(chi, freedom), Variant::FriedmanChiSquare { freedom });
    let (ratio, first) = ((n - 1.0) * reached / (most - reached), freedom - 2.0 / n);
    let freedom = [first, (n - 1.0) * first];
    let f = outcome(ratio, f_tail(ratio, freedom), Variant::FriedmanF { freedom });
    Ok(Friedman { chi_square, f, w })
}
