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
//! The servo is this loop. [`USUAL_HZ`] times a second it requests the newest report, computes the force by
//! the law in [`servo`](crate::servo), and sends it at once, not with the next request. So a hand in
//! contact costs two exchanges a period, and the delay in the wall's loop is one exchange. The loop never
//! waits for another thread of ours. It is not real-time like a device's own servo: the WebSocket library
//! allocates for each message, and the operating system wakes it. A period missed by more than 50 ms
//! restarts from no force.
//!
//! The protocol does not tell a device's largest force; `max_force_n` limits it. The force
//! of a sample is the commanded force along the surface's normal. The loss of the service or the device is
//! reported; both are reconnected when they are back, with a new stroke.

mod link;

use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use asperity_live::{ForceReader, SampleWriter, now_ns};
use asperity_node::{Diagnostic, Params};

use crate::arm::{AGAIN, Arm, ArmLoop, LET_GO, text};
use crate::handle::Shared;
use crate::{ArmOptions, Handle, error};
use link::Link;

const SERVICE: &str = "localhost:10001";
/// Longest time for each step of the first connection.
const PATIENCE: Duration = Duration::from_secs(2);
/// The same for a reconnection; a source that is dropped meanwhile waits for it.
const BRIEF: Duration = Duration::from_millis(40);
/// Time without a report that is reported.
const STALL: Duration = Duration::from_millis(100);
/// Time without a report after which the connection is made anew.
const LOST: Duration = Duration::from_secs(1);
/// Requests a second.
pub const USUAL_HZ: u32 = 1000;
/// Time between two requests.
const PERIOD: Duration = Duration::from_micros(1_000_000 / USUAL_HZ as u64);
/// Delay d of the wall's loop \[s\], from a report to its force: one exchange. Not measured on a device. It
/// is the longest that fits two exchanges into a period; a slower service lowers the rate itself.
const DELAY_S: f64 = 0.5 / USUAL_HZ as f64;

/// The kind of devices.
pub(crate) const ARM: Arm = Arm {
    input: ["haply_input", "Reads the stylus of an Inverse3 through the Haply service."],
    force: ["haply_force", "Renders a plane on an Inverse3, in its own servo loop."],
    // Our choice, for a hand that does not expect it.
    max_force_n: 3.0,
    device: "Id of the device; may be empty if there is only one.",
    by: ["service", "ws://localhost:10001", "Address of the Haply service."],
    axes: "x,y,z",
    start,
    excludes,
    servo: [USUAL_HZ as f64, DELAY_S],
};

/// A service may have several devices. One without a name could be any of them.
fn excludes(params: &Params, open: &Params) -> bool {
    let [one, other] = [params, open].map(|params| text(params, "device"));
    same_service(params.text("service"), open.text("service"))
        && (one.is_none() || other.is_none() || one == other)
}

/// Whether two addresses name the same service: with or without `ws://`, and `localhost` for 127.0.0.1 and
/// ::1. No name is looked up.
fn same_service(one: &str, other: &str) -> bool {
    link::place(one) == link::place(other)
}

/// Connects to the service and starts the servo. Without `models` the force is always 0. Error: no service;
/// something else listens there; no device, several without a choice, or not the chosen one.
pub fn start(
    options: ArmOptions,
    writer: SampleWriter,
    models: Option<ForceReader>,
) -> Result<Handle, Diagnostic> {
    let shared = Arc::new(Shared::default());
    let service = options.by.unwrap_or_else(|| SERVICE.to_owned());
    let (link, id) = open(&service, options.device.as_deref(), PATIENCE, || false)?;
    let mut arm = ArmLoop::new(options.axes, writer, models, shared.clone());
    arm.begin(options.max_force_n);
    let now = Instant::now();
    let mut run = Run { service, id, arm, shared: shared.clone(), sent: [0.0; 3], there: true, heard: now };
    Handle::start("haply", shared, None, move || run.run(link))
}

fn open(
    service: &str,
    device: Option<&str>,
    patience: Duration,
    stopped: impl Fn() -> bool,
) -> Result<(Link, String), Diagnostic> {
    let mut link = Link::connect(service, patience)?;
    let none = |why: &str| {
        let help = "see that it is the Haply Inverse Service, version 3.1 or later";
        error(format!("the service at {service} {why}"), help)
    };
    let first = link.hear(Instant::now() + PATIENCE, stopped).map_err(|e| none(&e))?;
    let first = first.ok_or_else(|| none("sends no report"))?;
    let ids = link::devices(&first).map_err(|e| none(&format!("sends something else: {e}")))?;
    let list = ids.join("`, `");
    let chosen = match (device, ids.as_slice()) {
        (_, []) => Err(error(
            "the Haply Inverse Service knows no Inverse3",
            "plug one in, switch it on, and wait until the Haply Hub shows it",
        )),
        (None, [one]) => Ok(one.clone()),
        (None, _) => Err(error(
            format!("there are several devices: `{list}`"),
            "choose one of them by its `device_id`",
        )),
        (Some(id), all) if all.iter().any(|one| one == id) => Ok(id.to_owned()),
        (Some(id), _) => Err(error(format!("there is no device `{id}`"), format!("there is `{list}`"))),
    };
    Ok((link, chosen?))
}

