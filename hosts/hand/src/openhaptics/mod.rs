//! Touch, Touch X, Phantom: devices of 3D Systems' OpenHaptics.
//!
//! The maker's libHD is loaded only when a graph asks for the device; nothing of it is linked or shipped.
//! The library's scheduler calls us at 1 kHz. Each call reads the position, computes the force from the
//! newest [`ForceModel`](asperity_live::ForceModel) by the law in [`servo`](crate::servo), and sends a
//! sample. The time of a sample is that of the reading. Its force is the commanded force along the
//! surface's normal, which for a hand at rest is how hard it presses; these devices measure no force.
//!
//! The device's x points right, y up and z at the user, so the default axes are `x,-z,y`. The maker's tools
//! calibrate the device. When it switches its motors off itself (too warm, too much force), the force
//! restarts from 0. An unplugged device is reported, and reopened when it answers, with a new stroke. A
//! process can have one such source at a time, since the library has one scheduler.

mod callback;
mod library;

use std::ffi::{CString, c_uint, c_ulong};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Acquire, Ordering::Relaxed};
use std::sync::mpsc::{self, SyncSender};
use std::thread;
use std::time::{Duration, Instant};

use asperity_live::{ForceReader, SampleWriter};
use asperity_node::{Descriptor, Param, Params, Registry};

use crate::device::text;
use crate::handle::{Handle, Shared, spawn};
use crate::node::{Arm, ArmForce, ArmInput};
use crate::servo::{Limits, Servo};
use crate::{Device, Frame, HandDevice, HandError, Open};
use callback::{Parked, Signals, Tick};
use library::{DEFAULT_PRIORITY, FORCE_OUTPUT, Hd, INVALID_HANDLE, NOMINAL_MAX_FORCE, NOMINAL_MAX_STIFFNESS};

/// Servo rate of the maker's devices [Hz].
pub const SERVO_HZ: u32 = 1000;
/// Largest force of a device that does not report one \[N\].
const UNTOLD_N: f64 = 1.0;
/// Longest time for the library to start.
const BEGIN: Duration = Duration::from_secs(10);
/// Time between two looks of the source's thread at the servo.
const LOOK: Duration = Duration::from_millis(20);
/// Time without a call of the servo that is a stall.
const STALL: Duration = Duration::from_millis(200);
/// Time between two attempts to reopen a lost device.
const AGAIN: Duration = Duration::from_millis(500);
/// Longest time for the servo to release its force before it is stopped; the law takes 20 ms.
const LET_GO: Duration = Duration::from_millis(50);

/// One source at a time.
static TAKEN: AtomicBool = AtomicBool::new(false);

/// Options of the device.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenHapticsOptions {
    /// Name of the device in the maker's setup tool; `None` for its default device.
    pub device: Option<String>,
    /// Path of libHD; `None` lets the system's loader find it.
    pub library: Option<PathBuf>,
    /// The device's axes and origin.
    pub frame: Frame,
    /// Servo ticks a sample: 1 sends 1000 a second.
    pub every: u32,
    /// Largest force \[N\]; the device's own limit also applies.
    pub max_force_n: f64,
}

impl OpenHapticsOptions {
    /// The default device, y up, a sample each servo tick, as much force as the device has.
    pub fn new() -> Self {
        let frame = Frame::new("x,-z,y", [0.0; 3]).unwrap_or_default();
        Self { device: None, library: None, frame, every: 1, max_force_n: f64::INFINITY }
    }
}

impl Default for OpenHapticsOptions {
    fn default() -> Self {
        Self::new()
    }
}

/// The kind of devices.
pub struct OpenHaptics;

impl Arm for OpenHaptics {
    fn input() -> Descriptor {
        Descriptor::new("openhaptics_input", "A stylus on an arm, by the OpenHaptics library.").param(
            Param::text(
                "library",
                "",
                "The vendor's library libHD; empty to look where systems keep theirs.",
            ),
        )
    }

    fn force() -> (Descriptor, f64) {
        let summary = "Renders a plane on an OpenHaptics device, in the device's own servo loop.";
        (Descriptor::new("openhaptics_force", summary), 3.3)
    }

    const NAME: &str = "Name of the device as its set-up tool knows it; empty for the default.";
    const AXES: &str = "x,-z,y";
}

impl HandDevice for OpenHaptics {
    fn input(&self) -> &'static str {
        "openhaptics_input"
    }

    fn force(&self) -> Option<&'static str> {
        Some("openhaptics_force")
    }

    fn register(&self, registry: Registry) -> Registry {
        registry.with::<ArmInput<Self>>().with::<ArmForce<Self>>()
    }

    fn configure(&self, params: &Params, max_force_n: f64) -> Result<Open, HandError> {
        let options = OpenHapticsOptions {
            device: text(params, "device"),
            library: text(params, "library").map(PathBuf::from),
            frame: Frame::new(params.text("axes"), [0.0; 3])?,
            max_force_n,
            ..OpenHapticsOptions::new()
        };
        Ok(Box::new(|writer, models| start(options, writer, models)))
    }

    /// The library has one scheduler.
    fn excludes(&self, _params: &Params, _open: &Params, _address: Option<SocketAddr>) -> bool {
        true
    }

    fn servo_hz(&self) -> f64 {
        f64::from(SERVO_HZ)
    }
}

