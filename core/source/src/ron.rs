//! A strict RON reader that keeps spans.
