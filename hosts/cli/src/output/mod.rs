//! Files that appear complete or not at all, and recordings that survive a killed run.

mod journal;
mod made;
mod salvage;

use std::fs::{File, Permissions, TryLockError};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use asperity_accuracy::npy;
use asperity_diagnostics::Diagnostic;
use asperity_graph::GraphFile;
use asperity_offline::probe;
use tempfile::{NamedTempFile, TempPath};

use crate::failure::{self, Failure, clean, warn, without_path, wrong};

pub use asperity_offline::load::{ending, is_standard};
use asperity_offline::probe::Facts;
pub use journal::keep_all;
pub use salvage::{GROWING, Recovered, recover, salvage};

/// Sample format of a WAV file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// 32-bit float
    F32,
    /// 24-bit integer
    I24,
    /// 16-bit integer
    I16,
}

/// Files that a run or a render writes.
#[derive(Clone, Debug, clap::Args)]
pub struct OutputArgs {
    /// Output file with a channel for each `audio_out`: .wav or .npy. In a render, - writes WAV to the
    /// standard output
    #[arg(long, value_name = "OUT.wav")]
    pub out: Option<PathBuf>,
    /// Sample format of the WAV file
    #[arg(long, value_enum, default_value = "f32")]
    pub format: Format,
    /// Record an output of a node to a file
    #[arg(long, value_name = "NODE.PORT=FILE.csv|.npy|.npz")]
    pub probe: Vec<String>,
    /// Report file: times, levels and faults of the run, as JSON; - writes to the standard output
    #[arg(long, value_name = "R.json")]
    pub report: Option<PathBuf>,
}

impl OutputArgs {
    /// Adds the nodes that `--probe` asks for. Answers their ids.
    pub fn add_probes(&self, graph: &mut GraphFile) -> Result<Vec<String>, Failure> {
        let add = |text: &String| {
            let (port, file) = split_probe(text)?;
            Ok(probe::add(graph, port, &[("file", file)], PROBE)?)
        };
        self.probe.iter().map(add).collect()
    }
}

/// The option, as it stands for a file in errors.
pub const PROBE: &str = "--probe";

/// Splits `NODE.PORT=FILE` of a probe.
fn split_probe(text: &str) -> Result<(&str, &str), Diagnostic> {
    let fail = |m: String, help: String| Err(Diagnostic::new(m).in_file(PROBE).help(help));
    let form = || "NODE.PORT=FILE.csv, .npy or .npz".to_owned();
    let Some((port, file)) = text.split_once('=') else {
        return fail(format!("there is no `=` in `{text}`"), form());
    };
    if file.trim().is_empty() {
        return fail(format!("there is no file after the `=` in `{text}`"), form());
    }
    Ok((port, file))
}

/// Ending of the temporary name of an incomplete file.
const PART: &str = ".part";

/// A file under a temporary name, beside its final one.
#[derive(Debug)]
pub struct Pending {
    path: PathBuf,
    temp: NamedTempFile,
    /// For an archive, whose rows are a .npy file until it is kept.
    facts: Option<Facts>,
}

