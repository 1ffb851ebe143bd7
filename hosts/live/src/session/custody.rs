//! Keeps the heat of a device's coils between runs.

use std::time::{Duration, Instant};

use asperity_node::Diagnostic;

use crate::output_limits::{OutputLimits, Seen, SharedLimits, Standing};

/// Time between two notes of the coils' heat.
const EVERY: Duration = Duration::from_secs(1);

/// An open device that plays silence.
#[derive(Clone, Debug)]
pub struct Opened {
    /// Stable id for a request.
    pub id: String,
    /// Its name for a person, with its host.
    pub name: String,
    /// Channels of the device, from 1, with the node of the graph that plays on each.
    pub channels: Vec<(u16, String)>,
    /// The coils of the graph's actuators.
    pub coils: Vec<Option<Standing>>,
}

/// Start values of a run: heat of the coils, its share, limits of the machine.
#[derive(Debug, Default)]
pub struct StartValues {
    /// Heat of each coil \[A^2\].
    pub heat: Vec<f64>,
    /// This run's share of every limit, 0 to 1; `None` for all of it.
    pub share: Option<f32>,
    /// Limits that replace the graph's own on their channels, for any graph.
    pub machine: OutputLimits,
    /// Messages for a person.
    pub notices: Vec<String>,
}

/// Keeps the heat of coils between runs, and decides who may drive them. Control thread.
pub trait CoilMonitor: Send + std::fmt::Debug {
    /// The device is open for the first time in this run.
    ///
    /// # Errors
    /// Why playing on it is not allowed.
    fn opened(&mut self, device: &Opened) -> Result<StartValues, Diagnostic>;

    /// Notes the heat of each coil \[A^2\]: once a second, and before the end.
    fn note(&mut self, heat: &[f64]);

    /// The run ends in order: the last note is valid.
    fn ended(&mut self);
}

/// The coil monitor during a run.
#[derive(Debug)]
pub(super) struct Custody {
    coil_monitor: Option<Box<dyn CoilMonitor>>,
    limits: SharedLimits,
    opened: bool,
    noted: Instant,
}

impl Custody {
    pub(super) fn new(coil_monitor: Option<Box<dyn CoilMonitor>>, limits: SharedLimits) -> Self {
        Self { coil_monitor, limits, opened: false, noted: Instant::now() }
    }

    /// The device is open and does not play yet. Returns notices for a person.
    pub(super) fn open(&mut self, device: &Opened) -> Result<Vec<String>, Diagnostic> {
        let Some(coil_monitor) = &mut self.coil_monitor else { return Ok(Vec::new()) };
        let start = coil_monitor.opened(device)?;
        let refused = || Diagnostic::new("the guards of the channels are in use").in_file(&device.name);
        match self.limits.0.enter().as_deref_mut() {
            Some(Some(limits)) => limits.begin(&start.heat, start.share.unwrap_or(1.0), start.machine),
            _ => return Err(refused()),
        }
        self.opened = true;
        Ok(start.notices)
    }

    /// A device is back after this time without playing.
    pub(super) fn back(&mut self, away: Duration) {
        if let Some(Some(limits)) = self.limits.0.enter().as_deref_mut() {
            limits.rest(away.as_secs_f64());
        }
    }

    /// Notes the heat of the coils when it is time.
    pub(super) fn poll(&mut self, seen: &Seen) {
        if self.noted.elapsed() >= EVERY {
            self.note(seen);
        }
    }

    pub(super) fn note(&mut self, seen: &Seen) {
        self.noted = Instant::now();
        if let (Some(coil_monitor), true) = (&mut self.coil_monitor, self.opened) {
            coil_monitor.note(&seen.heat_of_all());
        }
    }
}

impl Drop for Custody {
    fn drop(&mut self) {
        // A panic is not an orderly end.
        if let (Some(coil_monitor), true, false) =
            (&mut self.coil_monitor, self.opened, std::thread::panicking())
        {
            // Nothing plays any more: a dropped session stops its driver first.
            if let Some(Some(limits)) = self.limits.0.enter().as_deref() {
                coil_monitor.note(&limits.heat());
                coil_monitor.ended();
            }
        }
    }
}
