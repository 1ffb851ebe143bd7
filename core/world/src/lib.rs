//! Strokes, surfaces, materials and actuators.