impl Pending {
    /// Creates one. The folder must exist. An existing path of the name must be a file; links are followed.
    /// `-` is the standard output, to which the whole file is copied at last.
    pub fn create(path: &Path) -> Result<Self, Failure> {
        if is_standard(path) {
            failure::standard_output_is_taken();
            let temp = NamedTempFile::new().map_err(|e| Failure::writing(path, e))?;
            return Ok(Self { path: path.to_owned(), temp, facts: None });
        }
        let (path, there) = free(path)?;
        journal::tidy(&path);
        let dir = folder_of(&path);
        let prefix = format!(".{}.", path.file_name().unwrap_or_default().to_string_lossy());
        let mut builder = tempfile::Builder::new();
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // Like any new file, before the umask.
            builder.permissions(Permissions::from_mode(0o666));
        }
        builder.prefix(&prefix).suffix(PART);
        let temp = claimed(|| builder.tempfile_in(dir)).map_err(|e| refused(&path, e))?;
        Ok(Self::with(path, temp, there))
    }

    /// Creates a file called `NAME.recording` until it ends, also by a kill. Completes one that was left.
    pub fn recording(path: &Path) -> Result<Self, Failure> {
        let (path, there) = free(path)?;
        let name = format!("{}{GROWING}", path.file_name().unwrap_or_default().to_string_lossy());
        let growing = path.with_file_name(name);
        match recover(&growing, 1) {
            Ok(Recovered::Kept(kept)) => {
                let kept = kept.display();
                warn(&format!("{}: a run left this recording; it is now {kept}", growing.display()));
            }
            Ok(Recovered::Empty) => {}
            Ok(Recovered::Busy) => {
                let what = "another run records into this file";
                return Err(Diagnostic::new(what).in_file(&growing).into());
            }
            Err(e) if e.kind() == ErrorKind::NotFound => {}
            Err(e) => {
                let what = format!("this is in the way and cannot be completed: {e}");
                return Err(wrong(&growing, what, "move or remove it"));
            }
        }
        let temp = claimed(|| new_file(&growing)).map_err(|e| refused(&path, e))?;
        Ok(Self::with(path, temp, there))
    }

    fn with(path: PathBuf, temp: NamedTempFile, there: Option<Permissions>) -> Self {
        if let Some(permissions) = there {
            // Keep the permissions of the old file. A file system without permissions may refuse.
            let _ = temp.as_file().set_permissions(permissions);
        }
        Self { path, temp, facts: None }
    }

    pub fn file(&self) -> Result<File, Failure> {
        self.temp.as_file().try_clone().map_err(|e| Failure::writing(&self.path, e))
    }

    pub fn fill(mut self, text: &str) -> Result<Self, Failure> {
        self.temp.write_all(text.as_bytes()).map_err(|e| Failure::writing(&self.path, e))?;
        Ok(self)
    }

    /// The archive of the rows with their meaning; another file as it is.
    fn packed(mut self) -> Result<Self, Failure> {
        let Some(facts) = self.facts.take() else { return Ok(self) };
        let whole = Self::create(&self.path)?;
        let packed = facts.pack(&mut self.file()?, BufWriter::new(whole.file()?));
        packed.map_err(|e| Failure::writing(&self.path, e))?;
        self.temp.disable_cleanup(false);
        Ok(whole)
    }

    /// Gives the file its final name, and returns that.
    pub fn keep(self) -> Result<PathBuf, Failure> {
        let path = self.path.clone();
        keep_all(vec![self])?;
        Ok(path)
    }
}

/// The resolved path for a new file, and the permissions of the file that it replaces.
fn free(path: &Path) -> Result<(PathBuf, Option<Permissions>), Failure> {
    let refuse = |what: &str| Err(Diagnostic::new(what).in_file(path).into());
    let resolved = resolved(path);
    if std::fs::symlink_metadata(&resolved).is_ok_and(|meta| !meta.is_file()) {
        return refuse("this exists already and is not a file");
    }
    let there = std::fs::metadata(&resolved).ok().map(|meta| meta.permissions());
    if there.as_ref().is_some_and(Permissions::readonly) {
        return refuse("this file is there already, and may not be written");
    }
    Ok((resolved, there))
}

fn refused(path: &Path, e: io::Error) -> Failure {
    match e.kind() {
        // Not an error of the user's input.
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => Failure::writing(path, e),
        ErrorKind::NotFound if !folder_of(path).exists() => {
            let folder = folder_of(path);
            let is_missing = |f: &&Path| !f.as_os_str().is_empty() && !f.exists();
            let missing = folder.ancestors().take_while(is_missing).last().unwrap_or(folder);
            let what = format!("the folder {} does not exist", missing.display());
            wrong(path, what, format!("make it first: mkdir -p {}", folder.display()))
        }
        _ => Diagnostic::new(format!("cannot write here: {}", without_path(e))).in_file(path).into(),
    }
}

/// A new file, locked while its process lives, so that [`left_over`] leaves it alone.
fn claimed(mut make: impl FnMut() -> io::Result<NamedTempFile>) -> io::Result<NamedTempFile> {
    loop {
        let mut temp = make()?;
        // Waits for another process that found the file unlocked, and may remove it. Not every disk has
        // locks.
        let _ = temp.as_file().lock();
        if temp.path().exists() {
            return Ok(temp);
        }
        temp.disable_cleanup(true);
    }
}

fn new_file(path: &Path) -> io::Result<NamedTempFile> {
    let file = File::options().read(true).write(true).create_new(true).open(path)?;
    Ok(NamedTempFile::from_parts(file, TempPath::try_from_path(path)?))
}

/// Opens and locks a file whose process has ended; `None` if the process lives.
fn left_over(path: &Path) -> io::Result<Option<File>> {
    // Opening a pipe could block.
    if !std::fs::symlink_metadata(path)?.is_file() {
        return Err(ErrorKind::InvalidInput.into());
    }
    let file = File::options().read(true).write(true).open(path)?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(e)) => Err(e),
    }
}

pub fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Writes a folder to the disk, so that a file's name survives a crash of the machine.
fn sync_folder(file: &Path) {
    if cfg!(unix) {
        // Not every disk supports it.
        let _ = File::open(folder_of(file)).and_then(|folder| folder.sync_all());
    }
}

