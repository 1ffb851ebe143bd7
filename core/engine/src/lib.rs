//! Runs a schedule tick by tick.
