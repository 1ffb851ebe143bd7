//! What is known of a device's coils between runs, and who drives them.
//!
//! Each channel of a device has two seats. A run alone takes both; one with `--share` takes one of them, and plays at half
//! of every limit. A seat is a locked file, so that it is free when its process is gone, however that ended. Beside it
//! stands how warm the coil was, written once a second.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use asperity_graph::Schedule;
use asperity_live::{Keeper, Opened, Standing, Terms};
use asperity_source::{Diagnostic, fnv};
use parking_lot::Mutex;

use super::Machine;

/// Names the folder where all this is kept; empty for nowhere. Simulated cards, which have no coil, keep theirs only where it is
/// set.
const FOLDER: &str = "ASPERITY_STATE";
/// Two processes share a channel at most.
const SEATS: usize = 2;

/// The keeper of a run.
#[derive(Debug)]
pub struct Coils {
    share: bool,
    machine: Option<Arc<Machine>>,
    schedule: Arc<Schedule>,
    seats: Vec<Vec<Seat>>,
    /// Where the device that plays is told to whoever checks other graphs for it.
    device: Arc<Mutex<Option<Opened>>>,
    /// It has been said that nothing can be written.
    told: bool,
}

/// The machine's file, and the device that plays.
#[derive(Clone, Debug)]
pub struct Ceiling {
    machine: Arc<Machine>,
    device: Arc<Mutex<Option<Opened>>>,
}

impl Ceiling {
    /// Refuses a graph that is to take the place of the one that runs, and says something else of what is behind the device.
    /// `playing` are its nodes by channel.
    pub fn check(&self, playing: &[String], schedule: &Schedule) -> Result<(), Diagnostic> {
        let device = self.device.lock();
        let Some(device) = &*device else { return Ok(()) };
        let channels = device.channels.iter().map(|(channel, _)| *channel);
        let playing: Vec<_> = channels.zip(playing.iter().cloned()).collect();
        self.machine.check(device, &playing, schedule)
    }
}

/// One of the seats of a channel, taken: a locked file, which holds what is known of the coil.
#[derive(Debug)]
struct Seat {
    file: File,
    last: Option<Record>,
}

/// What a seat's file says.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Record {
    /// Mean of the square of the current \[A^2\].
    heat: f64,
    /// Time constant with which it cools \[s\].
    cools_in: f64,
    /// Seconds since 1970.
    at: f64,
    /// Whether a run was under way.
    running: bool,
}

impl Coils {
    /// For a run of this graph.
    pub fn new(share: bool, machine: Option<Arc<Machine>>, schedule: Arc<Schedule>) -> Self {
        Self { share, machine, schedule, seats: Vec::new(), device: Arc::default(), told: false }
    }

    /// What refuses graphs that say something else of the device than the machine's file.
    pub fn ceiling(&self) -> Option<Ceiling> {
        Some(Ceiling { machine: self.machine.clone()?, device: self.device.clone() })
    }

    /// Takes seats on a channel. Answers them, and how warm the coil is at most; none where it must count as being at its
    /// rating.
    fn sit(
        &self,
        folder: &Path,
        device: &Opened,
        channel: u16,
    ) -> Result<(Vec<Seat>, Option<f64>), Diagnostic> {
        let mut taken = Vec::new();
        let mut heat = Some(0.0f64);
        let mut by = None;
        for seat in 0..SEATS {
            let path = folder.join(format!("{}.{}", file_name(device, channel), seat + 1));
            let mut file = open(&path)?;
            let free = match file.try_lock() {
                Ok(()) => true,
                Err(TryLockError::WouldBlock) => false,
                Err(TryLockError::Error(e)) => return Err(unusable(&path, &e)),
            };
            let mut text = String::new();
            let _ = file.read_to_string(&mut text);
            // Of a run that goes on, how warm it says that the coil is; of one that is over, how warm it is now.
            let warm =
                Record::parse(&text).map_or((!text.is_empty()).then_some(None), |r| Some(r.now(!free)));
            heat = match warm.unwrap_or(Some(0.0)) {
                Some(warm) => heat.map(|heat| heat.max(warm)),
                None => None,
            };
            if !free {
                by = by.or_else(|| text.lines().find_map(|l| l.strip_prefix("process: ")).map(str::to_owned));
            } else if !self.share || taken.is_empty() {
                taken.push(Seat { file, last: None });
            }
        }
        let wanted = if self.share { 1 } else { SEATS };
        if taken.len() < wanted {
            let process = by.map_or("another process".to_owned(), |id| format!("process {id}"));
            let help = if self.share {
                "end it: it does not share, or two that share are there already"
            } else {
                "end it; or start both with --share: each has half of every limit"
            };
            return Err(Diagnostic::new(format!(
                "channel {channel} of `{}` is driven by {process}",
                device.name
            ))
            .in_file("--channel")
            .help(help));
        }
        Ok((taken, heat))
    }

