//! Buffers of the wires, and a node's view of them.

use num_complex::Complex;

use crate::{PortType, Shape, time};

/// Content of one output in the current tick.
///
/// `valid` is false if a node before it failed. `silent` is true if audio is known to be zero.
#[derive(Clone, Debug)]
#[allow(missing_docs)]
pub enum Buffer {
    /// Values, held from tick to tick; `changed` says whether they differ from the tick before.
    Control { values: Box<[f64]>, changed: bool, valid: bool },
    /// This tick's samples: the first `len` of `samples`.
    Audio { samples: Box<[f32]>, len: usize, valid: bool, silent: bool },
    /// At most one frame; `frame` is its number and first sample.
    Magnitude { bins: Box<[f32]>, frame: Option<(u64, u64)>, valid: bool },
    /// At most one frame; `frame` is its number and first sample.
    Spectrum { bins: Box<[Complex<f32>]>, frame: Option<(u64, u64)>, valid: bool },
}

impl Buffer {
    /// Makes an empty buffer for a port, large enough for any tick.
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

    /// Makes the constant values of an unconnected control input.
    pub fn constant(count: usize, value: f64) -> Self {
        Self::Control { values: vec![value; count].into(), changed: false, valid: true }
    }

    /// Whether the content is valid.
    pub fn is_valid(&self) -> bool {
        match self {
            Buffer::Control { valid, .. }
            | Buffer::Audio { valid, .. }
            | Buffer::Magnitude { valid, .. }
            | Buffer::Spectrum { valid, .. } => *valid,
        }
    }

    /// Marks the content as valid or not.
    pub fn set_valid(&mut self, trusted: bool) {
        match self {
            Buffer::Control { valid, .. }
            | Buffer::Audio { valid, .. }
            | Buffer::Magnitude { valid, .. }
            | Buffer::Spectrum { valid, .. } => *valid = trusted,
        }
    }

    /// Copies another buffer. Returns false if its kind or size differs. Does not allocate.
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

    /// Whether it does not wake a sleeping node: silence, no frame, an unchanged control.
    pub fn is_silent(&self) -> bool {
        match self {
            Buffer::Control { changed, .. } => !changed,
            Buffer::Audio { silent, .. } => *silent,
            Buffer::Magnitude { frame, .. } | Buffer::Spectrum { frame, .. } => frame.is_none(),
        }
    }
}

/// A frame at an input.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a, T> {
    /// Its number.
    pub index: u64,
    /// Its first sample at the layout's rate.
    pub start: u64,
    /// Its bins, from bin 0 on.
    pub bins: &'a [T],
}

/// Source of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputRef {
    /// Index of the buffer.
    pub buffer: u32,
    /// False for an input that reads its default.
    pub connected: bool,
}

/// A node's inputs, by their index in the descriptor.
///
/// An accessor for another kind of port returns an empty slice.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    before: &'a [Buffer],
    after: &'a [Buffer],
    after_base: usize,
    map: &'a [InputRef],
}

impl<'a> Inputs<'a> {
    /// Makes inputs that read, by `map`, from the buffers before and after the node's own. `after_base`
    /// is the index of the first of `after`.
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

    /// The buffer of an input, if there is one.
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

    /// Whether the content of an input is valid.
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

    /// First value of a control; 0 if there is none.
    pub fn value(&self, input: usize) -> f64 {
        self.control(input).first().copied().unwrap_or(0.0)
    }

    /// Samples of this tick; none for an unconnected input.
    pub fn audio(&self, input: usize) -> &'a [f32] {
        match self.buffer(input) {
            Some(Buffer::Audio { samples, len, .. }) => &samples[..*len],
            _ => &[],
        }
    }

    /// Whether every sample of this tick is +0, so that a resting node can skip its work.
    pub fn is_zero(&self, input: usize) -> bool {
        // On bits, and without an early exit, so that it vectorises.
        self.audio(input).iter().fold(0, |bits, x| bits | x.to_bits()) == 0
    }

    /// Magnitude frame of this tick, if there is one.
    pub fn magnitude(&self, input: usize) -> Option<Frame<'a, f32>> {
        match self.buffer(input) {
            Some(Buffer::Magnitude { bins, frame: Some((index, start)), .. }) => {
                Some(Frame { index: *index, start: *start, bins })
            }
            _ => None,
        }
    }

    /// Frame of complex bins of this tick, if there is one.
    pub fn spectrum(&self, input: usize) -> Option<Frame<'a, Complex<f32>>> {
        match self.buffer(input) {
            Some(Buffer::Spectrum { bins, frame: Some((index, start)), .. }) => {
                Some(Frame { index: *index, start: *start, bins })
            }
            _ => None,
        }
    }
}

/// A node's outputs, by their index in the descriptor.
///
/// An accessor for another kind of port returns an empty slice.
#[derive(Debug)]
pub struct Outputs<'a> {
    buffers: &'a mut [Buffer],
}

impl<'a> Outputs<'a> {
    /// Outputs that write to these buffers.
    pub fn new(buffers: &'a mut [Buffer]) -> Self {
        Self { buffers }
    }

    /// The buffers themselves, to pass on. Code that writes audio or a frame also sets `silent` or
    /// `frame`.
    pub fn buffers(&mut self) -> &mut [Buffer] {
        self.buffers
    }

    /// Values of a control; they hold the last written values.
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

    /// Samples of this tick, zero until written.
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
