//! Files that appear whole or not at all, and recordings that survive their run.

mod journal;
mod made;
mod salvage;

use std::fs::{File, Permissions, TryLockError};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use asperity_accuracy::npy;
use asperity_diagnostics::Diagnostic;
use tempfile::{NamedTempFile, TempPath};

use crate::failure::{Failure, warn, without_path};

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

/// End of a name that a file has until it is whole.
const PART: &str = ".part";

/// A file under a temporary name beside the one it is to have.
#[derive(Debug)]
pub struct Pending {
    path: PathBuf,
    temp: NamedTempFile,
}

impl Pending {
    /// Opens one. The folder must be there, and what already has the name must be a file; a link is followed.
    pub fn create(path: &Path) -> Result<Self, Failure> {
        let (path, there) = free(path)?;
        journal::tidy(&path);
        let dir = path.parent().filter(|d| !d.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let prefix = format!(".{}.", path.file_name().unwrap_or_default().to_string_lossy());
        let mut builder = tempfile::Builder::new();
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // As any new file: the umask takes its part of this.
            builder.permissions(Permissions::from_mode(0o666));
        }
        builder.prefix(&prefix).suffix(PART);
        let temp = claimed(|| builder.tempfile_in(dir)).map_err(|e| refused(&path, e))?;
        Ok(Self::with(path, temp, there))
    }

    /// Opens a recording: a file called `NAME.recording` while it grows, that stays if the run is killed.
    ///
    /// One that an earlier run left there is completed first, under a name with a number.
    pub fn recording(path: &Path) -> Result<Self, Failure> {
        let (path, there) = free(path)?;
        let name = format!("{}{GROWING}", path.file_name().unwrap_or_default().to_string_lossy());
        let growing = path.with_file_name(name);
        let refuse = |what: String| Diagnostic::new(what).in_file(&growing);
        if growing.exists() {
            match recover(&growing, 1) {
                Ok(Recovered::Kept(kept)) => {
                    let kept = kept.display();
                    warn(&format!("{}: a run left this recording; it is now {kept}", growing.display()));
                }
                Ok(Recovered::Empty) => {}
                Ok(Recovered::Busy) => {
                    return Err(refuse("another run records into this file".into()).into());
                }
                Err(e) => {
                    let why = format!("this is in the way and cannot be completed: {e}");
                    return Err(refuse(why).help("move or remove it").into());
                }
            }
        }
        let make = || {
            let file = File::options().read(true).write(true).create_new(true).open(&growing)?;
            Ok(NamedTempFile::from_parts(file, TempPath::try_from_path(&growing)?))
        };
        let temp = claimed(make).map_err(|e| refused(&path, e))?;
        Ok(Self::with(path, temp, there))
    }

    fn with(path: PathBuf, temp: NamedTempFile, there: Option<Permissions>) -> Self {
        if let Some(permissions) = there {
            // Who may read it stays as it was; a file system without such a thing says no, and nothing is lost.
            let _ = temp.as_file().set_permissions(permissions);
        }
        Self { path, temp }
    }

    /// A second handle on the file.
    pub fn file(&self) -> Result<File, Failure> {
        self.temp.as_file().try_clone().map_err(|e| Failure::writing(&self.path, e))
    }

    /// Fills the file.
    pub fn fill(mut self, text: &str) -> Result<Self, Failure> {
        self.temp.write_all(text.as_bytes()).map_err(|e| Failure::writing(&self.path, e))?;
        Ok(self)
    }

    /// Gives the file its name, which it returns.
    pub fn keep(self) -> Result<PathBuf, Failure> {
        let path = self.path.clone();
        keep_all(vec![self])?;
        Ok(path)
    }
}

/// Where a file is to be, and who may read what is there now.
fn free(path: &Path) -> Result<(PathBuf, Option<Permissions>), Failure> {
    let refuse = |what: &str| Err(Diagnostic::new(what).in_file(path).into());
    let resolved = resolved(path);
    if std::fs::symlink_metadata(&resolved).is_ok_and(|meta| !meta.is_file()) {
        return refuse("this is there already and is no file");
    }
    let there = std::fs::metadata(&resolved).ok().map(|meta| meta.permissions());
    if there.as_ref().is_some_and(Permissions::readonly) {
        return refuse("this file is there already, and may not be written");
    }
    Ok((resolved, there))
}

