//! The vectors on which methods are compared: built in or from a folder, with the scores that others
//! published.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use asperity_accuracy::npy::{self, Archive};
use asperity_accuracy::phase;
use asperity_diagnostics::{Diagnostic, file};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::failure::{Failure, wrong};
use crate::host::warn;
use crate::phase::{FRAME_HZ, Frames, check_rate};
use crate::shipped::{self, FILES};

/// Frames of steady magnitudes for the rhythm: 8 s, and the edges that do not count.
const STEADY: usize = 8 * FRAME_HZ as usize + 2 * phase::EDGE_FRAMES;
/// Longest file that is read.
const MAX_BYTES: u64 = 8 * npy::MAX_VALUES as u64 + (1 << 16);
/// Bins of a signal's transform, from 0 to 1000 Hz.
const BINS: usize = 101;

const NAMES: &str = "NAME.npz holds magnitudes and their convention; NAME_RATE.mag.npy magnitudes, float32 \
                     [frames, bins], 2 ms apart, of unscaled Hann-windowed DFTs of 0.1 s; NAME_RATE.sig.npy \
                     the signal they are computed from";

/// Magnitudes that methods turn into a signal.
pub struct Vector {
    /// Name, with the rate at its end if the file has it.
    pub name: String,
    /// Sample rate \[Hz\].
    pub rate_hz: u32,
    /// Its frames.
    pub frames: Arc<Frames>,
    /// The same as unscaled DFT magnitudes, for the scores.
    pub unscaled: Vec<f32>,
}

/// Vectors, and the scores that others published for them.
pub struct Set {
    /// Origin, in words.
    pub from: String,
    /// At least one.
    pub vectors: Vec<Vector>,
    smoothest: usize,
    /// Scores of others.
    pub published: Published,
}

impl Vector {
    /// A vector of unscaled magnitudes, `bins` a frame.
    ///
    /// # Errors
    /// A rate or a shape that does not fit, too few frames, magnitudes that are all 0.
    pub fn new(name: &str, rate_hz: u32, magnitudes: Vec<f32>, bins: usize) -> Result<Self, Diagnostic> {
        check_rate(&format!("a rate of {rate_hz} Hz"), rate_hz)?;
        Self::of_frames(name, Frames::from_unscaled(magnitudes, bins, rate_hz)?)
    }

    /// A vector of frames, and the number of bad values that were in them.
    fn of_frames(name: &str, (frames, bad): (Frames, u64)) -> Result<Self, Diagnostic> {
        let layout = frames.layout();
        let bins = layout.bins as usize;
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
        Ok(Self { name: name.to_owned(), rate_hz: layout.rate_hz, frames: Arc::new(frames), unscaled })
    }

    /// A vector of the magnitudes of a signal.
    ///
    /// # Errors
    /// See [`new`](Self::new); samples that are not finite.
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

    /// Name without the rate.
    pub fn short_name(&self) -> &str {
        self.name.strip_suffix(&format!("_{}", self.rate_hz)).unwrap_or(&self.name)
    }

    /// Mean second difference of log magnitudes over frequency, within 40 dB of each frame's maximum.
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
    /// A set of at least one vector.
    pub fn new(from: String, vectors: Vec<Vector>, published: Published) -> Self {
        let all = vectors.iter().map(Vector::roughness).enumerate();
        let smoothest = all.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(i, _)| i);
        Self { from, vectors, smoothest, published }
    }

    /// The vector that is smoothest over frequency.
    pub fn smoothest(&self) -> &Vector {
        &self.vectors[self.smoothest]
    }

    /// The mean spectrum of the smoothest vector, held still: a texture at constant speed and force.
    ///
    /// # Errors
    /// See [`Vector::new`].
    pub fn steady(&self) -> Result<Vector, Diagnostic> {
        let vector = self.smoothest();
        let bins = vector.frames.layout().bins as usize;
        let mut powers = vec![0.0; bins];
        for frame in vector.unscaled.chunks_exact(bins) {
            powers.iter_mut().zip(frame).for_each(|(sum, x)| *sum += f64::from(*x).powi(2));
        }
        let mean = |power: f64| (power / vector.frames.count() as f64).sqrt() as f32;
        let frame: Vec<f32> = powers.into_iter().map(mean).collect();
        Vector::new("steady", vector.rate_hz, frame.repeat(STEADY), bins)
    }

    /// Rates of the vectors \[Hz\], each once, rising.
    pub fn rates(&self) -> BTreeSet<u32> {
        self.vectors.iter().map(|v| v.rate_hz).collect()
    }
}

/// The built-in vectors, all at 2500 Hz, with their published scores: `sine_off` between two bins, `two25`
/// sines 25 Hz apart, a `chirp`, a `texture` of three resonances, `contact` that switches it, decaying
/// `taps`, and `nnsmooth`: mean magnitudes of the texture, which no signal has.
///
/// # Errors
/// See [`read`].
pub fn built_in() -> Result<Set, Failure> {
    let all = FILES.get_dir("phase").map(shipped::files).unwrap_or_default();
    let files = all.into_iter().map(|file| (file.path().to_owned(), file.contents().into()));
    set("built in".into(), Path::new("phase"), files.collect())
}

