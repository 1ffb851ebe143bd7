//! The log of a participant: one line of JSON an event, only appended to.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use asperity_diagnostics::{Diagnostic, file};
use serde::{Deserialize, Serialize};

use crate::Answer;

/// Largest log.
const MOST_BYTES: u64 = 4 << 30;

/// Something that happened, in the order of time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// A session begins, or goes on.
    Begin {
        /// Title of the study.
        study: String,
        /// Code of the participant.
        participant: String,
        /// Number of the participant, from 1.
        number: u32,
        /// Version of the program.
        version: String,
        /// Path and hash of each file that trials depend on, the experiment first.
        files: Vec<(String, String)>,
        /// Time of day, UTC, as in RFC 3339.
        at: String,
        /// Options of the command that the stimuli depend on.
        #[serde(default)]
        options: Options,
    },
    /// A trial is shown.
    Shown {
        /// Its number in the participant's plan, from 0.
        trial: usize,
        /// Times that it was shown before.
        attempt: u32,
        /// Level of its varied parameter.
        level: Option<f64>,
    },
    /// Another stimulus is felt, in ticks and samples of the sound card's clock.
    Stimulus {
        /// Number of the trial.
        trial: usize,
        /// Times that the trial was shown before.
        #[serde(default)]
        attempt: u32,
        /// Place of the stimulus in the trial's order, from 0. That of the reference follows the last.
        /// `None`: nothing is felt.
        place: Option<usize>,
        /// Name of the stimulus.
        #[serde(default)]
        stimulus: Option<String>,
        /// Level of its varied parameter.
        #[serde(default)]
        level: Option<f64>,
        /// Gain that matches its level to others; 0 for a sample or silence.
        #[serde(default)]
        gain: f64,
        /// First tick that plays it.
        tick: u64,
        /// First sample of that tick.
        sample: u64,
    },
    /// Inputs of ticks, one after the other. Ticks between two events of an output were skipped.
    Inputs {
        /// First tick.
        tick: u64,
        /// Number of ticks.
        ticks: u64,
        /// Output of the hand, such as `position`.
        output: String,
        /// Its values: little-endian f32 in base64, one row a tick. A single row holds for all ticks.
        values: String,
    },
    /// Ticks were late, skipped or not logged, or samples were not played.
    Missed {
        /// A tick soon after.
        tick: u64,
        /// Deadlines missed since the last such event.
        deadlines: u64,
        /// Ticks skipped.
        skipped: u64,
        /// Samples that the sound card did not get in time.
        samples: u64,
        /// Ticks whose inputs the log lacks.
        unlogged: u64,
        /// Samples that the limits of the sound card's channels changed.
        #[serde(default)]
        limited: u64,
    },
    /// The experimenter mutes the output, or unmutes it.
    Muted {
        /// A tick soon after.
        tick: u64,
        /// Whether it is muted.
        muted: bool,
    },
    /// The session pauses, or goes on.
    Paused {
        /// Whether it pauses.
        paused: bool,
    },
    /// All questions of a trial are answered.
    Answered {
        /// Number of the trial.
        trial: usize,
        /// Answer to each question, by name.
        answers: Vec<(String, Answer)>,
        /// Time in s from when its stimuli could be felt, after the reference. Pauses are left out.
        seconds: f64,
    },
    /// A trial does not count, and why.
    Marked {
        /// Number of the trial.
        trial: usize,
        /// Reason for people.
        why: String,
        /// Answers that were given nevertheless.
        #[serde(default)]
        answers: Vec<(String, Answer)>,
    },
    /// Answers to the survey.
    Survey {
        /// Answer to each question, by name.
        answers: Vec<(String, Answer)>,
    },
    /// A remark of the experimenter.
    Note {
        /// The text.
        text: String,
        /// Number of the trial, if one is under way.
        trial: Option<usize>,
    },
    /// The last trial and the survey are answered.
    End,
}

/// Options of a session that its stimuli depend on.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Options {
    /// Hand device, as on the command line.
    pub hand: Option<String>,
    /// Recorded stroke in place of a hand.
    pub input: Option<PathBuf>,
    /// Whether the stroke is repeated.
    pub repeat: bool,
    /// Plugins.
    pub plugins: Vec<PathBuf>,
}

/// Version that a simulated session begins with.
pub const SIMULATED: &str = "simulated by ";

/// Whether a log has simulated answers.
pub fn is_simulated(events: &[Event]) -> bool {
    matches!(events.first(), Some(Event::Begin { version, .. }) if version.starts_with(SIMULATED))
}

/// Appends events to a file. Each is on disk before [`append`](Self::append) returns.
#[derive(Debug)]
pub struct Log {
    file: File,
    /// Bytes of whole events. The next append cuts off the rest of a failed one.
    end: u64,
}

