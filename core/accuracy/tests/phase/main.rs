//! Phase retrieval on the shared vectors in `tests/data/phase`, against published scores.

mod plain;
mod sample_commit;
mod spsi;
mod vectors;