/// Opens the device and starts its servo. Without `models` the motors stay off.
///
/// # Errors
/// The library is missing or incomplete; the device does not answer; another source uses it; an
/// invalid option.
pub fn start(
    options: OpenHapticsOptions,
    writer: SampleWriter,
    models: Option<ForceReader>,
) -> Result<Handle, HandError> {
    if options.every == 0 || options.max_force_n.is_nan() || options.max_force_n < 0.0 {
        return Err(HandError::option(
            format!("a sample every {} servo ticks, at most {} N", options.every, options.max_force_n),
            "write 1 or more ticks, and 0 N or more",
        ));
    }
    let name = options.device.clone().map(CString::new).transpose().map_err(|_| {
        HandError::option(
            "the device's name has a zero byte in it",
            "write the name as the setup tool has it",
        )
    })?;
    let turn = Turn::take()?;
    let hd = Hd::load(options.library.as_deref())?;
    let shared = Arc::new(Shared::default());
    let signals = Arc::new(Signals::default());
    // The first use of the clock sets it up, which a servo must not do.
    asperity_live::now_ns();
    let pushes = models.is_some();
    let tick = Tick {
        hd,
        device: INVALID_HANDLE,
        frame: options.frame,
        servo: Servo::new(Limits::of(0.0)),
        models,
        writer,
        every: options.every,
        stroke: 0,
        count: 0,
        last_ns: None,
        shared: shared.clone(),
        signals: signals.clone(),
    };
    let tick = Parked::new(tick, signals.clone());
    let most = options.max_force_n;
    let device_thread = DeviceThread {
        hd,
        name,
        most,
        tick,
        device: INVALID_HANDLE,
        pushes,
        shared: shared.clone(),
        signals,
        _turn: turn,
    };
    let (say, hear) = mpsc::sync_channel(1);
    let thread = spawn("openhaptics", move || device_thread.run(&say))?;
    match hear.recv_timeout(BEGIN) {
        Ok(Ok(())) => Ok(Handle::new(shared, thread, None)),
        Ok(Err(e)) => {
            let _ = thread.join();
            Err(e)
        }
        Err(_) => {
            // The thread is inside the library; it ends when the library returns.
            shared.stop.store(true, Relaxed);
            Err(HandError::missing(
                format!("hdInitDevice has not answered for {} s", BEGIN.as_secs()),
                "unplug the device, plug it in again, and try its own test program",
            ))
        }
    }
}

/// The right to use the library's one scheduler.
struct Turn;

impl Turn {
    fn take() -> Result<Self, HandError> {
        if TAKEN.swap(true, Relaxed) {
            return Err(HandError::taken(
                "another OpenHaptics source of this process has the library's scheduler",
                "leave one of them out of the graph",
            ));
        }
        Ok(Self)
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        TAKEN.store(false, Relaxed);
    }
}

/// The source's own thread: it makes all calls of the library except the servo's.
struct DeviceThread {
    hd: Hd,
    name: Option<CString>,
    most: f64,
    tick: Parked,
    device: c_uint,
    pushes: bool,
    shared: Arc<Shared>,
    signals: Arc<Signals>,
    _turn: Turn,
}

impl DeviceThread {
    fn run(mut self, say: &SyncSender<Result<(), HandError>>) {
        let opened = self.open();
        let failed = opened.is_err();
        let told = say.send(opened.map_err(|what| {
            HandError::missing(
                format!("{} does not answer: {what}", self.called()),
                "plug it in, switch it on, run the driver's setup once, and stop other programs that use it",
            )
        }));
        if failed {
            return;
        }
        if told.is_err() {
            self.close();
            return;
        }
        while !self.shared.stopped() {
            let handle = self.schedule();
            self.watch();
            self.stop(handle);
            self.close();
            self.wait();
        }
    }

    fn called(&self) -> String {
        let default = "the default device".to_owned();
        self.name.as_ref().map_or(default, |n| format!("the device `{}`", n.to_string_lossy()))
    }

