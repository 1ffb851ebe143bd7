//! Accuracy and timing figures.
