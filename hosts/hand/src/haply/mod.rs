//! Haply's Inverse3, by the Inverse Service.
//!
//! The service runs on the same machine and speaks JSON in a WebSocket at localhost:10001. This follows the
//! protocol of its version 3.5 as the maker documents it (docs.haply.co, Inverse SDK, "WebSocket Protocol",
//! "Basis Permutation", tutorial 01); 3.1 has the same messages. On connecting, the service sends a report
//! with all devices (`inverse3`, each with `device_id` and `state.cursor_position` in m). Then it answers
//! each message with one report. Our messages carry `commands.set_cursor_force.values` in N; only a message
//! with a force, even 0, is answered. We register no session profile and set no basis, so the axes are the
//! maker's: x right, y forward, z up, origin in the base.
//!
//! The servo is this loop. `rate_hz` times a second it requests the newest report, computes the force by
//! the law in [`servo`](crate::servo), and sends it at once, not with the next request. So a hand in
//! contact costs two exchanges a period, and the delay in the wall's loop is one exchange. The loop never
//! waits for another thread of ours. It is not real-time like a device's own servo: the WebSocket library
//! allocates for each message, and the operating system wakes it. A period missed by more than 50 ms
//! restarts from no force.
//!
//! The protocol does not tell a device's largest force; [`HaplyOptions::max_force_n`] limits it. The force
//! of a sample is the commanded force along the surface's normal. The loss of the service or the device is
//! reported; both are reconnected when they are back, with a new stroke.

mod link;
mod message;

use std::net::SocketAddr;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use asperity_live::{ForceModel, ForceReader, Sample, SampleWriter, now_ns};
use asperity_node::{Descriptor, Param, Params, Registry};

use crate::device::text;
use crate::handle::{Handle, Shared, spawn};
use crate::node::{Arm, ArmForce, ArmInput};
use crate::servo::{Limits, Servo};
use crate::{Device, Frame, HandDevice, HandError, Open};
use link::Link;
use message::Heard;

/// Address of the service.
pub const SERVICE: &str = "localhost:10001";
/// Longest time for each step of the first connection.
const PATIENCE: Duration = Duration::from_secs(2);
/// The same for a reconnection; a source that is dropped meanwhile waits for it.
const BRIEF: Duration = Duration::from_millis(40);
/// Time without a report that is reported.
const STALL: Duration = Duration::from_millis(100);
/// Time without a report after which the connection is made anew.
const LOST: Duration = Duration::from_secs(1);
/// Time between two attempts to reconnect.
const AGAIN: Duration = Duration::from_millis(500);
/// Longest time to release the force at the end; the law takes 20 ms.
const LET_GO: Duration = Duration::from_millis(50);
/// Default requests a second.
pub const USUAL_HZ: u32 = 1000;
/// Delay d of the wall's loop \[s\], from a report to its force: one exchange. Not measured on a device. It
/// is the longest
/// that fits two exchanges into a period at [`USUAL_HZ`]; a slower service lowers the rate itself.
pub const DELAY_S: f64 = 0.5 / USUAL_HZ as f64;
/// Default largest force \[N\]: our choice, for a hand that does not expect it.
pub const USUAL_N: f64 = 3.0;

/// Options of the device.
#[derive(Clone, Debug, PartialEq)]
pub struct HaplyOptions {
    /// Host and port of the service, with or without `ws://` before them.
    pub service: String,
    /// `device_id` of the Inverse3; `None` if there is only one.
    pub device: Option<String>,
    /// The device's axes and origin.
    pub frame: Frame,
    /// Requests a second, 100 to 4000.
    pub rate_hz: u32,
    /// Largest force \[N\].
    pub max_force_n: f64,
}

impl HaplyOptions {
    /// The only device of the service on this machine, at 1 kHz.
    pub fn new() -> Self {
        Self {
            service: SERVICE.to_owned(),
            device: None,
            frame: Frame::default(),
            rate_hz: USUAL_HZ,
            max_force_n: USUAL_N,
        }
    }
}

impl Default for HaplyOptions {
    fn default() -> Self {
        Self::new()
    }
}

/// The kind of devices.
pub struct Haply;

impl Arm for Haply {
    fn input() -> Descriptor {
        Descriptor::new("haply_input", "A stylus on an Inverse3, by the Haply service.").param(Param::text(
            "service",
            "ws://localhost:10001",
            "Address of the Haply service.",
        ))
    }

    fn force() -> (Descriptor, f64) {
        let summary = "Renders a plane on an Inverse3, in the loop that talks to it.";
        (Descriptor::new("haply_force", summary), 3.0)
    }

    const NAME: &str = "Id of the device; empty where there is one.";
    const AXES: &str = "x,y,z";
}

