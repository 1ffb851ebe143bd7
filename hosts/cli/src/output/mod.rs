//! Files that appear whole or not at all.

use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use asperity_measure::npy;
use asperity_source::Diagnostic;
use tempfile::NamedTempFile;

use crate::args::Format;
use crate::failure::Failure;

/// A file under a temporary name beside the one it is to have.
#[derive(Debug)]
pub struct Pending {
    path: PathBuf,
    temp: NamedTempFile,
}

impl Pending {
    /// Opens one. The folder must be there, and what already has the name must be a file; a link is followed.
    pub fn create(path: &Path) -> Result<Self, Failure> {
        let refuse = |what: String| Failure::from(Diagnostic::new(what).in_file(path));
        let path = &resolved(path);
        if std::fs::symlink_metadata(path).is_ok_and(|meta| !meta.is_file()) {
            return Err(refuse("this is there already and is no file".into()));
        }
        let there = std::fs::metadata(path).ok().map(|meta| meta.permissions());
        if there.as_ref().is_some_and(|p| p.readonly()) {
            return Err(refuse("this file is there already, and may not be written".into()));
        }
        let dir = path.parent().filter(|d| !d.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let prefix = format!(".{}.", path.file_name().unwrap_or_default().to_string_lossy());
        let mut builder = tempfile::Builder::new();
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // As any new file: the umask takes its part of this.
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let temp =
            builder.prefix(&prefix).suffix(".part").tempfile_in(dir).map_err(
                |e| match std::io::Error::from(e.kind()) {
                    // Nothing that the user gave is wrong.
                    full if matches!(full.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded) => {
                        Failure::writing(path, full)
                    }
                    other => refuse(format!("cannot write here: {other}")),
                },
            )?;
        if let Some(permissions) = there {
            // Who may read it stays as it was; a file system without such a thing says no, and nothing is lost.
            let _ = temp.as_file().set_permissions(permissions);
        }
        Ok(Self { path: path.to_owned(), temp })
    }

    /// A second handle on the file.
    pub fn file(&self) -> Result<File, Failure> {
        self.temp.as_file().try_clone().map_err(|e| Failure::writing(&self.path, e))
    }

    /// Fills the file and gives it its name, which it answers.
    pub fn keep_text(mut self, text: &str) -> Result<PathBuf, Failure> {
        let path = self.path.clone();
        self.temp.write_all(text.as_bytes()).map_err(|e| Failure::writing(&path, e))?;
        self.keep()?;
        Ok(path)
    }

    /// Gives the file its name.
    pub fn keep(self) -> Result<(), Failure> {
        let path = self.path.clone();
        self.temp.as_file().sync_data().map_err(|e| Failure::writing(&path, e))?;
        self.temp.persist(&path).map(drop).map_err(|e| Failure::writing(&path, e.error))
    }
}

/// Writes a whole text.
pub fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    Pending::create(path)?.keep_text(text).map(drop)
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
            * if format == Format::F32 {
                4
            } else if format == Format::I24 {
                3
            } else {
                2
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
    pub fn wav(path: &Path, channels: usize, rate_hz: u32, format: Format) -> Result<Self, Failure> {
        let pending = Pending::create(path)?;
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
    pub fn npy(path: &Path, columns: Option<usize>) -> Result<Self, Failure> {
        let pending = Pending::create(path)?;
        let writer = npy::Writer::new(BufWriter::new(pending.file()?), columns);
        Ok(Self { to: To::Npy(writer.map_err(|e| Failure::writing(path, e))?), pending })
    }

    /// A CSV file: a time in seconds, then the columns of this header.
    pub fn csv(path: &Path, header: &[String]) -> Result<Self, Failure> {
        let pending = Pending::create(path)?;
        let mut file = BufWriter::new(pending.file()?);
        writeln!(file, "t_s,{}", header.join(",")).map_err(|e| Failure::writing(path, e))?;
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

    /// Completes the file and gives it its name.
    pub fn keep(self) -> Result<(), Failure> {
        let path = self.pending.path.clone();
        match self.to {
            To::Wav(writer, _) => writer.finalize().map_err(|e| Failure::writing(&path, e))?,
            To::Npy(writer) => {
                let mut inner = writer.finish().map_err(|e| Failure::writing(&path, e))?;
                inner.flush().map_err(|e| Failure::writing(&path, e))?;
            }
            To::Csv(mut file, _) => file.flush().map_err(|e| Failure::writing(&path, e))?,
        }
        self.pending.keep()
    }
}