/// Reads every vector of a folder, and `sc.json` if it exists.
///
/// # Errors
/// A folder without vectors, and each vector that cannot be read.
pub fn read(dir: &Path) -> Result<Set, Failure> {
    let fail = |e: std::io::Error| Diagnostic::new(format!("cannot read this folder: {e}")).in_file(dir);
    let mut files = Files::new();
    for entry in std::fs::read_dir(dir).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        let name = path.to_string_lossy();
        if [".npz", ".mag.npy", ".sig.npy", "index.json", "sc.json"].iter().any(|end| name.ends_with(end)) {
            let bytes = file::read(&path, MAX_BYTES)?;
            files.insert(path, bytes.into());
        }
    }
    set(dir.display().to_string(), dir, files)
}

type Files = BTreeMap<PathBuf, Cow<'static, [u8]>>;

fn set(from: String, dir: &Path, files: Files) -> Result<Set, Failure> {
    let mut named: BTreeMap<&str, &Path> = BTreeMap::new();
    for path in files.keys() {
        let Some(file) = path.file_name().and_then(|n| n.to_str()) else { continue };
        if let Some(name) = file.strip_suffix(".npz").or_else(|| file.strip_suffix(".mag.npy")) {
            named.insert(name, path);
        } else if let Some(name) = file.strip_suffix(".sig.npy") {
            named.entry(name).or_insert(path);
        }
    }
    if named.is_empty() {
        return Err(wrong(dir, "there are no vectors in this folder", NAMES));
    }
    let index: Value = json(&files, &dir.join("index.json"))?;
    let (mut vectors, mut errors) = (Vec::new(), Vec::new());
    for (name, path) in named {
        match vector(name, path, &files[path], &index) {
            Ok(vector) => vectors.push(vector),
            Err(e) => errors.push(e.in_file(path)),
        }
    }
    if !errors.is_empty() {
        return Err(errors.into());
    }
    vectors.sort_by(|a, b| (a.rate_hz, &a.name).cmp(&(b.rate_hz, &b.name)));
    Ok(Set::new(from, vectors, json(&files, &dir.join("sc.json"))?))
}

fn json<T: DeserializeOwned + Default>(files: &Files, path: &Path) -> Result<T, Diagnostic> {
    let fail = |e| Diagnostic::new(format!("this JSON does not have the expected form: {e}")).in_file(path);
    files.get(path).map_or(Ok(T::default()), |bytes| serde_json::from_slice(bytes).map_err(fail))
}

fn vector(name: &str, path: &Path, bytes: &[u8], index: &Value) -> Result<Vector, Diagnostic> {
    if path.extension().is_some_and(|ending| ending == "npz") {
        return Vector::of_frames(name, Frames::of_archive(&Archive::parse(bytes)?, None, None)?);
    }
    let ending = name.rsplit_once('_').and_then(|(_, rate)| rate.parse().ok());
    let rate = index[name]["fs"].as_f64().or(ending);
    let Some(rate) = rate.filter(|r| r.fract() == 0.0 && (0.0..1e9).contains(r)) else {
        return Err(Diagnostic::new("the rate of this vector is unknown")
            .help("end its name in the rate, as in texture_2500.mag.npy, or give it an `fs` in index.json"));
    };
    let array = npy::parse(bytes)?;
    let magnitudes = path.to_string_lossy().ends_with(".mag.npy");
    match (magnitudes, array.shape.as_slice()) {
        (true, &[_, bins]) => Vector::new(name, rate as u32, array.values.into_f32(), bins),
        (false, &[_]) => Vector::of_signal(name, rate as u32, &array.values.into_f64()),
        (_, shape) => Err(Diagnostic::new(format!("an array of shape {shape:?} does not fit")).help(NAMES)),
    }
}

/// Agreement of one signal with one vector.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Spectral convergence \[dB\]; less is better.
    #[serde(rename(deserialize = "SC_dB"))]
    pub convergence_db: f64,
    /// Level error \[dB\]; 0 is best.
    #[serde(rename(deserialize = "gain_dB"))]
    pub level_db: f64,
    /// Root mean square error of the long-term spectrum \[dB\]; 0 is best.
    #[serde(rename(deserialize = "LTAS_rms_dB"))]
    pub ltas_rms_db: f64,
    /// Failures of the node.
    #[serde(default)]
    pub faults: u64,
}

impl Score {
    /// `None` for silence: its level and long-term spectrum mean nothing.
    pub fn heard(self) -> Option<Self> {
        (self.level_db >= -200.0).then_some(self)
    }
}

/// Scores that others published.
#[derive(Default, Deserialize)]
pub struct Published {
    /// Scores by the name of the vector, then of the method.
    pub sc: BTreeMap<String, BTreeMap<String, Score>>,
    /// Latencies by the name of the method: a number of frames, or "offline".
    #[serde(default)]
    pub latency_frames: BTreeMap<String, Value>,
    /// Where the methods come from.
    #[serde(default)]
    pub references: Vec<Reference>,
}

/// A publication, and the methods that it describes.
#[derive(Default, Deserialize)]
#[serde(default)]
pub struct Reference {
    authors: String,
    title: String,
    r#in: String,
    year: Option<u16>,
    /// In place of the above: why there is no publication.
    note: String,
    /// Names of its methods.
    pub methods: Vec<String>,
}

impl fmt::Display for Reference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { authors, title, r#in, year, note, .. } = self;
        let year = year.map(|year| year.to_string()).unwrap_or_default();
        let parts = [authors, title, r#in, &year, note].map(String::as_str);
        let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        f.write_str(&parts.join(", "))
    }
}
