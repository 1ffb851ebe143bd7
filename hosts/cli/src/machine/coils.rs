//! Heat of a device's coils between runs, and locks on its channels.
//!
//! Each channel of a device has two seats. A run alone takes both; a run with `--share` takes one and plays
//! at half of every limit. A seat is a locked file: it is free when its process ends, however that ends.
//! The file holds the heat of the coil, written once a second.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use asperity_diagnostics::{Diagnostic, fnv};
use asperity_graph::Schedule;
use asperity_live::{CoilMonitor, Opened, StartValues};
use parking_lot::Mutex;
use serde::{Deserialize, Serialize};

use super::Machine;

/// Names the folder of the seats; empty for none. Simulated cards, which have no coil, need it for seats.
const FOLDER: &str = "ASPERITY_STATE";
/// At most two processes share a channel.
const SEATS: usize = 2;
/// Length of a record without its line break. The longest numbers fit.
const RECORD_LEN: usize = 255;

/// Guards the coils of a run.
#[derive(Debug)]
pub struct Coils {
    share: bool,
    machine: Option<Arc<Machine>>,
    schedule: Arc<Schedule>,
    channels: Vec<Channel>,
    /// The device that plays, for the [`Ceiling`].
    device: Arc<Mutex<Option<Opened>>>,
    /// Whether the warning that heat cannot be written was said.
    told: bool,
}

/// Checks graphs against the machine's file while a device plays.
#[derive(Clone, Debug)]
pub struct Ceiling {
    machine: Arc<Machine>,
    device: Arc<Mutex<Option<Opened>>>,
}

impl Ceiling {
    /// Refuses a new graph that contradicts the machine's file. `playing` are its nodes by channel.
    pub fn check(&self, playing: &[String], schedule: &Schedule) -> Result<(), Diagnostic> {
        let device = self.device.lock();
        let Some(device) = &*device else { return Ok(()) };
        let channels = device.channels.iter().map(|(channel, _)| *channel);
        let playing: Vec<_> = channels.zip(playing.iter().cloned()).collect();
        self.machine.check(device, &playing, schedule)
    }
}

/// A channel of the device that plays: the seats that this process holds, and their content.
#[derive(Debug)]
struct Channel {
    seats: Vec<File>,
    record: Record,
}

/// Content of a seat's file, as a line of JSON, filled up with spaces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Record {
    /// Mean of the square of the current.
    heat_a2: f64,
    /// Mean square of the current that the coil bears continuously.
    rating_a2: f64,
    /// Time constant with which it cools.
    cools_in_s: f64,
    #[serde(flatten)]
    clock: Clock,
    /// Whether a run is under way.
    running: bool,
    process: u32,
}

/// A time by the wall clock, and since the machine was started.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Clock {
    /// Seconds since 1970.
    at_s: f64,
    /// Identifies the start of the machine; 0 if not known.
    boot: u64,
    /// Seconds since then.
    up_s: f64,
}

/// Heat of a coil.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Warm {
    heat_a2: f64,
    /// Else the coil may be hotter: it counts as at least at its rating.
    known: bool,
}

impl Coils {
    pub fn new(share: bool, machine: Option<Arc<Machine>>, schedule: Arc<Schedule>) -> Self {
        Self { share, machine, schedule, channels: Vec::new(), device: Arc::default(), told: false }
    }

    pub fn ceiling(&self) -> Option<Ceiling> {
        Some(Ceiling { machine: self.machine.clone()?, device: self.device.clone() })
    }

