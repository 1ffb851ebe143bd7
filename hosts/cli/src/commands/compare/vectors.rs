//! The vectors that are compared on, from a folder.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use asperity_accuracy::{npy, phase};
use asperity_diagnostics::{Diagnostic, Source};
use serde_json::Value;

use super::published::{self, Published};
use crate::failure::{Failure, warn};
use crate::phase::{FRAME_HZ, Frames, check_rate};

/// How long magnitudes are held still for the rhythm of what is made of them, in frames: 8 s that are
/// looked at.
const STEADY: usize = 8 * FRAME_HZ as usize + 2 * phase::EDGE_FRAMES;
/// Bins that are taken of a signal's transform, from bin 0 on: to 1000 Hz.
const BINS: usize = 101;

const NAMES: &str = "NAME_RATE.mag.npy holds magnitudes, float32 [frames, bins], 2 ms apart, of unscaled Hann-windowed DFTs of 0.1 s; NAME_RATE.sig.npy the signal they are computed from";

/// Magnitude frames with a name.
pub struct Vector {
    /// Name, with the rate at its end where the file has it.
    pub name: String,
    /// Sample rate in Hz.
    pub rate_hz: u32,
    /// What the nodes are given.
    pub frames: Arc<Frames>,
    /// The same as unscaled DFT magnitudes, which the scores are taken of.
    pub unscaled: Vec<f32>,
}

/// Vectors, and scores that others reached on them.
pub struct Set {
    /// Where they are from, as a person reads it.
    pub from: String,
    /// At least one.
    pub vectors: Vec<Vector>,
    /// Published scores, where there are any.
    pub published: Vec<Published>,
}

impl Vector {
    /// A vector of unscaled magnitudes, `bins` a frame.
    ///
    /// # Errors
    /// A rate or shape that does not fit, too few frames to be scored, magnitudes that are all 0.
    pub fn new(name: &str, rate_hz: u32, magnitudes: Vec<f32>, bins: usize) -> Result<Self, Diagnostic> {
        check_rate(&format!("a rate of {rate_hz} Hz"), rate_hz)?;
        let (frames, bad) = Frames::from_unscaled(magnitudes, bins, rate_hz)?;
        let least = 2 * phase::EDGE_FRAMES + 1;
        if frames.count() < least {
            let found = frames.count();
            return Err(Diagnostic::new(format!("{found} frames are too few to be scored"))
                .help(format!("at least {least}: the first and last {} do not count", phase::EDGE_FRAMES)));
        }
        let inner = phase::EDGE_FRAMES * bins..(frames.count() - phase::EDGE_FRAMES) * bins;
        if frames.amplitudes()[inner].iter().all(|x| *x == 0.0) {
            return Err(Diagnostic::new("all magnitudes are 0"));
        }
        if bad > 0 {
            warn(&format!("{name}: {bad} magnitudes are negative or not finite and are taken as 0"));
        }
        let unscaled = frames.unscaled();
        Ok(Self { name: name.to_owned(), rate_hz, frames: Arc::new(frames), unscaled })
    }

    /// A vector of the magnitudes of a signal.
    ///
    /// # Errors
    /// As [`new`](Self::new); a sample that is not finite.
    pub fn of_signal(name: &str, rate_hz: u32, signal: &[f64]) -> Result<Self, Diagnostic> {
        check_rate(&format!("a rate of {rate_hz} Hz"), rate_hz)?;
        if signal.iter().any(|x| !x.is_finite()) {
            return Err(Diagnostic::new("not all samples are finite"));
        }
        let bins = BINS.min(rate_hz as usize / 20 + 1);
        let framing = phase::framing(rate_hz, bins);
        let rest = signal.len().saturating_sub(framing.fft_len) as u64;
        let frames = (rest * u64::from(FRAME_HZ) / u64::from(rate_hz)) as usize + 1;
        let magnitudes = phase::magnitudes(signal, &framing, frames);
        Self::new(name, rate_hz, magnitudes.into_iter().map(|x| x as f32).collect(), bins)
    }

    /// The name without the rate at its end.
    pub fn short_name(&self) -> &str {
        self.name.strip_suffix(&format!("_{}", self.rate_hz)).unwrap_or(&self.name)
    }

    /// How rough the magnitudes are from bin to bin: the mean second difference of their logarithms, over
    /// bins within 40 dB of their frame's top. What a network answers that was trained on squared errors,
    /// the mean spectrum, is smooth.
    pub fn roughness(&self) -> f64 {
        let bins = self.frames.layout().bins as usize;
        let (mut sum, mut count) = (0.0, 0_u64);
        for frame in self.unscaled.chunks_exact(bins) {
            let least = frame.iter().copied().fold(0.0_f32, f32::max) * 0.01;
            for three in frame.windows(3).filter(|w| w.iter().all(|x| *x > least)) {
                let [a, b, c] = [0, 1, 2].map(|i| f64::from(three[i]).ln());
                sum += (a - 2.0 * b + c).abs();
                count += 1;
            }
        }
        if count == 0 { f64::INFINITY } else { sum / count as f64 }
    }
}

