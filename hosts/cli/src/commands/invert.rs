//! `asperity invert`: turns magnitude frames into a signal.

use std::path::PathBuf;
use std::sync::Arc;

use asperity_engine::NoClock;

use crate::failure::{Failure, print, warn, wrong};
use crate::kinds;
use crate::load::PluginArgs;
use crate::output::{Format, Pending, Rows, apart, audio_ending, named};
use crate::phase::{Frames, Method, Played, Scale, check_rate};

/// Turn magnitude frames from NumPy into a signal with a phase-retrieval node
#[derive(Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&[
    "asperity invert --phase sample_commit --magnitudes frames.npz --out signal.wav",
    "asperity invert --magnitudes frames.npy --rate 2500 --scale dft --out signal.npy",
]))]
pub struct Args {
    /// Phase-retrieval node, with its settings; `default` is the node of graphs/texture.ron.
    /// Offline methods: griffin_lim, fast_griffin_lim
    #[arg(long, value_name = "KIND[:param=value,...]", default_value = "default")]
    pub phase: String,
    /// Magnitudes of 0.1 s under a Hann window, 2 ms apart: float32 [frames, bins], bin 0 first. A .npz file
    /// states their rate and scale
    #[arg(long, value_name = "S.npz|.npy")]
    pub magnitudes: PathBuf,
    /// Sample rate of the signal, for a .npy file
    #[arg(long, value_name = "HZ")]
    pub rate: Option<u32>,
    /// Scale of the magnitudes, for a .npy file: dft is |sum w x|, and amplitude is 2 |sum w x| / sum w, as
    /// in a graph
    #[arg(long, value_name = "dft|amplitude", value_parser = scale)]
    pub scale: Option<Scale>,
    /// Output file: .wav (float) or .npy. Frame n begins at sample floor(n * rate / 500)
    #[arg(long, value_name = "Y.wav|.npy")]
    pub out: PathBuf,
    /// Seed of random numbers
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    #[command(flatten)]
    pub plugins: PluginArgs,
}

/// Parses `--scale`.
fn scale(text: &str) -> Result<Scale, String> {
    text.parse().map_err(|e: asperity_diagnostics::Diagnostic| e.help.unwrap_or(e.message))
}

pub fn run(args: &Args) -> Result<(), Failure> {
    apart(named(&[("--magnitudes", Some(&args.magnitudes))]), named(&[("--out", Some(&args.out))]))?;
    let registry = kinds::registry(&args.plugins.plugin)?;
    if let Some(rate) = args.rate {
        check_rate(&format!("--rate {rate}"), rate)?;
    }
    let (frames, bad) = Frames::read(&args.magnitudes, args.rate, args.scale)?;
    let rate = frames.layout().rate_hz;
    if bad > 0 {
        warn(&format!("{bad} magnitudes are negative or not finite and are taken as 0"));
    }
    let frames = Arc::new(frames);
    let method = Method::parse(&args.phase, &registry)?;
    let mut rows = match audio_ending(&args.out).as_str() {
        "wav" => Rows::wav(Pending::create(&args.out)?, 1, rate, Format::F32)?,
        "npy" => Rows::npy(Pending::create(&args.out)?, None)?,
        _ => {
            return Err(wrong(&args.out, "cannot tell the format from this name", "a .wav or .npy file"));
        }
    };
    let Played { signal, faults, .. } = method.play(&registry, &frames, args.seed, &NoClock, |_| {})?;
    rows.append(&signal, 1, |_| 0.0)?;
    rows.finish()?.keep()?;
    let (out, samples, count) = (args.out.display(), signal.len(), frames.count());
    print(&format!("wrote {out}: {samples} samples at {rate} Hz from {count} frames\n"))?;
    match faults {
        0 => Ok(()),
        n => Err(Failure::Machine(format!("the node failed {n} times; these ticks are silent"))),
    }
}