    /// Takes seats on a channel. Answers them, and the heat of the coil.
    fn sit(&self, folder: &Path, device: &Opened, i: usize) -> Result<(Vec<File>, Warm), Diagnostic> {
        let channel = device.channels[i].0;
        let (rating_a2, cools_in_s) = self.actuator(device, i);
        let (mut taken, mut by) = (Vec::new(), None);
        let mut warm = Warm { heat_a2: 0.0, known: true };
        for seat in 1..=SEATS {
            let path = folder.join(format!("{}.{seat}", file_name(device, channel)));
            let (mut file, new) = open(&path).map_err(|e| unusable(&path, &e))?;
            let free = match file.try_lock() {
                Ok(()) => true,
                Err(TryLockError::WouldBlock) => false,
                Err(TryLockError::Error(e)) => return Err(unusable(&path, &e)),
            };
            let record = Record::read(&mut file);
            let stands = match record {
                _ if new => Warm { heat_a2: 0.0, known: true },
                // A run under way keeps its record up to date.
                Some(record) if !free => Warm { heat_a2: record.heat_a2, known: true },
                Some(record) => record.now(&Clock::now()),
                None => Warm { heat_a2: 0.0, known: false },
            };
            warm = warm.or(stands);
            if !free {
                by = by.or(record.map(|record| record.process));
            } else if !self.share || taken.is_empty() {
                taken.push(file);
            } else if !stands.known {
                // The other seat is free: from now on the heat is known, and falls.
                let _ = Record::new(stands.heat_a2.max(rating_a2), rating_a2, cools_in_s).write(&mut file);
            }
        }
        if taken.len() < if self.share { 1 } else { SEATS } {
            let process = by.map_or("another process".to_owned(), |id| format!("process {id}"));
            let help = match self.share {
                true => "end it: it does not share the actuator, or two runs share it already",
                false => "end it; or start both with --share: each has half of every limit",
            };
            let message = format!("channel {channel} of `{}` is driven by {process}", device.name);
            return Err(Diagnostic::new(message).in_file("--channel").help(help));
        }
        Ok((taken, warm))
    }

    fn write(&mut self) {
        for Channel { seats, record } in &mut self.channels {
            for seat in seats {
                if let Err(e) = record.write(seat)
                    && !std::mem::replace(&mut self.told, true)
                {
                    crate::failure::warn(&format!("cannot write the heat of the coils: {e}"));
                }
            }
        }
    }

    /// Rating of a channel's coil \[A^2\], and the time constant with which it cools \[s\].
    fn actuator(&self, device: &Opened, i: usize) -> (f64, f64) {
        let machine = self.machine.as_ref().and_then(|m| m.output(device, device.channels[i].0));
        let machine = machine.map(|o| (o.actuator.rated_current.powi(2), o.actuator.thermal_time_constant));
        let of_graph = || device.coils.get(i).copied().flatten().map(|c| (c.rating, c.cools_in));
        machine.or_else(of_graph).unwrap_or((0.0, 1.0))
    }

    /// Warns of a channel that the machine's file does not protect.
    fn unprotected(&self, device: &Opened) -> Option<String> {
        let known = |channel| self.machine.as_ref().is_some_and(|m| m.output(device, channel).is_some());
        let channel = device.channels.iter().map(|(channel, _)| *channel).find(|channel| !known(*channel))?;
        Some(format!(
            "only the graph's own settings protect the actuator on channel {channel} of `{}`: \
             `asperity setup` adds limits that no graph can raise",
            device.name
        ))
    }
}

impl CoilMonitor for Coils {
    fn opened(&mut self, device: &Opened) -> Result<StartValues, Diagnostic> {
        let mut start =
            StartValues { share: self.share.then_some(1.0 / SEATS as f32), ..StartValues::default() };
        if let Some(machine) = &self.machine {
            machine.check(device, &device.channels, &self.schedule)?;
            start.machine = machine.limits(device, self.schedule.audio_hz)?;
        }
        *self.device.lock() = Some(device.clone());
        let simulated = device.id.starts_with("simulated");
        start.notices.extend(self.unprotected(device).filter(|_| !simulated));
        let Some(folder) = folder(simulated) else {
            if !simulated && std::env::var_os(FOLDER).is_none() {
                let notice = "this system has no state folder: the coils count as being at their rating";
                start.notices.push(notice.into());
                start.heat = (0..device.channels.len()).map(|i| self.actuator(device, i).0).collect();
            }
            return Ok(start);
        };
        std::fs::create_dir_all(&folder).map_err(|e| unusable(&folder, &e))?;
        for (i, (channel, _)) in device.channels.iter().enumerate() {
            let (seats, warm) = self.sit(&folder, device, i)?;
            let (rating_a2, cools_in_s) = self.actuator(device, i);
            let heat_a2 = if warm.known { warm.heat_a2 } else { warm.heat_a2.max(rating_a2) };
            self.channels.push(Channel { seats, record: Record::new(heat_a2, rating_a2, cools_in_s) });
            start.heat.push(heat_a2);
            if !warm.known {
                start.notices.push(format!(
                    "the coil on channel {channel} counts as being at its rating: \
                     the last run was killed, or the clock went back"
                ));
            }
        }
        self.note(&start.heat);
        for seat in self.channels.iter().flat_map(|channel| &channel.seats) {
            // The record of a run under way must survive a crash of the machine.
            let _ = seat.sync_all();
        }
        Ok(start)
    }