/// Why a file cannot be made.
fn refused(path: &Path, e: io::Error) -> Failure {
    match e.kind() {
        // Nothing that the user gave is wrong.
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => Failure::writing(path, e),
        _ => Diagnostic::new(format!("cannot write here: {}", without_path(e))).in_file(path).into(),
    }
}

/// A new file, locked for as long as its process lives: [`left_over`] does not take it for left.
fn claimed(mut make: impl FnMut() -> io::Result<NamedTempFile>) -> io::Result<NamedTempFile> {
    loop {
        let mut temp = make()?;
        // Waits for a process that looks at the file before it is locked, and may remove it.
        // Not every disk has locks.
        let _ = temp.as_file().lock();
        if temp.path().exists() {
            return Ok(temp);
        }
        temp.disable_cleanup(true);
    }
}

/// A file, locked, whose process is gone; none where it lives.
///
/// # Errors
/// The file cannot be opened; the disk has no locks.
fn left_over(path: &Path) -> io::Result<Option<File>> {
    // Opening a pipe could wait for ever.
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

/// Makes a file's name last where the machine stops.
fn sync_folder(file: &Path) {
    if cfg!(unix) {
        let folder = file.parent().filter(|dir| !dir.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // Not every disk can.
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
    }
}

/// Writes a whole text.
pub fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    Pending::create(path)?.fill(text)?.keep().map(drop)
}

/// Whether a graph may write over files that Asperity did not make.
static OVERWRITE: AtomicBool = AtomicBool::new(false);

/// From here on a graph may write over files that Asperity did not make.
pub fn overwrite() {
    OVERWRITE.store(true, Relaxed);
}

/// Whether a graph may have this file written: below the working directory, and over none that Asperity did
/// not make. Whoever names a file on the command line may do as they please.
///
/// # Errors
/// Why not.
pub fn permit(file: &Path) -> Result<(), Diagnostic> {
    let whole = resolved(file);
    let here = Path::new(".").canonicalize();
    if !here.is_ok_and(|here| whole.starts_with(here)) {
        let what = format!("this graph would write outside of the working directory, to {}", whole.display());
        return Err(Diagnostic::new(what).help("name the file on the command line: --set NODE.file=FILE"));
    }
    if whole.exists() && !OVERWRITE.load(Relaxed) && !made::is_ours(&whole) {
        let what = format!("this graph would write over {}, which Asperity did not make", file.display());
        return Err(Diagnostic::new(what)
            .help("add --overwrite, or name another file on the command line: --set NODE.file=FILE"));
    }
    Ok(())
}

/// A path by which two names of one file are the same, also of a file that is not there yet.
pub fn resolved(path: &Path) -> PathBuf {
    let mut path = path.to_owned();
    // A link may lead to what is not there yet. One that leads to itself ends here as what it is.
    for _ in 0..40 {
        let Ok(target) = std::fs::read_link(&path) else { break };
        path = path.parent().unwrap_or(Path::new("")).join(target);
    }
    if let Ok(path) = path.canonicalize() {
        return path;
    }
    let dir = path.parent().filter(|d| !d.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match (dir.canonicalize(), path.file_name()) {
        (Ok(dir), Some(name)) => dir.join(name),
        _ => path,
    }
}

/// The ending of a file's name, in lower case.
pub fn ending(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// What takes rows of samples or values.
#[derive(Debug)]
pub struct Rows {
    pending: Pending,
    to: To,
}

enum To {
    Wav(hound::WavWriter<BufWriter<File>>, Format),
    Npy(npy::Writer<BufWriter<File>>),
    Csv(BufWriter<File>, Vec<u8>),
}

impl std::fmt::Debug for To {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            To::Wav(..) => "Wav",
            To::Npy(..) => "Npy",
            To::Csv(..) => "Csv",
        })
    }
}

/// Largest size of a WAV file's samples in bytes: its header counts them in 32 bits.
const MAX_WAV_BYTES: u64 = u32::MAX as u64 - 1024;

impl Rows {
    /// Refuses a WAV file of so many samples in all that its header could not say how many.
    pub fn check_wav_length(path: &Path, samples: u64, format: Format) -> Result<(), Diagnostic> {
        let bytes = samples
            * match format {
                Format::F32 => 4,
                Format::I24 => 3,
                Format::I16 => 2,
            };
        if bytes <= MAX_WAV_BYTES {
            return Ok(());
        }
        let part = 100.0 * MAX_WAV_BYTES as f64 / bytes as f64;
        Err(Diagnostic::new(format!("a WAV file cannot hold {bytes} bytes of samples"))
            .in_file(path)
            .help(format!("render at most {part:.0} % of it, in --format i16, or to a .npy file")))
    }

