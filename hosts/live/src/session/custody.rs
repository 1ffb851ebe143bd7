//! Keeps the heat of a device's coils from one run to the next.

use std::time::{Duration, Instant};

use asperity_node::Diagnostic;

use crate::outlet::{Guards, Outlet, Seen, Standing};

/// How often the coils' heat is taken down.
const EVERY: Duration = Duration::from_secs(1);

/// A device that was opened, and plays silence.
#[derive(Clone, Debug)]
pub struct Opened {
    /// Names it for a request, the same each time.
    pub id: String,
    /// Its name for a person, with its host.
    pub name: String,
    /// Channels of the device, from 1, with the node of the graph that plays on each.
    pub channels: Vec<(u16, String)>,
    /// The coils of the graph's actuators.
    pub coils: Vec<Option<Standing>>,
}

/// Start values of a run: heat of the coils, its share, guards of the machine.
#[derive(Debug, Default)]
pub struct Terms {
    /// How warm each coil is \[A^2\].
    pub heat: Vec<f64>,
    /// This run's part of every limit, from 0 to 1; none for all of it.
    pub share: Option<f32>,
    /// Guards that hold on their channels whatever graph plays, in the place of the graph's own.
    pub machine: Outlet,
    /// Messages for a person.
    pub notices: Vec<String>,
}

/// Keeps the heat of a device's coils between runs, and says who may drive them. Control thread.
pub trait Keeper: Send + std::fmt::Debug {
    /// A device is open, the first time in this run.
    ///
    /// # Errors
    /// Why it may not be played on.
    fn opened(&mut self, device: &Opened) -> Result<Terms, Diagnostic>;

    /// Takes down how warm each coil is \[A^2\]: once a second, and before the end.
    fn note(&mut self, heat: &[f64]);

    /// The run ends as it should: what was taken down last holds.
    fn ended(&mut self);
}

/// A keeper for as long as a run lasts.
#[derive(Debug)]
pub(super) struct Custody {
    keeper: Option<Box<dyn Keeper>>,
    guards: Guards,
    opened: bool,
    noted: Instant,
}

impl Custody {
    pub(super) fn new(keeper: Option<Box<dyn Keeper>>, guards: Guards) -> Self {
        Self { keeper, guards, opened: false, noted: Instant::now() }
    }

    /// A device is open, and nothing plays on it yet. Answers what a person should know.
    pub(super) fn open(&mut self, device: &Opened) -> Result<Vec<String>, Diagnostic> {
        let Some(keeper) = &mut self.keeper else { return Ok(Vec::new()) };
        let terms = keeper.opened(device)?;
        let refused = || Diagnostic::new("the guards of the channels are in use").in_file(&device.name);
        match self.guards.0.enter().as_deref_mut() {
            Some(Some(gate)) => gate.begin(&terms.heat, terms.share.unwrap_or(1.0), terms.machine),
            _ => return Err(refused()),
        }
        self.opened = true;
        Ok(terms.notices)
    }

    /// A device is back that nothing was played on for so long.
    pub(super) fn back(&mut self, away: Duration) {
        if let Some(Some(gate)) = self.guards.0.enter().as_deref_mut() {
            gate.rest(away.as_secs_f64());
        }
    }

    /// Takes down how the coils stand, where it is time.
    pub(super) fn tend(&mut self, seen: &Seen) {
        if self.noted.elapsed() >= EVERY {
            self.note(seen);
        }
    }

    pub(super) fn note(&mut self, seen: &Seen) {
        self.noted = Instant::now();
        if let (Some(keeper), true) = (&mut self.keeper, self.opened) {
            keeper.note(&seen.heat_of_all());
        }
    }
}

impl Drop for Custody {
    fn drop(&mut self) {
        // A panic is no end as it should be.
        if let (Some(keeper), true, false) = (&mut self.keeper, self.opened, std::thread::panicking()) {
            // Nothing plays any more: a session that is dropped stops its driver before this.
            if let Some(Some(gate)) = self.guards.0.enter().as_deref() {
                keeper.note(&gate.heat());
                keeper.ended();
            }
        }
    }
}