    fn note(&mut self, heat: &[f64]) {
        let clock = Clock::now();
        for (Channel { record, .. }, &heat_a2) in self.channels.iter_mut().zip(heat) {
            *record = Record { heat_a2, clock, running: true, ..*record };
        }
        self.write();
    }

    fn ended(&mut self) {
        self.channels.iter_mut().for_each(|channel| channel.record.running = false);
        self.write();
        self.channels.clear();
    }
}

impl Record {
    fn new(heat_a2: f64, rating_a2: f64, cools_in_s: f64) -> Self {
        let (clock, process) = (Clock::now(), std::process::id());
        Self { heat_a2, rating_a2, cools_in_s, clock, running: false, process }
    }

    /// `None` for a damaged file.
    fn read(file: &mut File) -> Option<Self> {
        let mut text = String::new();
        file.read_to_string(&mut text).ok()?;
        serde_json::from_str(text.trim_end()).ok().filter(|record: &Self| record.heat_a2 >= 0.0)
    }

    /// Overwrites the record in place: the lock is on the file itself. All records have the same length, and
    /// are written in one call, so that whoever reads meanwhile finds nothing of the former one behind it.
    fn write(&self, file: &mut File) -> std::io::Result<()> {
        let text = format!("{:<RECORD_LEN$}\n", serde_json::to_string(self)?);
        file.rewind()?;
        file.write_all(text.as_bytes())?;
        file.set_len(text.len() as u64)
    }

    /// Heat of the coil now. It is not known if a run was killed or the clock went back.
    fn now(&self, now: &Clock) -> Warm {
        match now.since(&self.clock) {
            Some(since) if !self.running => {
                Warm { heat_a2: self.heat_a2 * (-since / self.cools_in_s.max(1e-3)).exp(), known: true }
            }
            _ => Warm { heat_a2: self.heat_a2.max(self.rating_a2), known: false },
        }
    }
}

impl Warm {
    /// Joins the heat of two records of one coil: the larger one holds.
    fn or(self, other: Self) -> Self {
        Self { heat_a2: self.heat_a2.max(other.heat_a2), known: self.known && other.known }
    }
}

impl Clock {
    fn now() -> Self {
        let at_s = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64());
        let read = |path| std::fs::read_to_string(path).ok();
        let up = read("/proc/uptime").and_then(|t| t.split_whitespace().next()?.parse().ok());
        let boot = read("/proc/sys/kernel/random/boot_id").map_or(0, |id| fnv(id.trim().as_bytes()));
        Self { at_s, boot: if up.is_some() { boot } else { 0 }, up_s: up.unwrap_or(0.0) }
    }

    /// Seconds since `before`; `None` if the clock went back. A clock that was set ahead cools no coil.
    fn since(&self, before: &Self) -> Option<f64> {
        let wall = self.at_s - before.at_s;
        let up = (self.boot == before.boot && self.boot != 0).then_some(self.up_s - before.up_s);
        (wall >= 0.0).then(|| up.map_or(wall, |up| wall.min(up.max(0.0))))
    }
}

/// Folder of the seats; `None` for none.
fn folder(simulated: bool) -> Option<PathBuf> {
    match std::env::var_os(FOLDER) {
        Some(folder) if folder.is_empty() => None,
        Some(folder) => Some(folder.into()),
        None if simulated => None,
        None => Some(dirs::state_dir().or_else(dirs::data_local_dir)?.join("asperity").join("coils")),
    }
}