impl Set {
    /// The mean spectrum of the smoothest vector, held still: what a texture is at constant speed and force.
    ///
    /// # Errors
    /// None that depends on anything but the vectors.
    pub fn steady(&self) -> Result<Option<Vector>, Diagnostic> {
        let Some(vector) = self.smoothest().and_then(|v| self.vectors.get(v)) else { return Ok(None) };
        let bins = vector.frames.layout().bins as usize;
        let mut powers = vec![0.0; bins];
        for frame in vector.unscaled.chunks_exact(bins) {
            powers.iter_mut().zip(frame).for_each(|(sum, x)| *sum += f64::from(*x).powi(2));
        }
        let mean = |power: f64| (power / vector.frames.count() as f64).sqrt() as f32;
        let frame: Vec<f32> = powers.into_iter().map(mean).collect();
        Vector::new("steady", vector.rate_hz, frame.repeat(STEADY), bins).map(Some)
    }

    /// The vector whose magnitudes are smoothest over frequency.
    pub fn smoothest(&self) -> Option<usize> {
        let all = self.vectors.iter().map(Vector::roughness).enumerate();
        all.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
    }

    /// The rates of the vectors in Hz, each once, rising.
    pub fn rates(&self) -> Vec<u32> {
        let mut rates: Vec<u32> = self.vectors.iter().map(|v| v.rate_hz).collect();
        rates.sort_unstable();
        rates.dedup();
        rates
    }
}

/// Files of one vector: magnitudes and signal.
type Files = [Option<std::path::PathBuf>; 2];

/// Reads every vector of a folder, and `sc.json` where it is there.
///
/// # Errors
/// A folder that cannot be read or has no vectors; everything that is wrong with its files.
pub fn read(dir: &Path) -> Result<Set, Failure> {
    let files = list(dir)?;
    if files.is_empty() {
        return Err(Diagnostic::new("there are no vectors in this folder").in_file(dir).help(NAMES).into());
    }
    let index = json(&dir.join("index.json"))?;
    let (mut vectors, mut errors) = (Vec::new(), Vec::new());
    for (name, files) in &files {
        match vector(name, files, index.as_ref()) {
            Ok(vector) => vectors.push(vector),
            Err(e) => errors.push(e),
        }
    }
    if !errors.is_empty() {
        return Err(errors.into());
    }
    vectors.sort_by(|a, b| (a.rate_hz, &a.name).cmp(&(b.rate_hz, &b.name)));
    let path = dir.join("sc.json");
    let published = match json(&path)? {
        Some(scores) => published::read(&scores).map_err(|e| e.in_file(&path))?,
        None => Vec::new(),
    };
    Ok(Set { from: dir.display().to_string(), vectors, published })
}

/// The files of every vector, by its name.
fn list(dir: &Path) -> Result<BTreeMap<String, Files>, Failure> {
    let fail = |e: std::io::Error| Diagnostic::new(format!("cannot read this folder: {e}")).in_file(dir);
    let mut files: BTreeMap<String, Files> = BTreeMap::new();
    for entry in std::fs::read_dir(dir).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        let Some(file) = path.file_name().and_then(|n| n.to_str()) else { continue };
        for (which, ending) in [".mag.npy", ".sig.npy"].into_iter().enumerate() {
            if let Some(name) = file.strip_suffix(ending) {
                files.entry(name.to_owned()).or_default()[which] = Some(path.clone());
            }
        }
    }
    Ok(files)
}

/// A JSON file, if it is there.
fn json(path: &Path) -> Result<Option<Value>, Diagnostic> {
    if !path.exists() {
        return Ok(None);
    }
    serde_json::from_str(Source::read(path)?.text())
        .map(Some)
        .map_err(|e| Diagnostic::new(format!("this is no JSON: {e}")).in_file(path))
}

fn vector(name: &str, files: &Files, index: Option<&Value>) -> Result<Vector, Diagnostic> {
    let [magnitudes, signal] = files;
    let Some(path) = magnitudes.as_ref().or(signal.as_ref()) else {
        return Err(Diagnostic::new(format!("`{name}` has no file")));
    };
    let known = index.and_then(|i| i.get(name)?.get("fs")?.as_f64());
    let ending = name.rsplit_once('_').and_then(|(_, rate)| rate.parse().ok());
    let Some(rate) = known.or(ending).filter(|r| r.fract() == 0.0 && (0.0..1e9).contains(r)) else {
        return Err(Diagnostic::new("nothing says at which rate this vector is")
            .in_file(path)
            .help("end its name in the rate, as in texture_2500.mag.npy, or give it an `fs` in index.json"));
    };
    let array = npy::read(path)?;
    let rate_hz = rate as u32;
    let vector = match (magnitudes.is_some(), array.shape.as_slice()) {
        (true, &[_, bins]) => Vector::new(name, rate_hz, array.values.into_f32(), bins),
        (false, &[_]) => Vector::of_signal(name, rate_hz, &array.values.into_f64()),
        (_, shape) => Err(Diagnostic::new(format!("an array of shape {shape:?} does not fit")).help(NAMES)),
    };
    vector.map_err(|e| e.in_file(path))
}