    /// A WAV file; a row is one sample of every channel.
    pub fn wav(pending: Pending, channels: usize, rate_hz: u32, format: Format) -> Result<Self, Failure> {
        let path = &pending.path;
        let (bits_per_sample, sample_format) = match format {
            Format::F32 => (32, hound::SampleFormat::Float),
            Format::I24 => (24, hound::SampleFormat::Int),
            Format::I16 => (16, hound::SampleFormat::Int),
        };
        let channels = u16::try_from(channels).map_err(|e| Failure::writing(path, e))?;
        let spec = hound::WavSpec { channels, sample_rate: rate_hz, bits_per_sample, sample_format };
        let writer = hound::WavWriter::new(BufWriter::new(pending.file()?), spec);
        Ok(Self { to: To::Wav(writer.map_err(|e| Failure::writing(path, e))?, format), pending })
    }

    /// A .npy file of float32: one dimension for `None`, else rows of so many columns.
    pub fn npy(pending: Pending, columns: Option<usize>) -> Result<Self, Failure> {
        let path = &pending.path;
        let writer = npy::Writer::new(BufWriter::new(pending.file()?), columns);
        Ok(Self { to: To::Npy(writer.map_err(|e| Failure::writing(path, e))?), pending })
    }

    /// A CSV file: a time in seconds, then the columns of this header.
    pub fn csv(pending: Pending, header: &[String]) -> Result<Self, Failure> {
        let mut file = BufWriter::new(pending.file()?);
        writeln!(file, "t_s,{}", header.join(",")).map_err(|e| Failure::writing(&pending.path, e))?;
        Ok(Self { to: To::Csv(file, Vec::new()), pending })
    }

    /// Appends rows; `time` answers the time of each, in seconds.
    pub fn append(
        &mut self,
        values: &[f32],
        columns: usize,
        mut time: impl FnMut(usize) -> f64,
    ) -> Result<(), Failure> {
        let path = &self.pending.path;
        match &mut self.to {
            To::Wav(writer, format) => {
                for &x in values {
                    match format {
                        Format::F32 => writer.write_sample(x),
                        Format::I24 => writer.write_sample((x.clamp(-1.0, 1.0) * 8_388_607.0).round() as i32),
                        Format::I16 => writer.write_sample((x.clamp(-1.0, 1.0) * 32_767.0).round() as i16),
                    }
                    .map_err(|e| Failure::writing(path, e))?;
                }
                Ok(())
            }
            To::Npy(writer) => writer.append(values).map_err(|e| Failure::writing(path, e)),
            To::Csv(file, line) => {
                line.clear();
                for (i, row) in values.chunks(columns.max(1)).enumerate() {
                    let _ = write!(line, "{}", time(i));
                    for x in row {
                        let _ = write!(line, ",{x}");
                    }
                    line.push(b'\n');
                }
                file.write_all(line).map_err(|e| Failure::writing(path, e))
            }
        }
    }

    /// Brings the file and its header up to date, and keeps it even if the run is killed.
    pub fn refresh(&mut self) -> Result<(), Failure> {
        let path = &self.pending.path;
        match &mut self.to {
            To::Wav(writer, _) => writer.flush().map_err(|e| Failure::writing(path, e))?,
            To::Npy(writer) => writer.flush().map_err(|e| Failure::writing(path, e))?,
            To::Csv(file, _) => file.flush().map_err(|e| Failure::writing(path, e))?,
        }
        self.pending.temp.disable_cleanup(true);
        Ok(())
    }

    /// Where it goes.
    pub fn path(&self) -> &Path {
        &self.pending.path
    }

    /// What was written so far, as far as the disk took it, without completing it.
    pub fn abandon(self) -> Pending {
        // Who writes puts down what it still holds, where that is possible.
        drop(self.to);
        self.pending
    }

    /// Completes the file.
    pub fn finish(self) -> Result<Pending, Failure> {
        let path = &self.pending.path;
        match self.to {
            To::Wav(writer, _) => writer.finalize().map_err(|e| Failure::writing(path, e))?,
            To::Npy(writer) => writer.finish().map(drop).map_err(|e| Failure::writing(path, e))?,
            To::Csv(mut file, _) => file.flush().map_err(|e| Failure::writing(path, e))?,
        }
        Ok(self.pending)
    }
}