impl HandDevice for Haply {
    fn input(&self) -> &'static str {
        "haply_input"
    }

    fn force(&self) -> Option<&'static str> {
        Some("haply_force")
    }

    fn register(&self, registry: Registry) -> Registry {
        registry.with::<ArmInput<Self>>().with::<ArmForce<Self>>()
    }

    fn configure(&self, params: &Params, max_force_n: f64) -> Result<Open, HandError> {
        let options = HaplyOptions {
            service: params.text("service").to_owned(),
            device: text(params, "device"),
            frame: Frame::new(params.text("axes"), [0.0; 3])?,
            max_force_n,
            ..HaplyOptions::new()
        };
        Ok(Box::new(|writer, models| start(options, writer, models)))
    }

    /// A service may have several devices. One without a name could be any of them.
    fn excludes(&self, params: &Params, open: &Params, _address: Option<SocketAddr>) -> bool {
        let [one, other] = [params, open].map(|params| text(params, "device"));
        same_service(params.text("service"), open.text("service"))
            && (one.is_none() || other.is_none() || one == other)
    }

    fn servo_hz(&self) -> f64 {
        1.0 / (1.0 / f64::from(USUAL_HZ) + 2.0 * DELAY_S)
    }
}

/// Whether two addresses name the same service: with or without `ws://`, and `localhost` for 127.0.0.1 and
/// ::1. No name is looked up.
fn same_service(one: &str, other: &str) -> bool {
    link::place(one) == link::place(other)
}

/// Connects to the service and starts the servo. Without `models` the force is always 0.
///
/// # Errors
/// No service; something else listens there; no device, several without a choice, or not the
/// chosen one; an invalid option.
pub fn start(
    options: HaplyOptions,
    writer: SampleWriter,
    models: Option<ForceReader>,
) -> Result<Handle, HandError> {
    if !(100..=4000).contains(&options.rate_hz) {
        return Err(HandError::option(
            format!("{} questions a second", options.rate_hz),
            "write 100 to 4000",
        ));
    }
    if options.max_force_n.is_nan() || options.max_force_n < 0.0 {
        return Err(HandError::option(format!("at most {} N", options.max_force_n), "write 0 N or more"));
    }
    let shared = Arc::new(Shared::default());
    let (link, id) = open(&options, PATIENCE, || false)?;
    let most = if models.is_some() { options.max_force_n } else { 0.0 };
    shared.set_device(Device { name: id.clone(), max_force_n: most, max_stiffness_n_per_mm: None });
    shared.set_connected(true);
    let servo = Servo::new(Limits::of(most));
    let mut run = Run {
        options,
        id,
        servo,
        models,
        writer,
        shared: shared.clone(),
        stroke: 0,
        sent: [0.0; 3],
        there: true,
    };
    let thread = spawn("haply", move || run.run(link))?;
    Ok(Handle::new(shared, thread, None))
}

/// Connects and chooses the device.
fn open(
    options: &HaplyOptions,
    patience: Duration,
    stopped: impl Fn() -> bool,
) -> Result<(Link, String), HandError> {
    let mut link = Link::connect(&options.service, patience)?;
    let none = |why: &str| {
        HandError::missing(
            format!("the service at {} {why}", options.service),
            "see that it is the Haply Inverse Service, version 3.1 or later",
        )
    };
    let first = link.hear(Instant::now() + PATIENCE, stopped).map_err(|e| none(&e))?;
    let first = first.ok_or_else(|| none("sends no report"))?;
    let ids = message::devices(&first).map_err(|e| none(&format!("sends something else: {e}")))?;
    let list = ids.join("`, `");
    let id = match (&options.device, ids.as_slice()) {
        (_, []) => {
            return Err(HandError::missing(
                "the Haply Inverse Service knows no Inverse3",
                "plug one in, switch it on, and wait until the Haply Hub shows it",
            ));
        }
        (None, [one]) => one.clone(),
        (None, _) => {
            return Err(HandError::option(
                format!("there are several devices: `{list}`"),
                "choose one of them by its `device_id`",
            ));
        }
        (Some(id), all) if all.contains(id) => id.clone(),
        (Some(id), _) => {
            return Err(HandError::missing(
                format!("there is no device `{id}`"),
                format!("there is `{list}`"),
            ));
        }
    };
    Ok((link, id))
}

/// The servo's thread.
struct Run {
    options: HaplyOptions,
    id: String,
    servo: Servo,
    models: Option<ForceReader>,
    writer: SampleWriter,
    shared: Arc<Shared>,
    stroke: u32,
    /// Last commanded force, in the device's axes.
    sent: [f64; 3],
    /// Whether the last report had the device.
    there: bool,
}

impl Run {
    fn run(&mut self, mut link: Link) {
        loop {
            match self.serve(&mut link) {
                Ok(()) => return self.end(link),
                Err(why) => {
                    self.shared.set_connected(false);
                    self.shared.set_force(0.0);
                    self.shared.trouble(format!("the service at {} is lost: {why}", self.options.service));
                }
            }
            // The service must see the old connection end before a new one begins.
            drop(link);
            let Some(again) = self.reopen() else { return };
            link = again;
        }
    }