    fn note_all(&mut self, record: impl Fn(usize, Option<Record>) -> Option<Record>) {
        for (channel, seats) in self.seats.iter_mut().enumerate() {
            for seat in seats {
                if let Some(record) = record(channel, seat.last)
                    && let Err(e) = seat.write(record)
                    && !std::mem::replace(&mut self.told, true)
                {
                    crate::failure::warn(&format!("how warm the coils are cannot be kept: {e}"));
                }
            }
        }
    }
}

impl Keeper for Coils {
    fn opened(&mut self, device: &Opened) -> Result<Terms, Diagnostic> {
        let mut terms = Terms { share: self.share.then_some(1.0 / SEATS as f32), ..Terms::default() };
        if let Some(machine) = &self.machine {
            machine.check(device, &device.channels, &self.schedule)?;
            terms.machine = machine.guards(device, self.schedule.audio_hz)?;
        }
        *self.device.lock() = Some(device.clone());
        let simulated = device.id.starts_with("simulated");
        terms.notices.extend(self.unprotected(device).filter(|_| !simulated));
        let Some(folder) = folder(simulated) else { return Ok(terms) };
        if let Err(e) = std::fs::create_dir_all(&folder) {
            let why = format!(
                "how warm the coils are is not known, nor who drives them: {}: {e}",
                folder.display()
            );
            terms.notices.push(format!("warning: {why}"));
            return Ok(terms);
        }
        for (i, (channel, _)) in device.channels.iter().enumerate() {
            let (seats, heat) = self.sit(&folder, device, *channel)?;
            let rating = self.rating(device, i);
            if heat.is_none() {
                terms.notices.push(format!(
                    "the coil on channel {channel} counts as being at its rating: the last run did not end as it should, or the clock went back"
                ));
            }
            terms.heat.push(heat.unwrap_or(rating));
            self.seats.push(seats);
        }
        let begun = |i: usize, coil: &Option<Standing>| coil.map(|c| Standing { heat: terms.heat[i], ..c });
        let coils: Vec<_> = device.coils.iter().enumerate().map(|(i, c)| begun(i, c)).collect();
        self.note(&coils);
        Ok(terms)
    }

    fn note(&mut self, coils: &[Option<Standing>]) {
        let at = now();
        let record = |channel: usize, _| {
            let standing = coils.get(channel).copied().flatten()?;
            Some(Record { heat: standing.heat, cools_in: standing.cools_in, at, running: true })
        };
        self.note_all(record);
    }

    fn ended(&mut self) {
        let last = |_, last: Option<Record>| last.map(|last| Record { running: false, ..last });
        self.note_all(last);
        self.seats.clear();
    }
}

impl Coils {
    /// The square of the current that a channel's coil bears for ever.
    fn rating(&self, device: &Opened, i: usize) -> f64 {
        let output = self.machine.as_ref().and_then(|m| m.output(device, device.channels[i].0));
        let graph = device.coils.get(i).copied().flatten().map(|c| c.rating);
        output.map(|o| o.actuator.rated_current.powi(2)).or(graph).unwrap_or(0.0)
    }

    /// Says that only the graph's word protects an actuator, where that is so.
    fn unprotected(&self, device: &Opened) -> Option<String> {
        let unknown = |m: &Machine| {
            let mut unknown =
                device.channels.iter().filter(|(channel, _)| m.output(device, *channel).is_none());
            unknown.next().map(|(channel, _)| *channel)
        };
        let channel = match &self.machine {
            Some(machine) => unknown(machine)?,
            None => device.channels.first()?.0,
        };
        Some(format!(
            "only the graph's word protects the actuator on channel {channel} of `{}`: `asperity setup` writes down what stands there",
            device.name
        ))
    }
}

