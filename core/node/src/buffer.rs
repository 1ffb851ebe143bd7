//! What flows along the wires, and a node's view of it.

use num_complex::Complex;

use crate::{PortType, Shape, time};

/// What one output holds in the current tick.
///
/// `valid` is false where the value is not to be trusted: a node before it failed. `silent` is true where
/// audio is known to be zero.
#[derive(Clone, Debug)]
#[allow(missing_docs)]
pub enum Buffer {
    /// Values, held from tick to tick; `changed` says whether they are others than in the tick before.
    Control { values: Box<[f64]>, changed: bool, valid: bool },
    /// This tick's samples: the first `len` of `samples`.
    Audio { samples: Box<[f32]>, len: usize, valid: bool, silent: bool },
    /// At most one frame; `frame` is its number and first sample.
    Magnitude { bins: Box<[f32]>, frame: Option<(u64, u64)>, valid: bool },
    /// At most one frame; `frame` is its number and first sample.
    Spectrum { bins: Box<[Complex<f32>]>, frame: Option<(u64, u64)>, valid: bool },
}

impl Buffer {
    /// An empty buffer for a port, large enough for any tick.
    pub fn new(port: &PortType, tick_hz: u32) -> Self {
        match port.shape {
            Shape::Control { count } => Self::constant(count, 0.0),
            Shape::Audio { rate_hz } => Self::Audio {
                samples: vec![0.0; time::max_samples(rate_hz, tick_hz)].into(),
                len: 0,
                valid: true,
                silent: true,
            },
            Shape::Magnitude(l) => {
                Self::Magnitude { bins: vec![0.0; l.bins as usize].into(), frame: None, valid: true }
            }
            Shape::Spectrum(l) => Self::Spectrum {
                bins: vec![Complex::default(); l.bins as usize].into(),
                frame: None,
                valid: true,
            },
        }
    }

    /// Values that never change: what an unconnected control input reads.
    pub fn constant(count: usize, value: f64) -> Self {
        Self::Control { values: vec![value; count].into(), changed: false, valid: true }
    }

    /// Whether the value is to be trusted.
    pub fn is_valid(&self) -> bool {
        match self {
            Buffer::Control { valid, .. }
            | Buffer::Audio { valid, .. }
            | Buffer::Magnitude { valid, .. }
            | Buffer::Spectrum { valid, .. } => *valid,
        }
    }

    /// Says whether the value is to be trusted.
    pub fn set_valid(&mut self, trusted: bool) {
        match self {
            Buffer::Control { valid, .. }
            | Buffer::Audio { valid, .. }
            | Buffer::Magnitude { valid, .. }
            | Buffer::Spectrum { valid, .. } => *valid = trusted,
        }
    }

    /// Takes over what another holds; false where that is of another kind or size. Allocates nothing.
    pub fn copy_from(&mut self, from: &Buffer) -> bool {
        fn copy<T: Copy>(to: &mut [T], from: &[T]) -> bool {
            let fits = to.len() == from.len();
            if fits {
                to.copy_from_slice(from);
            }
            fits
        }
        match (self, from) {
            (
                Self::Control { values, changed, valid },
                Self::Control { values: v, changed: c, valid: ok },
            ) => {
                (*changed, *valid) = (*c, *ok);
                copy(values, v)
            }
            (
                Self::Audio { samples, len, valid, silent },
                Self::Audio { samples: s, len: n, valid: ok, silent: still },
            ) => {
                (*len, *valid, *silent) = (*n, *ok, *still);
                copy(samples, s)
            }
            (Self::Magnitude { bins, frame, valid }, Self::Magnitude { bins: b, frame: f, valid: ok }) => {
                (*frame, *valid) = (*f, *ok);
                copy(bins, b)
            }
            (Self::Spectrum { bins, frame, valid }, Self::Spectrum { bins: b, frame: f, valid: ok }) => {
                (*frame, *valid) = (*f, *ok);
                copy(bins, b)
            }
            _ => false,
        }
    }

    /// Whether a sleeping node need not be woken for this: silence, no frame, a control that did not change.
    pub fn is_silent(&self) -> bool {
        match self {
            Buffer::Control { changed, .. } => !changed,
            Buffer::Audio { silent, .. } => *silent,
            Buffer::Magnitude { frame, .. } | Buffer::Spectrum { frame, .. } => frame.is_none(),
        }
    }
}

/// A frame that came in.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a, T> {
    /// Its number.
    pub index: u64,
    /// Its first sample at the layout's rate.
    pub start: u64,
    /// Its bins, from bin 0 on.
    pub bins: &'a [T],
}

/// Where an input reads from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputRef {
    /// Index of the buffer.
    pub buffer: u32,
    /// False for an input that reads its default.
    pub connected: bool,
}

/// A node's inputs, by their place in the descriptor.
///
/// An accessor for another kind of port than the descriptor declares answers an empty slice.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    before: &'a [Buffer],
    after: &'a [Buffer],
    after_base: usize,
    map: &'a [InputRef],
}