    /// Requests reports and pushes until the source stops.
    fn serve(&mut self, link: &mut Link) -> Result<(), String> {
        let period = Duration::from_secs(1) / self.options.rate_hz;
        let mut due = Instant::now();
        let mut heard = Instant::now();
        let mut dry = Instant::now();
        while !self.shared.stopped() {
            let now = Instant::now();
            if link.drain(now + period / 2)? {
                dry = now;
            } else if dry.elapsed() > STALL {
                // Reports read now are old.
                return Err("it sends more than can be read".to_owned());
            }
            link.ask(&self.id, self.sent)?;
            if self.answer(link, &mut heard)? {
                self.turn(link, &mut heard)?;
            }
            due += period;
            let now = Instant::now();
            match due.checked_duration_since(now) {
                Some(rest) => thread::sleep(rest),
                // Missed periods are not made up for.
                None => due = now,
            }
        }
        Ok(())
    }

    /// Waits for a report and gives it to the servo. False if stopped.
    fn answer(&mut self, link: &mut Link, heard: &mut Instant) -> Result<bool, String> {
        let shared = self.shared.clone();
        loop {
            let report = link.hear(Instant::now() + STALL, || shared.stopped())?;
            let Some(report) = report else {
                if shared.stopped() {
                    return Ok(false);
                }
                if heard.elapsed() > LOST {
                    return Err(format!("no answer for {} s", LOST.as_secs()));
                }
                shared.trouble(format!("the service at {} does not answer", self.options.service));
                continue;
            };
            *heard = Instant::now();
            self.read(&report);
            return Ok(true);
        }
    }

    fn read(&mut self, report: &str) {
        let now = now_ns();
        let at = match message::position(report, &self.id) {
            Ok(Heard::At(mm)) => Some(self.options.frame.position(mm)),
            Ok(Heard::Gone) => {
                self.gone();
                None
            }
            Err(why) => {
                self.shared.bad(why);
                None
            }
        };
        let model = self.models.as_mut().map_or_else(ForceModel::default, |m| *m.read());
        let force = self.servo.step(now, at.unwrap_or([f64::NAN; 3]), &model);
        self.shared.set_force(force.iter().map(|x| x * x).sum::<f64>().sqrt());
        let Some(position) = at else { return };
        if !self.there {
            self.there = true;
            self.stroke = self.stroke.wrapping_add(1);
            self.shared.set_connected(true);
        }
        self.shared.well(&format!("the Inverse3 `{}` works again", self.id));
        let force = self.servo.normal_force();
        let sample = Sample { time_ns: now, arrived_ns: now, position, force, stroke: self.stroke };
        self.shared.send(&mut self.writer, sample);
    }

    fn gone(&mut self) {
        self.there = false;
        self.shared.set_connected(false);
        self.shared.trouble(format!("the Inverse3 `{}` is no longer there", self.id));
    }

    /// Sends the force of the last report if it changed, and discards the answer.
    fn turn(&mut self, link: &mut Link, heard: &mut Instant) -> Result<(), String> {
        let force = self.options.frame.force(self.servo.force());
        if force != self.sent {
            self.sent = force;
            link.ask(&self.id, force)?;
            let shared = self.shared.clone();
            if link.hear(Instant::now() + STALL, || shared.stopped())?.is_some() {
                *heard = Instant::now();
            }
        }
        Ok(())
    }

    /// Reconnects to the service and the device; `None` if stopped.
    fn reopen(&mut self) -> Option<Link> {
        while !self.shared.stopped() {
            thread::park_timeout(AGAIN);
            let shared = self.shared.clone();
            let again = HaplyOptions { device: Some(self.id.clone()), ..self.options.clone() };
            if let Ok((link, _)) = open(&again, BRIEF, || shared.stopped()) {
                self.servo.restart();
                self.sent = [0.0; 3];
                self.there = false;
                return Some(link);
            }
        }
        None
    }

    /// Releases the force and closes the connection.
    fn end(&mut self, mut link: Link) {
        let period = Duration::from_secs(1) / self.options.rate_hz;
        let end = Instant::now() + LET_GO;
        loop {
            let wanted = self.servo.let_go(now_ns());
            let late = Instant::now() > end;
            let force = if late { [0.0; 3] } else { self.options.frame.force(wanted) };
            // With an unread answer the system would reset the connection and lose the last command.
            let sent = link.ask(&self.id, force).is_ok();
            let answered = sent && link.hear(Instant::now(), || false).is_ok();
            if !answered || force == [0.0; 3] {
                break;
            }
            thread::sleep(period);
        }
        self.shared.set_force(0.0);
        link.close();
    }
}

#[cfg(test)]
mod tests {
    use super::same_service;

    #[test]
    fn service_addresses_compare_in_any_notation() {
        for (one, other, same) in [
            ("localhost:10001", "ws://localhost:10001", true),
            ("localhost:10001", "ws://localhost:10001/ ", true),
            ("localhost:10001", "127.0.0.1:10001", true),
            ("localhost:10001", "[::1]:10001", true),
            ("LocalHost:10001", "ws://127.0.0.1:10001", true),
            ("localhost:10001", "localhost:10002", false),
            ("localhost:10001", "192.168.0.7:10001", false),
            ("ws://192.168.0.7:10001", "192.168.0.7:10001", true),
            ("ws://Desk:10001", "desk:10001", true),
            ("desk:10001", "localhost:10001", false),
        ] {
            assert_eq!([same_service(one, other), same_service(other, one)], [same; 2], "{one} and {other}");
        }
    }
}