pub fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    Pending::create(path)?.fill(text)?.keep().map(drop)
}

static OVERWRITE: AtomicBool = AtomicBool::new(false);

pub fn overwrite() {
    OVERWRITE.store(true, Relaxed);
}

/// Checks that a graph may write this file. A file that the command line names needs no check.
pub fn permit(file: &Path, node: &str) -> Result<(), Diagnostic> {
    let whole = resolved(file);
    let here = Path::new(".").canonicalize();
    if !here.is_ok_and(|here| whole.starts_with(here)) {
        let what = format!("this graph would write outside of the working directory, to {}", whole.display());
        return Err(Diagnostic::new(what).help(format!("name the file: --set {node}.file=FILE")));
    }
    if whole.exists() && !OVERWRITE.load(Relaxed) && !made::is_ours(&whole) {
        let what = format!("this graph would write over {}, which Asperity did not make", file.display());
        let help = format!("add --overwrite, or name another file: --set {node}.file=FILE");
        return Err(Diagnostic::new(what).help(help));
    }
    Ok(())
}

/// A path that is the same for all names of a file, also of one that does not exist yet.
pub fn resolved(path: &Path) -> PathBuf {
    let mut path = path.to_owned();
    if is_standard(&path) {
        return path;
    }
    // Follow links by hand: their target may not exist yet. A cycle ends after 40 steps.
    for _ in 0..40 {
        let Ok(target) = std::fs::read_link(&path) else { break };
        path = path.parent().unwrap_or(Path::new("")).join(target);
    }
    if let Ok(path) = path.canonicalize() {
        return path;
    }
    match (folder_of(&path).canonicalize(), path.file_name()) {
        (Ok(dir), Some(name)) => dir.join(name),
        _ => path,
    }
}

/// A file, and who reads or writes it.
pub type Named = (PathBuf, String);

/// Files that options name.
pub fn named(options: &[(&str, Option<&PathBuf>)]) -> Vec<Named> {
    options.iter().filter_map(|(option, path)| Some(((*path)?.clone(), (*option).to_owned()))).collect()
}

/// Refuses to write where a file is read, or where another one is written.
pub fn apart(read: Vec<Named>, written: Vec<Named>) -> Result<(), Failure> {
    let read: Vec<Named> = read.into_iter().filter(|(path, _)| !is_standard(path)).collect();
    let reads = read.len();
    let all: Vec<Named> = read.into_iter().chain(written).map(|(path, who)| (resolved(&path), who)).collect();
    for (i, (path, who)) in all.iter().enumerate().skip(reads) {
        let Some(first) = all[..i].iter().position(|(other, _)| other == path) else { continue };
        let other = &all[first].1;
        let what = match first < reads {
            true => format!("{other} reads this file, and it would be overwritten by {who}"),
            false => format!("{other} would write the same file as {who}"),
        };
        return Err(wrong(path, what, "give each a file of its own"));
    }
    Ok(())
}

/// Refuses a new file that nobody would find, since its name does not end in .ron.
pub fn ends_in_ron(path: &Path, what: &str) -> Result<(), Failure> {
    if ending(path) == "ron" {
        return Ok(());
    }
    let found = format!("{} would not be found as a {what}", clean(&path.display().to_string()));
    Err(wrong("--out", found, format!("a {what}'s name ends in .ron")))
}

/// Ending of a file of samples, which chooses its format; WAV on the standard output.
pub fn audio_ending(path: &Path) -> String {
    if is_standard(path) { "wav".to_owned() } else { ending(path) }
}

/// A file of rows of samples or values: WAV, NumPy or CSV.
pub struct Rows {
    pending: Pending,
    to: To,
}

enum To {
    Wav(hound::WavWriter<BufWriter<File>>, Format),
    Npy(npy::Writer<BufWriter<File>>),
    Csv(BufWriter<File>),
}

/// Largest size of a WAV file's samples \[bytes\]: its header counts them in 32 bits.
const MAX_WAV_BYTES: u64 = u32::MAX as u64 - 1024;

impl Format {
    fn bits(self) -> u16 {
        match self {
            Format::F32 => 32,
            Format::I24 => 24,
            Format::I16 => 16,
        }
    }
}

impl Rows {
    pub fn check_wav_length(path: &Path, samples: u64, format: Format) -> Result<(), Diagnostic> {
        let bytes = samples * u64::from(format.bits() / 8);
        if bytes <= MAX_WAV_BYTES {
            return Ok(());
        }
        let part = 100.0 * MAX_WAV_BYTES as f64 / bytes as f64;
        Err(Diagnostic::new(format!("a WAV file cannot hold {bytes} bytes of samples"))
            .in_file(path)
            .help(format!("render at most {part:.0} % of it, in --format i16, or to a .npy file")))
    }

