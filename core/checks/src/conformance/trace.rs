//! What a node put out, tick by tick, so that two runs can be compared to the bit.

use asperity_node::{Buffer, Fault, Status};

/// A hash of every output of every tick, and of the answer.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Trace {
    outputs: usize,
    first: u64,
    hashes: Vec<u64>,
}

fn add(hash: u64, word: u64) -> u64 {
    (hash ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
}

impl Trace {
    pub(crate) fn new(outputs: usize, first: u64) -> Self {
        Self { outputs, first, hashes: Vec::new() }
    }

    pub(crate) fn push(&mut self, answer: Result<Status, Fault>, outputs: &[Buffer]) {
        self.push_outputs(outputs.iter());
        self.hashes.push(match answer {
            Ok(Status::Continue) => 1,
            Ok(Status::Quiet) => 2,
            Ok(Status::Asleep) => 3,
            Ok(Status::Tail(n)) => add(4, n),
            Ok(Status::Error(n)) | Err(Fault::Failed(n)) => add(5, u64::from(n)),
            Err(_) => 6,
        });
    }

    /// Outputs alone, where nobody knows the answer.
    pub(crate) fn push_outputs<'b>(&mut self, outputs: impl Iterator<Item = &'b Buffer>) {
        self.hashes.extend(outputs.map(hash));
    }

    /// One number for everything.
    pub(crate) fn digest(&self) -> u64 {
        self.hashes.iter().fold(self.outputs as u64, |h, w| add(h, *w))
    }

    /// Where two runs first differ.
    pub(crate) fn first_difference(&self, other: &Self, name: impl Fn(usize) -> String) -> Option<String> {
        let width = self.outputs + 1;
        let at = self.hashes.iter().zip(&other.hashes).position(|(a, b)| a != b)?;
        let what = match at % width {
            o if o < self.outputs => format!("`{}`", name(o)),
            _ => "its answer".to_owned(),
        };
        Some(format!("{what} differs first at call {}", self.first + (at / width) as u64))
    }

    /// The same of the outputs alone, `other` being without answers.
    pub(crate) fn first_output_difference(
        &self,
        other: &Self,
        name: impl Fn(usize) -> String,
    ) -> Option<String> {
        let ours = self.hashes.chunks(self.outputs + 1).flat_map(|row| &row[..self.outputs]);
        let at = ours.zip(&other.hashes).position(|(a, b)| a != b)?;
        Some(format!(
            "`{}` differs first at tick {}",
            name(at % self.outputs),
            self.first + (at / self.outputs) as u64
        ))
    }
}

fn hash(buffer: &Buffer) -> u64 {
    match buffer {
        Buffer::Control { values, .. } => values.iter().fold(1, |h, x| add(h, x.to_bits())),
        Buffer::Audio { samples, len, .. } => {
            samples[..*len].iter().fold(2, |h, x| add(h, u64::from(x.to_bits())))
        }
        Buffer::Magnitude { bins, frame: Some(f), .. } => {
            bins.iter().fold(add(add(3, f.0), f.1), |h, x| add(h, u64::from(x.to_bits())))
        }
        Buffer::Spectrum { bins, frame: Some(f), .. } => bins.iter().fold(add(add(4, f.0), f.1), |h, z| {
            add(h, u64::from(z.re.to_bits()) << 32 | u64::from(z.im.to_bits()))
        }),
        Buffer::Magnitude { .. } | Buffer::Spectrum { .. } => 5,
    }
}

/// Whether all that a buffer holds is finite.
pub(crate) fn is_finite(buffer: &Buffer) -> bool {
    match buffer {
        Buffer::Control { values, .. } => values.iter().all(|x| x.is_finite()),
        Buffer::Audio { samples, len, silent, .. } => {
            *silent || samples[..*len].iter().all(|x| x.is_finite())
        }
        Buffer::Magnitude { bins, frame, .. } => frame.is_none() || bins.iter().all(|x| x.is_finite()),
        Buffer::Spectrum { bins, frame, .. } => {
            frame.is_none() || bins.iter().all(|z| z.re.is_finite() && z.im.is_finite())
        }
    }
}
