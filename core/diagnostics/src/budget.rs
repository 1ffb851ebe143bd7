//! A limit on the program's memory, checked before large allocations.
//!
//! A program sets it once, with a function that counts the bytes it holds. Code that allocates in
//! proportion to a file or a parameter asks [`needs`] first, and passes the error on. Nothing is
//! reserved: threads that ask at the same time may exceed the limit by one request. Without a call of
//! [`set`] there is no limit.

use std::sync::OnceLock;

use crate::Diagnostic;

static BUDGET: OnceLock<Budget> = OnceLock::new();

struct Budget {
    most: u64,
    held: fn() -> u64,
}

/// Limits the program to `most` bytes; `held` counts the bytes it holds. Later calls change nothing.
pub fn set(most: u64, held: fn() -> u64) {
    let _ = BUDGET.set(Budget { most, held });
}

/// Checks whether `bytes` more are allowed. Error: the program would exceed its limit. The caller adds the
/// position.
pub fn needs(bytes: u64) -> Result<(), Diagnostic> {
    BUDGET.get().map_or(Ok(()), |budget| budget.needs(bytes))
}

impl Budget {
    fn needs(&self, bytes: u64) -> Result<(), Diagnostic> {
        let wanted = (self.held)().saturating_add(bytes);
        if wanted <= self.most {
            return Ok(());
        }
        let [wanted, most] = [wanted, self.most].map(|bytes| bytes.div_ceil(1 << 20));
        let what = format!("not enough memory: {wanted} MiB would be taken, and {most} MiB are the limit");
        Err(Diagnostic::new(what).help("`--memory` sets another limit"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn budget_counts_what_is_held() {
        let budget = Budget { most: 100 << 20, held: || 60 << 20 };
        assert!(budget.needs(40 << 20).is_ok());
        let told = budget.needs((40 << 20) + 1).unwrap_err().message;
        assert_eq!(told, "not enough memory: 101 MiB would be taken, and 100 MiB are the limit");
        assert!(budget.needs(u64::MAX).is_err());
    }
}
