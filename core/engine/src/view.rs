//! A node's view of the buffers.

use std::ops::Range;

use asperity_node::{Buffer, InputRef, Inputs};

/// Splits the buffers into a node's inputs and its own outputs.
pub(crate) fn split<'b>(
    buffers: &'b mut [Buffer],
    outputs: &Range<usize>,
    inputs: &'b [InputRef],
) -> (Inputs<'b>, &'b mut [Buffer]) {
    let (before, rest) = buffers.split_at_mut(outputs.start);
    let (own, after) = rest.split_at_mut(outputs.len());
    (Inputs::new(before, after, outputs.end, inputs), own)
}

/// Whether an input that wakes carries something.
pub(crate) fn wakened(inputs: Inputs<'_>, wakes: &[usize]) -> bool {
    wakes.iter().any(|&i| inputs.buffer(i).is_some_and(|b| !b.is_silent()))
}

/// Whether a buffer holds no NaN or infinity in this tick.
pub(crate) fn is_finite(buffer: &Buffer) -> bool {
    const EXPONENT: u32 = 0x7f80_0000;
    // On bits, and without an early exit, so that it vectorises.
    fn all(xs: impl Iterator<Item = f32>) -> bool {
        !xs.fold(false, |bad, x| bad | (x.to_bits() & EXPONENT == EXPONENT))
    }
    match buffer {
        Buffer::Control { values, .. } => values.iter().all(|x| x.is_finite()),
        Buffer::Audio { samples, len, silent, .. } => *silent || all(samples[..*len].iter().copied()),
        Buffer::Magnitude { bins, frame, .. } => frame.is_none() || all(bins.iter().copied()),
        Buffer::Spectrum { bins, frame, .. } => {
            frame.is_none() || all(bins.iter().flat_map(|z| [z.re, z.im]))
        }
    }
}
