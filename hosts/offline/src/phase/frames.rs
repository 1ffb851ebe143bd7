//! Magnitude frames in memory, and a node that plays them.

use std::sync::Arc;

use asperity_node::{
    Descriptor, Diagnostic, FrameLayout, FrameRate, LayoutSpec, NodeKind, Output, Prepared, Processor,
    ShapeSpec, Status, Tick, Unit, time,
};

/// Frames a second of magnitudes from NumPy.
pub const FRAME_HZ: u32 = 500;
/// Accepted sample rates \[Hz\].
const RATES: std::ops::RangeInclusive<u32> = 100..=192_000;

/// Scale of magnitudes that come from elsewhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Those of an unscaled DFT: |sum w x|.
    Dft,
    /// Amplitudes, as in a graph: 2 |sum w x| / sum w.
    Amplitude,
}

/// At least one frame of magnitudes, as amplitudes, and their layout.
pub struct Frames {
    layout: FrameLayout,
    bins: Vec<f32>,
}

/// Refuses a rate, called `what`, at which 0.1 s is not a whole number of samples.
///
/// # Errors
/// Such a rate.
pub fn check_rate(what: &str, rate_hz: u32) -> Result<(), Diagnostic> {
    if RATES.contains(&rate_hz) && rate_hz.is_multiple_of(10) {
        return Ok(());
    }
    let (least, most) = (RATES.start(), RATES.end());
    Err(Diagnostic::new(format!("{what} does not fit")).help(format!(
        "{least} to {most} Hz, and a multiple of 10, so that 0.1 s is a whole number of samples"
    )))
}

impl Frames {
    /// Frames of unscaled Hann-windowed DFTs of 0.1 s. Bad values become 0; answers their number.
    ///
    /// # Errors
    /// Values that are no whole frames.
    pub fn from_unscaled(values: Vec<f32>, bins: usize, rate_hz: u32) -> Result<(Self, u64), Diagnostic> {
        Self::new(values, bins, rate_hz, Scale::Dft)
    }

    /// Frames of 0.1 s under a Hann window. Bad values become 0; answers their number.
    ///
    /// # Errors
    /// Values that are no whole frames.
    pub fn new(
        mut values: Vec<f32>,
        bins: usize,
        rate_hz: u32,
        scale: Scale,
    ) -> Result<(Self, u64), Diagnostic> {
        let length = rate_hz / 10;
        let most = length as usize / 2 + 1;
        if bins == 0 || bins > most || values.is_empty() || !values.len().is_multiple_of(bins) {
            let shape = [values.len() / bins.max(1), bins];
            return Err(Diagnostic::new(format!("an array of shape {shape:?} does not fit"))
                .help(format!("at least one frame, and 1 to {most} bins at {rate_hz} Hz")));
        }
        let scale = match scale {
            // From an unscaled DFT to amplitudes: the sum of a Hann window is half its length.
            Scale::Dft => 4.0 / length as f32,
            Scale::Amplitude => 1.0,
        };
        let mut bad = 0;
        for x in &mut values {
            if *x >= 0.0 && x.is_finite() {
                *x *= scale;
            } else {
                bad += 1;
                *x = 0.0;
            }
        }
        Ok((Self { layout: layout(bins, rate_hz)?, bins: values }, bad))
    }

    /// Frames of amplitudes; a whole number, at least one.
    ///
    /// # Errors
    /// A rate without a layout.
    pub fn from_amplitudes(bins: Vec<f32>, bins_a_frame: usize, rate_hz: u32) -> Result<Self, Diagnostic> {
        Ok(Self { layout: layout(bins_a_frame, rate_hz)?, bins })
    }

    /// Their layout.
    pub fn layout(&self) -> FrameLayout {
        self.layout
    }

    /// Number of frames.
    pub fn count(&self) -> usize {
        self.bins.len() / self.layout.bins as usize
    }

    /// First sample of a frame.
    pub fn start(&self, frame: u64) -> u64 {
        time::first_sample(frame, self.layout.rate_hz, FRAME_HZ)
    }

    /// Number of samples that the frames cover, with the window of the last one.
    pub fn samples(&self) -> u64 {
        self.start((self.count() as u64).saturating_sub(1)) + u64::from(self.layout.length)
    }

    /// Their amplitudes, frame by frame \[m/s^2\].
    pub fn amplitudes(&self) -> &[f32] {
        &self.bins
    }

    /// Magnitudes of the unscaled DFT, as in files.
    pub fn unscaled(&self) -> Vec<f32> {
        let scale = self.layout.length as f32 / 4.0;
        self.bins.iter().map(|x| x * scale).collect()
    }
}

fn layout(bins: usize, rate_hz: u32) -> Result<FrameLayout, Diagnostic> {
    let frame_rate = FrameRate::new(FRAME_HZ, 1).ok_or_else(|| Diagnostic::new("no frame rate"))?;
    Ok(FrameLayout { rate_hz, length: rate_hz / 10, bins: bins as u32, frame_rate })
}

/// Kind of the source. No graph file can name it: its name has spaces.
pub(super) const MAGNITUDES: &str = "magnitudes from memory";

pub(super) fn magnitudes(frames: Arc<Frames>) -> NodeKind {
    let shape = ShapeSpec::Magnitude(LayoutSpec::Is(frames.layout));
    let output = Output::new("magnitude", shape, Unit::METRE_PER_SECOND_SQUARED);
    let descriptor = Descriptor::new(MAGNITUDES, "Plays the frames it was given.").output(output);
    NodeKind::new(descriptor, move |_| Ok(Prepared::new(Magnitudes(frames.clone()))))
}

struct Magnitudes(Arc<Frames>);

impl Processor for Magnitudes {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let Frames { layout, bins } = &*self.0;
        let at = tick.index as usize * layout.bins as usize;
        let Some(frame) = bins.get(at..at + layout.bins as usize) else { return Status::Asleep };
        tick.outputs.magnitude(0, tick.index, self.0.start(tick.index)).copy_from_slice(frame);
        Status::Continue
    }

    fn reset(&mut self) {}
}