/// File name of a channel. Two JACK servers on one machine may have devices of the same name.
fn file_name(device: &Opened, channel: u16) -> String {
    let server = if device.id.starts_with("jack") { std::env::var("JACK_DEFAULT_SERVER").ok() } else { None };
    let whole = format!("{} {}", device.id, server.unwrap_or_default());
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let readable: String = device.id.chars().map(plain).take(60).collect();
    format!("{readable}.{:016x}.{channel}", fnv(whole.as_bytes()))
}

/// A seat's file, and whether it is new.
fn open(path: &Path) -> std::io::Result<(File, bool)> {
    let mut options = OpenOptions::new();
    match options.read(true).write(true).create_new(true).open(path) {
        Err(e) if e.kind() == ErrorKind::AlreadyExists => Ok((options.create_new(false).open(path)?, false)),
        new => Ok((new?, true)),
    }
}

fn unusable(path: &Path, error: &std::io::Error) -> Diagnostic {
    Diagnostic::new(format!("cannot tell who drives the actuator: {error}"))
        .in_file(path)
        .help(format!("{FOLDER} names another folder; if it is empty, nothing is kept"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(ago: f64, running: bool) -> Record {
        let now = Clock::now();
        let clock = Clock { at_s: now.at_s - ago, up_s: now.up_s - ago, ..now };
        Record { clock, running, ..Record::new(0.02, 0.03, 2.0) }
    }

    #[test]
    fn coil_cools_by_its_profile_between_runs() {
        let Warm { heat_a2, known } = record(2.0, false).now(&Clock::now());
        assert!(known && (heat_a2 / (0.02 * (-1.0f64).exp()) - 1.0).abs() < 1e-2, "{heat_a2}");
    }

    #[test]
    fn coil_of_a_killed_run_or_a_clock_gone_back_is_at_its_rating() {
        let unknown = Warm { heat_a2: 0.03, known: false };
        assert_eq!(record(100.0, true).now(&Clock::now()), unknown);
        assert_eq!(record(-100.0, false).now(&Clock::now()), unknown);
    }

    #[test]
    fn clock_set_ahead_cools_no_coil() {
        let now = Clock { at_s: 2e9, boot: 7, up_s: 101.0 };
        let before = Clock { at_s: 1e9, boot: 7, up_s: 100.0 };
        assert_eq!(now.since(&before), Some(1.0));
        // The machine was restarted: only the wall clock counts.
        assert_eq!(now.since(&Clock { boot: 8, ..before }), Some(1e9));
    }

    #[test]
    fn one_unknown_record_makes_the_coil_unknown() {
        let warm = |heat_a2, known| Warm { heat_a2, known };
        assert_eq!(warm(1.0, true).or(warm(2.0, true)), warm(2.0, true));
        assert_eq!(warm(3.0, true).or(warm(2.0, false)), warm(3.0, false));
    }

    #[test]
    fn longest_record_fits() {
        let (x, most) = (-f64::MIN_POSITIVE, u64::MAX);
        let clock = Clock { at_s: x, boot: most, up_s: x };
        let record = Record { clock, process: u32::MAX, ..Record::new(x, x, x) };
        assert!(serde_json::to_string(&record).unwrap().len() <= RECORD_LEN);
    }

    #[test]
    fn record_comes_back_and_a_cut_one_does_not() {
        let mut file = tempfile::tempfile().unwrap();
        record(9.0, true).write(&mut file).unwrap();
        let record = Record { heat_a2: 0.125, ..record(5.5, false) };
        record.write(&mut file).unwrap();
        let mut read = || {
            file.rewind().unwrap();
            Record::read(&mut file)
        };
        assert_eq!(read().map(|read| (read.heat_a2, read.running)), Some((0.125, false)));
        assert_eq!(file.metadata().unwrap().len(), RECORD_LEN as u64 + 1);
        let len = serde_json::to_string(&record).unwrap().len() as u64;
        for cut in [0, 1, len / 2, len - 1] {
            file.set_len(cut).unwrap();
            file.rewind().unwrap();
            assert_eq!(Record::read(&mut file), None, "{cut}");
        }
    }
}
