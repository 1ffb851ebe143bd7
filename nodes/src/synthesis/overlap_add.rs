//! `overlap_add`: spectra to a signal.

use crate::ports::signal_out;
use asperity_dsp::{Float, Framing, overlap_add};
use asperity_node::{
    Descriptor, Diagnostic, Fact, Input, Latency, LayoutSpec, Node, Prepared, Processor, Role, Setup, Shape,
    ShapeSpec, State, Status, Tick, Unit,
};

use crate::precision::{in_precision, precision};

/// Inverse FFT and weighted overlap-add, gain-exact for any hop.
pub struct OverlapAdd;

/// `overlap_add` in one precision.
struct Running<T> {
    kernel: overlap_add::OverlapAdd<T>,
    rate_hz: u32,
    length: u32,
    started: bool,
    refused: u64,
}

impl Node for OverlapAdd {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "overlap_add",
            "Inverse FFT and weighted overlap-add with Hann windows; unit gain at any hop.",
        )
        .role(Role::OverlapAdd)
        .input(
            Input::new("spectrum", ShapeSpec::Spectrum(LayoutSpec::Of('l')), Unit::NONE)
                .unit_of('u')
                .doc("frames with phases"),
        )
        .output(signal_out())
        .param(precision())
        .timing(
            "no latency: frame n covers samples from its start on; a change of level shows half a window \
             late",
        )
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        in_precision(setup, prepare::<f32>, prepare::<f64>)
    }
}

fn prepare<T: Float>(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
    let Some(Shape::Spectrum(l)) = setup.input(0).map(|p| p.shape) else {
        return Err(setup.params.node_error("nothing settles the layout of the frames"));
    };
    let framing = Framing {
        rate_hz: l.rate_hz,
        fft_len: l.length as usize,
        bins: l.bins as usize,
        frame_num: l.frame_rate.num(),
        frame_den: l.frame_rate.den(),
    };
    // At longer hops the sum of windows comes near 0, and the division by it explodes.
    let rarely = u64::from(l.frame_rate.num()) * u64::from(l.length)
        < 2 * u64::from(l.rate_hz) * u64::from(l.frame_rate.den());
    if rarely {
        let message = format!("the frames come too rarely to overlap: {l}");
        return Err(setup
            .params
            .node_error(message)
            .help("at least two frames a window: 20 a second for 0.1 s"));
    }
    let kernel =
        overlap_add::OverlapAdd::new(framing).map_err(|e| setup.params.node_error(format!("{e}: {l}")))?;
    let tail = Latency::samples(i64::from(l.length), l.rate_hz);
    let it = Running::<T> { kernel, rate_hz: l.rate_hz, length: l.length, started: false, refused: 0 };
    Ok(Prepared::new(it).tail(tail))
}

impl<T: Float> Processor for Running<T> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let span = tick.samples(self.rate_hz);
        if !self.started {
            self.kernel.reset(span.start);
            self.started = true;
        }
        if let Some(frame) = tick.inputs.spectrum(0) {
            self.refused += u64::from(self.kernel.add_frame(frame.start, frame.bins).is_err());
        }
        self.kernel.emit(span.start, tick.outputs.audio(0));
        Status::Continue
    }

    fn reset(&mut self) {
        self.started = false;
    }

    fn state(&mut self, state: &mut State<'_>) {
        self.kernel.state(state);
        state.keep(&mut self.started);
    }

    fn facts(&mut self) -> Vec<Fact> {
        let lag = f64::from(self.length) * 500.0 / f64::from(self.rate_hz);
        vec![Fact::number("response_lag", lag, "ms"), Fact::count("refused_frames", self.refused)]
    }
}
