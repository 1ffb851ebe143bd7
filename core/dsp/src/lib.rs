//! Windows, transforms, phase retrieval, overlap-add, resampling, filters.
