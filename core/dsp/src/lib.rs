//! Windows, transforms, phase retrieval, overlap-add, resampling and filters: kernels without a graph.

pub mod filter;