impl Seat {
    /// Writes a record over the one before, in place: the lock is on the file itself. All records are of the same length, so that
    /// one which is cut short is seen.
    fn write(&mut self, record: Record) -> std::io::Result<()> {
        self.last = Some(record);
        let text = record.text();
        self.file.rewind()?;
        self.file.write_all(text.as_bytes())?;
        self.file.set_len(text.len() as u64)
    }
}

impl Record {
    fn text(&self) -> String {
        format!(
            "heat_a2: {:.12e}\ncools_in_s: {:.12e}\nat_s: {:.6}\nrunning: {:5}\nprocess: {}\n",
            self.heat,
            self.cools_in,
            self.at,
            self.running,
            std::process::id()
        )
    }

    fn parse(text: &str) -> Option<Self> {
        let field = |name: &str| text.lines().find_map(|l| l.strip_prefix(name)?.strip_prefix(": "));
        let number = |name| field(name)?.trim().parse::<f64>().ok().filter(|x| x.is_finite() && *x >= 0.0);
        let running = match field("running")?.trim() {
            "true" => true,
            "false" => false,
            _ => return None,
        };
        field("process")?;
        Some(Self { heat: number("heat_a2")?, cools_in: number("cools_in_s")?, at: number("at_s")?, running })
    }

    /// How warm the coil is now; none where that is not known: a run did not end as it should, or the clock went back.
    fn now(&self, goes_on: bool) -> Option<f64> {
        let since = now() - self.at;
        if goes_on {
            return Some(self.heat);
        }
        (!self.running && since >= 0.0).then(|| self.heat * (-since / self.cools_in.max(1e-3)).exp())
    }
}

fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64())
}

/// Where it is kept; none for nowhere.
fn folder(simulated: bool) -> Option<PathBuf> {
    match std::env::var_os(FOLDER) {
        Some(folder) if folder.is_empty() => None,
        Some(folder) => Some(folder.into()),
        None if simulated => None,
        None => Some(dirs::state_dir().or_else(dirs::data_local_dir)?.join("asperity").join("coils")),
    }
}

/// A channel as the name of a file. Two JACK servers on one machine may each have a device of the same name.
fn file_name(device: &Opened, channel: u16) -> String {
    let server = if device.id.starts_with("jack") { std::env::var("JACK_DEFAULT_SERVER").ok() } else { None };
    let whole = format!("{} {}", device.id, server.unwrap_or_default());
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let readable: String = device.id.chars().map(plain).take(60).collect();
    format!("{readable}.{:016x}.{channel}", fnv(whole.as_bytes()))
}

fn open(path: &Path) -> Result<File, Diagnostic> {
    let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
    file.map_err(|e| unusable(path, &e))
}

fn unusable(path: &Path, error: &std::io::Error) -> Diagnostic {
    Diagnostic::new(format!("cannot tell who drives the actuator: {error}"))
        .in_file(path)
        .help(format!("{FOLDER} names another folder; empty, nothing is kept"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(at: f64, running: bool) -> Record {
        Record { heat: 0.02, cools_in: 2.0, at, running }
    }

    #[test]
    fn coil_cools_by_its_profile_between_runs() {
        let heat = record(now() - 2.0, false).now(false).expect("it is known");
        assert!((heat / (0.02 * (-1.0f64).exp()) - 1.0).abs() < 1e-3, "{heat}");
    }

    #[test]
    fn coil_of_a_killed_run_or_a_clock_gone_back_is_unknown() {
        assert_eq!(record(now() - 100.0, true).now(false), None);
        assert_eq!(record(now() + 100.0, false).now(false), None);
        // A run that shares the channel says how warm it is.
        assert_eq!(record(now(), true).now(true), Some(0.02));
    }

    #[test]
    fn record_comes_back_and_a_cut_one_does_not() {
        let text = record(1.0e9, false).text();
        assert_eq!(Record::parse(&text), Some(record(1.0e9, false)));
        for cut in ["", "heat", &text[..text.len() / 2], &text.replace("0", "x")] {
            assert_eq!(Record::parse(cut), None, "{cut}");
        }
    }
}
