//! Copies a tick's values between the host's memory and the node's view.

use std::slice;

use asperity_abi::*;
use asperity_node::{Buffer, InputRef};

/// The host's buffers of a tick's inputs or outputs.
pub(crate) struct Hosts {
    first: *mut AsperityBuffer,
    count: u32,
    /// Bytes from one to the next.
    stride: u32,
}

impl Hosts {
    /// # Safety
    /// `first` is an array of `count` buffers, each `stride` bytes from the next, and `data` of each holds as
    /// many values as it says, of its type. Nobody else uses outputs meanwhile.
    pub(crate) unsafe fn new(first: *mut AsperityBuffer, count: u32, stride: u32) -> Self {
        Self { first, count, stride }
    }

    fn all(&self) -> impl Iterator<Item = *mut AsperityBuffer> {
        // SAFETY: so many are there.
        (0..self.count as usize).map(|i| unsafe { self.first.byte_add(i * self.stride as usize) })
    }

    /// Reads the inputs of a tick.
    pub(crate) fn read(&self, ours: &mut [Buffer], map: &mut [InputRef]) {
        for ((host, ours), map) in self.all().zip(ours).zip(map) {
            // SAFETY: a buffer of the host.
            let host = unsafe { *host };
            map.connected = host.flags & ASPERITY_CONNECTED != 0;
            let trusted = host.flags & ASPERITY_VALID != 0;
            let there = (host.flags & ASPERITY_FRAME != 0).then_some((host.frame_index, host.frame_start));
            match ours {
                Buffer::Control { values, changed, valid } if host.carries == ASPERITY_CONTROL => {
                    copy(values, &host);
                    *changed = host.flags & ASPERITY_CHANGED != 0;
                    *valid = trusted;
                }
                Buffer::Audio { samples, len, valid, silent } if host.carries == ASPERITY_AUDIO => {
                    *len = copy(samples, &host);
                    *silent = host.flags & ASPERITY_SILENT != 0;
                    *valid = trusted;
                }
                Buffer::Magnitude { bins, frame, valid } if host.carries == ASPERITY_MAGNITUDE => {
                    (*frame, *valid) = (there, trusted);
                    if there.is_some() {
                        copy(bins, &host);
                    }
                }
                Buffer::Spectrum { bins, frame, valid } if host.carries == ASPERITY_SPECTRUM => {
                    (*frame, *valid) = (there, trusted);
                    if there.is_some() {
                        copy(bins, &host);
                    }
                }
                _ => {}
            }
        }
    }

    /// Prepares the node's outputs for a tick: audio zero and of this tick's length, no frames, controls
    /// unchanged.
    pub(crate) fn clear(&self, ours: &mut [Buffer]) {
        for (host, ours) in self.all().zip(ours) {
            // SAFETY: a buffer of the host.
            let host = unsafe { *host };
            match ours {
                Buffer::Control { values, .. } => _ = copy(values, &host),
                Buffer::Audio { samples, len, silent, .. } => {
                    *len = (host.count as usize).min(samples.len());
                    if !*silent {
                        samples.fill(0.0);
                    }
                    *silent = true;
                }
                Buffer::Magnitude { frame, .. } | Buffer::Spectrum { frame, .. } => *frame = None,
            }
        }
    }

    /// Writes the outputs of a tick back.
    pub(crate) fn write(&self, ours: &[Buffer]) {
        for (host, ours) in self.all().zip(ours) {
            // SAFETY: a buffer of the host, which nobody else uses meanwhile.
            let host = unsafe { &mut *host };
            match ours {
                Buffer::Control { values, .. } => copy_out(host, values),
                Buffer::Audio { samples, len, silent: false, .. } => {
                    copy_out(host, &samples[..*len]);
                    host.flags |= ASPERITY_WRITTEN;
                }
                Buffer::Magnitude { bins, frame: Some(_), .. } => copy_out(host, bins),
                Buffer::Spectrum { bins, frame: Some(_), .. } => copy_out(host, bins),
                _ => {}
            }
            if let Buffer::Magnitude { frame: Some(frame), .. }
            | Buffer::Spectrum { frame: Some(frame), .. } = ours
            {
                (host.frame_index, host.frame_start) = *frame;
                host.flags |= ASPERITY_FRAME;
            }
        }
    }
}

/// Copies from a buffer that carries such values as far as there is room, and answers how many.
fn copy<T: Copy>(to: &mut [T], from: &AsperityBuffer) -> usize {
    if from.data.is_null() {
        return 0;
    }
    // SAFETY: as many values as it says, of its type.
    let from = unsafe { slice::from_raw_parts(from.data.cast::<T>(), from.count as usize) };
    to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
    to.len().min(from.len())
}

/// Copies to a buffer that carries such values.
fn copy_out<T: Copy>(to: &mut AsperityBuffer, from: &[T]) {
    if to.data.is_null() {
        return;
    }
    // SAFETY: as many values as it says, of its type, which nobody else uses meanwhile.
    let to = unsafe { slice::from_raw_parts_mut(to.data.cast::<T>(), to.count as usize) };
    to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
}