struct Run {
    service: String,
    id: String,
    arm: ArmLoop,
    shared: Arc<Shared>,
    /// Last commanded force, in the device's axes.
    sent: [f64; 3],
    /// Whether the last report had the device.
    there: bool,
    heard: Instant,
}

impl Run {
    fn run(&mut self, mut link: Link) {
        loop {
            match self.serve(&mut link) {
                Ok(()) => return self.end(link),
                Err(why) => self.shared.trouble(format!("the service at {} is lost: {why}", self.service)),
            }
            // The service must see the old connection end before a new one begins.
            drop(link);
            let (shared, id) = (&self.shared, Some(self.id.as_str()));
            let open = || open(&self.service, id, BRIEF, || shared.stopped()).ok();
            let Some((again, _)) = shared.reopen(AGAIN, open) else { return };
            link = again;
            self.arm.servo.restart();
            (self.sent, self.there) = ([0.0; 3], false);
        }
    }

    /// Requests reports and pushes until the source stops.
    fn serve(&mut self, link: &mut Link) -> Result<(), String> {
        let mut due = Instant::now();
        let mut dry = due;
        self.heard = due;
        while !self.shared.stopped() {
            let now = Instant::now();
            if link.drain(now + PERIOD / 2)? {
                dry = now;
            } else if dry.elapsed() > STALL {
                // Reports read now are old.
                return Err("it sends more than can be read".to_owned());
            }
            link.ask(&self.id, self.sent)?;
            while let Err(silent) = self.answer(link)? {
                if self.shared.stopped() {
                    return Ok(());
                }
                if silent > LOST {
                    return Err(format!("no answer for {} s", LOST.as_secs()));
                }
                self.shared.trouble(format!("the service at {} does not answer", self.service));
            }
            due += PERIOD;
            let now = Instant::now();
            match due.checked_duration_since(now) {
                Some(rest) => thread::sleep(rest),
                // Missed periods are not made up for.
                None => due = now,
            }
        }
        Ok(())
    }

    /// Waits for a report, gives it to the servo, and sends its force if it changed. Without a report: how
    /// long there has been none.
    fn answer(&mut self, link: &mut Link) -> Result<Result<(), Duration>, String> {
        let shared = self.shared.clone();
        let hear = |link: &mut Link| link.hear(Instant::now() + STALL, || shared.stopped());
        let Some(report) = hear(link)? else { return Ok(Err(self.heard.elapsed())) };
        self.heard = Instant::now();
        self.read(&report);
        let force = self.arm.force();
        if force != self.sent {
            self.sent = force;
            link.ask(&self.id, force)?;
            if hear(link)?.is_some() {
                self.heard = Instant::now();
            }
        }
        Ok(Ok(()))
    }

    fn read(&mut self, report: &str) {
        let now = now_ns();
        let (there, place) = match link::position(report, &self.id) {
            Ok(place) => (place.is_some(), place),
            Err(why) => {
                self.shared.bad(why);
                (self.there, None)
            }
        };
        if there && !self.there {
            self.arm.stroke = self.arm.stroke.wrapping_add(1);
        } else if !there {
            self.shared.trouble(format!("the Inverse3 `{}` is no longer there", self.id));
        }
        self.there = there;
        self.arm.step(now, place);
        if place.is_some() {
            self.shared.well(&format!("the Inverse3 `{}` works again", self.id));
            self.arm.send();
        }
    }

    /// Releases the force and closes the connection.
    fn end(&mut self, mut link: Link) {
        let end = Instant::now() + LET_GO;
        loop {
            let wanted = self.arm.step(now_ns(), None);
            let force = if Instant::now() > end { [0.0; 3] } else { wanted };
            // With an unread answer the system would reset the connection and lose the last command.
            let sent = link.ask(&self.id, force).is_ok();
            let answered = sent && link.hear(Instant::now(), || false).is_ok();
            if !answered || force == [0.0; 3] {
                break;
            }
            thread::sleep(PERIOD);
        }
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