impl Log {
    /// Opens a log to append to it, or makes one. A torn last line, which a power cut leaves, is cut off.
    /// Returns the events so far.
    ///
    /// # Errors
    /// A file that cannot be opened, or that another session has open; a whole line that is no event, with
    /// its number.
    pub fn open(path: &Path) -> Result<(Self, Vec<Event>), Diagnostic> {
        let cannot = |e: io::Error| Diagnostic::new(format!("cannot write the log: {e}")).in_file(path);
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(cannot)?;
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            let help = "a participant has one session at a time; stop the other one";
            return Err(Diagnostic::new("another session writes this log").in_file(path).help(help));
        }
        let mut bytes = Vec::new();
        (&file).read_to_end(&mut bytes).map_err(cannot)?;
        let (events, whole) = whole_events(bytes).map_err(|e| e.in_file(path))?;
        let it = Self { file, end: whole as u64 };
        it.file.set_len(it.end).and_then(|()| it.file.sync_all()).map_err(cannot)?;
        Ok((it, events))
    }

    /// Appends an event and waits until it is on disk.
    ///
    /// # Errors
    /// A full disk and other reasons of the system. Nothing is appended then.
    pub fn append(&mut self, event: &Event) -> io::Result<()> {
        self.append_all([event])
    }

    /// Appends several events at once; see [`append`](Self::append). None is there if it fails.
    ///
    /// # Errors
    /// Those of [`append`](Self::append).
    pub fn append_all<'e>(&mut self, events: impl IntoIterator<Item = &'e Event>) -> io::Result<()> {
        let mut lines = String::new();
        for event in events {
            lines += &serde_json::to_string(event)?;
            lines.push('\n');
        }
        if lines.is_empty() {
            return Ok(());
        }
        let Self { file, end } = self;
        file.set_len(*end)?;
        file.seek(SeekFrom::Start(*end))?;
        let written = file.write_all(lines.as_bytes()).and_then(|()| file.sync_data());
        match written {
            Ok(()) => *end += lines.len() as u64,
            // Now, so that readers do not see it; else the next append does it.
            Err(_) => _ = file.set_len(*end),
        }
        written
    }
}

/// Reads a log that another program may still write. A torn last line is left out.
///
/// # Errors
/// A file that cannot be read; a whole line that is no event, with its number.
pub fn read(path: &Path) -> Result<Vec<Event>, Diagnostic> {
    let bytes = file::read(path, MOST_BYTES)?;
    whole_events(bytes).map(|(events, _)| events).map_err(|e| e.in_file(path))
}

/// Events of the whole lines of a log, and their bytes. A torn last line may end within a character.
fn whole_events(mut bytes: Vec<u8>) -> Result<(Vec<Event>, usize), Diagnostic> {
    let whole = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
    bytes.truncate(whole);
    let text = String::from_utf8(bytes).map_err(|_| Diagnostic::new("this log is no text"))?;
    Ok((parse(&text)?, whole))
}

/// Events of a log's text. A torn last line is left out.
///
/// # Errors
/// A whole line that is no event, with its number.
pub fn parse(text: &str) -> Result<Vec<Event>, Diagnostic> {
    let whole = text.rfind('\n').map_or(0, |at| at + 1);
    let event = |(i, line): (usize, &str)| {
        serde_json::from_str(line).map_err(|e| Diagnostic::new(format!("line {} is no event: {e}", i + 1)))
    };
    text[..whole].lines().enumerate().map(event).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answered(trial: usize) -> Event {
        Event::Answered { trial, answers: vec![("räuh".into(), Answer::Number(4))], seconds: 2.5 }
    }

    #[test]
    fn log_cut_at_any_byte_keeps_every_whole_event() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log.jsonl");
        let (mut log, none) = Log::open(&path).unwrap();
        assert!(none.is_empty());
        let events: Vec<Event> = (0..5).map(answered).collect();
        let mut ends = vec![0];
        for event in &events {
            log.append(event).unwrap();
            ends.push(std::fs::metadata(&path).unwrap().len());
        }
        drop(log);
        let bytes = std::fs::read(&path).unwrap();
        for cut in 0..=bytes.len() {
            std::fs::write(&path, &bytes[..cut]).unwrap();
            let whole = ends.iter().filter(|end| **end <= cut as u64).count() - 1;
            assert_eq!(read(&path).unwrap(), events[..whole], "cut at {cut}");
            // It goes on behind the last whole line.
            let (mut log, found) = Log::open(&path).unwrap();
            assert_eq!(found, events[..whole]);
            log.append(&Event::End).unwrap();
            assert_eq!(read(&path).unwrap().len(), whole + 1);
        }
    }

    #[test]
    fn log_has_one_writer() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log.jsonl");
        let first = Log::open(&path).unwrap();
        let told = Log::open(&path).unwrap_err().to_string();
        assert!(told.contains("another session writes this log"), "{told}");
        assert!(read(&path).unwrap().is_empty(), "others may read it");
        drop(first);
        assert!(Log::open(&path).is_ok());
    }

    #[test]
    fn line_that_is_no_event_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log.jsonl");
        std::fs::write(&path, "{\"event\":\"end\"}\n{\"event\":\"party\"}\n{\"event\":\"end\"}\n").unwrap();
        let told = read(&path).unwrap_err().to_string();
        assert!(told.contains("line 2 is no event"), "{told}");
    }
}
