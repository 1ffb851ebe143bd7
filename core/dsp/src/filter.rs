//! Recursive filters.
