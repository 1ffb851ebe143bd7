//! Keeps the heat of a device's coils between runs.

use std::sync::Arc;
use std::time::{Duration, Instant};

use asperity_node::Diagnostic;

use crate::output_limits::{LimitsControl, OutputLimits, Seen, SharedLimits, Standing};

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
pub(super) struct Custody {
    monitor: Option<Box<dyn CoilMonitor>>,
    limits: SharedLimits,
    seen: Arc<Seen>,
    noted: Instant,
}

impl Custody {
    pub(super) fn new(limits: &LimitsControl) -> Self {
        let (limits, seen) = (limits.shared.clone(), limits.seen.clone());
        Self { monitor: None, limits, seen, noted: Instant::now() }
    }

    /// The device is open and does not play yet. Returns notices for a person.
    pub(super) fn open(
        &mut self,
        mut monitor: Box<dyn CoilMonitor>,
        mut device: Opened,
    ) -> Result<Vec<String>, Diagnostic> {
        let in_use = || Diagnostic::new("the guards of the channels are in use");
        let mut limits = self.limits.try_lock().ok_or_else(in_use)?;
        device.coils = limits.limits.standing();
        let start = monitor.opened(&device)?;
        limits.begin(&start.heat, start.share.unwrap_or(1.0), start.machine);
        self.monitor = Some(monitor);
        Ok(start.notices)
    }

    /// A device is back after this time without playing.
    pub(super) fn back(&mut self, away: Duration) {
        if let Some(mut limits) = self.limits.try_lock() {
            limits.rest(away.as_secs_f64());
        }
    }

    /// Notes the heat of the coils when it is time.
    pub(super) fn poll(&mut self) {
        if self.noted.elapsed() >= EVERY {
            self.note();
        }
    }

    pub(super) fn note(&mut self) {
        self.noted = Instant::now();
        if let Some(monitor) = &mut self.monitor {
            monitor.note(&self.seen.heat().collect::<Vec<_>>());
        }
    }
}

impl Drop for Custody {
    fn drop(&mut self) {
        // A panic is not an orderly end. Nothing plays any more: a dropped session stops its driver first.
        if !std::thread::panicking() {
            self.note();
            self.monitor.iter_mut().for_each(|monitor| monitor.ended());
        }
    }
}