impl<'a> Inputs<'a> {
    /// Inputs that read, by `map`, from the buffers before and after the node's own. `after_base` is the
    /// index of the first of `after`.
    pub fn new(before: &'a [Buffer], after: &'a [Buffer], after_base: usize, map: &'a [InputRef]) -> Self {
        Self { before, after, after_base, map }
    }

    /// Number of inputs.
    pub fn len(&self) -> usize {
        self.map.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.map.is_empty()
    }

    /// The buffer an input reads, if there is one.
    pub fn buffer(&self, input: usize) -> Option<&'a Buffer> {
        let index = self.map.get(input)?.buffer as usize;
        match index.checked_sub(self.after_base) {
            Some(i) => self.after.get(i),
            None => self.before.get(index),
        }
    }

    /// Whether a wire ends at this input.
    pub fn connected(&self, input: usize) -> bool {
        self.map.get(input).is_some_and(|r| r.connected)
    }

    /// Whether the value is to be trusted.
    pub fn valid(&self, input: usize) -> bool {
        self.buffer(input).is_none_or(Buffer::is_valid)
    }

    /// The values of a control.
    pub fn control(&self, input: usize) -> &'a [f64] {
        match self.buffer(input) {
            Some(Buffer::Control { values, .. }) => values,
            _ => &[],
        }
    }

    /// The first value of a control; 0 where there is none.
    pub fn value(&self, input: usize) -> f64 {
        self.control(input).first().copied().unwrap_or(0.0)
    }

    /// This tick's samples; none for an unconnected input.
    pub fn audio(&self, input: usize) -> &'a [f32] {
        match self.buffer(input) {
            Some(Buffer::Audio { samples, len, .. }) => &samples[..*len],
            _ => &[],
        }
    }

    /// Whether every sample of this tick is +0, so that a node at rest has nothing to do.
    pub fn is_zero(&self, input: usize) -> bool {
        // On bits, and without an early exit, so that it vectorises.
        self.audio(input).iter().fold(0, |bits, x| bits | x.to_bits()) == 0
    }

    /// This tick's frame of magnitudes, if one came.
    pub fn magnitude(&self, input: usize) -> Option<Frame<'a, f32>> {
        match self.buffer(input) {
            Some(Buffer::Magnitude { bins, frame: Some((index, start)), .. }) => {
                Some(Frame { index: *index, start: *start, bins })
            }
            _ => None,
        }
    }

    /// This tick's frame of complex bins, if one came.
    pub fn spectrum(&self, input: usize) -> Option<Frame<'a, Complex<f32>>> {
        match self.buffer(input) {
            Some(Buffer::Spectrum { bins, frame: Some((index, start)), .. }) => {
                Some(Frame { index: *index, start: *start, bins })
            }
            _ => None,
        }
    }
}

/// A node's outputs, by their place in the descriptor.
///
/// An accessor for another kind of port than the descriptor declares answers an empty slice.
#[derive(Debug)]
pub struct Outputs<'a> {
    buffers: &'a mut [Buffer],
}

impl<'a> Outputs<'a> {
    /// Outputs that write to these buffers.
    pub fn new(buffers: &'a mut [Buffer]) -> Self {
        Self { buffers }
    }

    /// The buffers themselves, for those who hand them on. What writes to audio or a frame also says so:
    /// `silent`, `frame`.
    pub fn buffers(&mut self) -> &mut [Buffer] {
        self.buffers
    }

    /// The values of a control; they hold what was last written.
    pub fn control(&mut self, output: usize) -> &mut [f64] {
        match self.buffers.get_mut(output) {
            Some(Buffer::Control { values, .. }) => values,
            _ => &mut [],
        }
    }

    /// Sets the first value of a control.
    pub fn set(&mut self, output: usize, value: f64) {
        if let Some(first) = self.control(output).first_mut() {
            *first = value;
        }
    }

    /// This tick's samples, zero until written.
    pub fn audio(&mut self, output: usize) -> &mut [f32] {
        match self.buffers.get_mut(output) {
            Some(Buffer::Audio { samples, len, silent, .. }) => {
                *silent = false;
                &mut samples[..*len]
            }
            _ => &mut [],
        }
    }

    /// Emits a frame of magnitudes; the bins hold an earlier frame until written.
    pub fn magnitude(&mut self, output: usize, index: u64, start: u64) -> &mut [f32] {
        match self.buffers.get_mut(output) {
            Some(Buffer::Magnitude { bins, frame, .. }) => {
                *frame = Some((index, start));
                bins
            }
            _ => &mut [],
        }
    }

    /// Emits a frame of complex bins; they hold an earlier frame until written.
    pub fn spectrum(&mut self, output: usize, index: u64, start: u64) -> &mut [Complex<f32>] {
        match self.buffers.get_mut(output) {
            Some(Buffer::Spectrum { bins, frame, .. }) => {
                *frame = Some((index, start));
                bins
            }
            _ => &mut [],
        }
    }
}