    /// Opens the device and reports its figures. The error says why it cannot.
    fn open(&mut self) -> Result<(), String> {
        self.hd.errors();
        let name = self.name.as_ref().map_or(std::ptr::null(), |n| n.as_ptr());
        // SAFETY: a name that ends in 0 and outlives the call, or null for the default device.
        let device = unsafe { (self.hd.init_device)(name) };
        if let Some(code) = self.hd.errors() {
            return Err(self.hd.name(code));
        }
        if device == INVALID_HANDLE {
            return Err("no device".to_owned());
        }
        // SAFETY: the device was initialised above.
        unsafe { (self.hd.make_current)(device) };
        let says = |what| {
            let mut value = [0.0; 6];
            // SAFETY: these figures have one value; there is room for more.
            unsafe { (self.hd.get_doubles)(what, value.as_mut_ptr()) };
            let [value, ..] = value;
            (value.is_finite() && value > 0.0).then_some(value)
        };
        let stiffness = says(NOMINAL_MAX_STIFFNESS);
        let most = if self.pushes { says(NOMINAL_MAX_FORCE).unwrap_or(UNTOLD_N).min(self.most) } else { 0.0 };
        if self.pushes {
            // SAFETY: the device was initialised above.
            unsafe { (self.hd.enable)(FORCE_OUTPUT) };
        }
        // A device may lack one of these figures.
        self.hd.errors();
        self.device = device;
        // SAFETY: a device is opened while nothing is scheduled, and after `stop` has waited for the
        // callback.
        let tick = unsafe { self.tick.mine() };
        tick.device = device;
        tick.servo = Servo::new(Limits::of(most));
        self.shared.set_device(Device {
            name: self.name.as_ref().map_or("default".to_owned(), |n| n.to_string_lossy().into_owned()),
            max_force_n: most,
            max_stiffness_n_per_mm: stiffness,
        });
        Ok(())
    }

    fn schedule(&mut self) -> c_ulong {
        self.signals.lost.store(0, Relaxed);
        let user = self.tick.lend();
        // SAFETY: the tick is not touched from here until `stop` has taken the callback back.
        let handle = unsafe {
            (self.hd.set_rate)(c_ulong::from(SERVO_HZ));
            let handle = (self.hd.schedule)(callback::tick, user, DEFAULT_PRIORITY);
            (self.hd.start_scheduler)();
            handle
        };
        self.shared.set_connected(true);
        handle
    }

    /// Watches the servo until the source stops or the device is lost.
    fn watch(&mut self) {
        let (mut ticks, mut moved, mut minor) = (self.signals.ticks.load(Relaxed), Instant::now(), None);
        loop {
            thread::park_timeout(LOOK);
            if self.shared.stopped() {
                return;
            }
            let lost = self.signals.lost.load(Relaxed);
            if lost != 0 {
                self.shared.set_connected(false);
                self.shared.trouble(format!("{} is lost: {}", self.called(), self.hd.name(lost)));
                return;
            }
            let code = self.signals.minor.swap(0, Relaxed);
            if code != 0 {
                minor = Some(Instant::now());
                let what =
                    if library::force_off(code) { "switched its force off" } else { "reports an error" };
                self.shared.trouble(format!("{} {what}: {}", self.called(), self.hd.name(code)));
            }
            let now = self.signals.ticks.load(Relaxed);
            if now != ticks {
                (ticks, moved) = (now, Instant::now());
                if minor.is_none_or(|then: Instant| then.elapsed() > Duration::from_secs(1)) {
                    self.shared.well(&format!("{} works again", self.called()));
                    self.shared.set_connected(true);
                }
            } else if moved.elapsed() > STALL {
                self.shared.set_connected(false);
                self.shared.trouble(format!("the servo of {} stands still", self.called()));
            }
        }
    }

    /// Releases the force and takes the callback back.
    fn stop(&mut self, handle: c_ulong) {
        self.signals.closing.store(true, Relaxed);
        let begin = Instant::now();
        let lost = || self.signals.lost.load(Relaxed) != 0;
        while !self.signals.quiet.load(Relaxed) && !lost() && begin.elapsed() < LET_GO {
            thread::sleep(Duration::from_millis(1));
        }
        // SAFETY: after these the library does not call the callback again.
        unsafe {
            (self.hd.stop_scheduler)();
            (self.hd.unschedule)(handle);
        }
        // The library may stop without waiting for its thread: wait here, as long as it takes, since the
        // tick is used again. A source that ends waits less, and leaves the tick to the library.
        while self.signals.inside.load(Acquire) {
            if self.shared.stopped() && begin.elapsed() > 2 * LET_GO {
                self.shared.set_force(0.0);
                return;
            }
            thread::sleep(Duration::from_millis(1));
        }
        self.signals.closing.store(false, Relaxed);
        self.signals.quiet.store(false, Relaxed);
        self.shared.set_force(0.0);
    }

    fn close(&mut self) {
        // SAFETY: the device was initialised, and nothing is scheduled on it.
        unsafe { (self.hd.disable_device)(self.device) };
        self.hd.errors();
    }

    /// Reopens the device, until it answers or the source stops.
    fn wait(&mut self) {
        while !self.shared.stopped() {
            thread::park_timeout(AGAIN);
            if !self.shared.stopped() && self.open().is_ok() {
                self.shared.well(&format!("{} is back", self.called()));
                return;
            }
        }
    }
}
