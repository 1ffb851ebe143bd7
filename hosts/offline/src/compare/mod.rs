//! Phase-retrieval methods on the same magnitudes: [`contest`] runs them over the [`vectors`], and
//! [`report`] shows its rows.

pub mod contest;
pub mod report;
#[cfg(test)]
mod tests;
pub mod vectors;