    fn new(pending: Pending, to: impl FnOnce(BufWriter<File>) -> io::Result<To>) -> Result<Self, Failure> {
        let to = to(BufWriter::new(pending.file()?)).map_err(|e| Failure::writing(&pending.path, e))?;
        Ok(Self { pending, to })
    }

    /// A WAV file; a row has a sample of each channel.
    pub fn wav(pending: Pending, channels: usize, rate_hz: u32, format: Format) -> Result<Self, Failure> {
        let is_float = format == Format::F32;
        let sample_format = if is_float { hound::SampleFormat::Float } else { hound::SampleFormat::Int };
        Self::new(pending, |file| {
            let channels = u16::try_from(channels).map_err(io::Error::other)?;
            let bits_per_sample = format.bits();
            let spec = hound::WavSpec { channels, sample_rate: rate_hz, bits_per_sample, sample_format };
            Ok(To::Wav(hound::WavWriter::new(file, spec).map_err(of_wav)?, format))
        })
    }

    /// A .npy file of float32: one dimension for `None`, else rows of this many columns.
    pub fn npy(pending: Pending, columns: Option<usize>) -> Result<Self, Failure> {
        Self::new(pending, |file| npy::Writer::new(file, columns).map(To::Npy))
    }

    /// A .npz archive of such rows and their meaning.
    pub fn npz(mut pending: Pending, columns: Option<usize>, facts: Facts) -> Result<Self, Failure> {
        pending.facts = Some(facts);
        Self::npy(pending, columns)
    }

    /// A CSV file: a time in seconds, then the columns of this header.
    pub fn csv(pending: Pending, header: &[String]) -> Result<Self, Failure> {
        Self::new(pending, |mut file| {
            writeln!(file, "t_s,{}", header.join(","))?;
            Ok(To::Csv(file))
        })
    }

    /// Appends a row to a CSV file, exactly.
    pub fn line(&mut self, time: f64, values: &[f64]) -> Result<(), Failure> {
        let To::Csv(file) = &mut self.to else {
            let what = format!("{} is no .csv file", self.pending.path.display());
            return Err(Failure::Machine(what));
        };
        let mut write = || {
            write!(file, "{time}")?;
            values.iter().try_for_each(|x| write!(file, ",{x}"))?;
            writeln!(file)
        };
        write().map_err(|e| Failure::writing(&self.pending.path, e))
    }

    /// Appends rows; `time` answers the time of each \[s\].
    pub fn append(
        &mut self,
        values: &[f32],
        columns: usize,
        mut time: impl FnMut(usize) -> f64,
    ) -> Result<(), Failure> {
        let done = match &mut self.to {
            To::Wav(writer, format) => values.iter().try_for_each(|&x| {
                match format {
                    Format::F32 => writer.write_sample(x),
                    Format::I24 => writer.write_sample((x.clamp(-1.0, 1.0) * 8_388_607.0).round() as i32),
                    Format::I16 => writer.write_sample((x.clamp(-1.0, 1.0) * 32_767.0).round() as i16),
                }
                .map_err(of_wav)
            }),
            To::Npy(writer) => writer.append(values),
            To::Csv(file) => values.chunks(columns.max(1)).enumerate().try_for_each(|(i, row)| {
                write!(file, "{}", time(i))?;
                row.iter().try_for_each(|x| write!(file, ",{x}"))?;
                writeln!(file)
            }),
        };
        done.map_err(|e| Failure::writing(&self.pending.path, e))
    }

    /// Brings the file and its header up to date, and keeps it if the run is killed.
    pub fn refresh(&mut self) -> Result<(), Failure> {
        let done = match &mut self.to {
            To::Wav(writer, _) => writer.flush().map_err(of_wav),
            To::Npy(writer) => writer.flush(),
            To::Csv(file) => file.flush(),
        };
        done.map_err(|e| Failure::writing(&self.pending.path, e))?;
        self.pending.temp.disable_cleanup(true);
        Ok(())
    }

    pub fn path(&self) -> &Path {
        &self.pending.path
    }

    pub fn abandon(self) -> Pending {
        // Dropping a writer flushes it, if that is possible.
        drop(self.to);
        self.pending
    }

    pub fn finish(mut self) -> Result<Pending, Failure> {
        self.refresh()?;
        self.pending.temp.disable_cleanup(false);
        Ok(self.abandon())
    }
}

fn of_wav(e: hound::Error) -> io::Error {
    match e {
        hound::Error::IoError(e) => e,
        e => io::Error::other(e),
    }
}
