//! Copies a tick's values between the host's memory and the node's view.

use std::slice;

use asperity_abi::*;
use asperity_node::{Buffer, Complex, InputRef};

/// One of the host's buffers.
///
/// # Safety
/// `first` is an array of more than `index` buffers, each `stride` bytes from the next.
unsafe fn at(first: *const AsperityBuffer, index: usize, stride: u32) -> *const AsperityBuffer {
    // SAFETY: the caller's promise.
    unsafe { first.byte_add(index * stride as usize) }
}

/// Content of a buffer as values of a type.
///
/// # Safety
/// `data` holds `count` values of that type, or is NULL.
unsafe fn values<'a, T>(b: &AsperityBuffer) -> &'a [T] {
    if b.data.is_null() {
        return &[];
    }
    // SAFETY: the caller's promise.
    unsafe { slice::from_raw_parts(b.data.cast(), b.count as usize) }
}

/// The same, writable.
///
/// # Safety
/// As for [`values`], and nobody else reads it meanwhile.
unsafe fn values_mut<'a, T>(b: &AsperityBuffer) -> &'a mut [T] {
    if b.data.is_null() {
        return &mut [];
    }
    // SAFETY: the caller's promise.
    unsafe { slice::from_raw_parts_mut(b.data.cast(), b.count as usize) }
}

fn copy<T: Copy>(to: &mut [T], from: &[T]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
}

/// Reads the inputs of a tick.
///
/// # Safety
/// `first` is an array of `count` buffers of the host.
pub(crate) unsafe fn read(
    first: *const AsperityBuffer,
    count: u32,
    stride: u32,
    ours: &mut [Buffer],
    map: &mut [InputRef],
) {
    for (i, (ours, map)) in ours.iter_mut().zip(map).enumerate().take(count as usize) {
        // SAFETY: i < count.
        let host = unsafe { &*at(first, i, stride) };
        map.connected = host.flags & ASPERITY_CONNECTED != 0;
        let trusted = host.flags & ASPERITY_VALID != 0;
        let there = (host.flags & ASPERITY_FRAME != 0).then_some((host.frame_index, host.frame_start));
        match ours {
            Buffer::Control { values: ours, changed, valid } if host.carries == ASPERITY_CONTROL => {
                // SAFETY: a control holds f64.
                copy(ours, unsafe { values(host) });
                *changed = host.flags & ASPERITY_CHANGED != 0;
                *valid = trusted;
            }
            Buffer::Audio { samples, len, valid, silent } if host.carries == ASPERITY_AUDIO => {
                // SAFETY: audio holds f32.
                let theirs = unsafe { values(host) };
                *len = theirs.len().min(samples.len());
                copy(samples, theirs);
                *silent = host.flags & ASPERITY_SILENT != 0;
                *valid = trusted;
            }
            Buffer::Magnitude { bins, frame, valid } if host.carries == ASPERITY_MAGNITUDE => {
                *frame = there;
                *valid = trusted;
                if there.is_some() {
                    // SAFETY: magnitudes are f32.
                    copy(bins, unsafe { values(host) });
                }
            }
            Buffer::Spectrum { bins, frame, valid } if host.carries == ASPERITY_SPECTRUM => {
                *frame = there;
                *valid = trusted;
                if there.is_some() {
                    // SAFETY: pairs of f32, which is what a Complex<f32> is.
                    copy(bins, unsafe { values::<Complex<f32>>(host) });
                }
            }
            _ => {}
        }
    }
}

/// Prepares the node's outputs for a tick: audio zero and of this tick's length, no frames, controls
/// unchanged.
///
/// # Safety
/// `first` is an array of `count` buffers of the host.
pub(crate) unsafe fn clear(first: *const AsperityBuffer, count: u32, stride: u32, ours: &mut [Buffer]) {
    for (i, ours) in ours.iter_mut().enumerate().take(count as usize) {
        // SAFETY: i < count.
        let host = unsafe { &*at(first, i, stride) };
        match ours {
            Buffer::Control { values: ours, .. } => {
                // SAFETY: a control holds f64.
                copy(ours, unsafe { values(host) });
            }
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
///
/// # Safety
/// `first` is an array of `count` buffers of the host, which nobody else reads meanwhile.
pub(crate) unsafe fn write(ours: &[Buffer], first: *mut AsperityBuffer, count: u32, stride: u32) {
    for (i, ours) in ours.iter().enumerate().take(count as usize) {
        // SAFETY: i < count.
        let host = unsafe { &mut *at(first, i, stride).cast_mut() };
        let mut frame = |there: &Option<(u64, u64)>| {
            if let Some((index, start)) = there {
                (host.frame_index, host.frame_start) = (*index, *start);
                host.flags |= ASPERITY_FRAME;
            }
            there.is_some()
        };
        // SAFETY: each kind holds values of its type.
        unsafe {
            match ours {
                Buffer::Control { values, .. } => copy(values_mut(host), values),
                Buffer::Audio { samples, len, silent: false, .. } => {
                    copy(values_mut(host), &samples[..*len]);
                    host.flags |= ASPERITY_WRITTEN;
                }
                Buffer::Audio { .. } => {}
                Buffer::Magnitude { bins, frame: there, .. } => {
                    if frame(there) {
                        copy(values_mut(host), bins);
                    }
                }
                Buffer::Spectrum { bins, frame: there, .. } => {
                    if frame(there) {
                        copy(values_mut(host), bins);
                    }
                }
            }
        }
    }
}
