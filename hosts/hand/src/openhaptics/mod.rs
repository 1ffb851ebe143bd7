//! Touch, Touch X, Phantom: devices of 3D Systems' OpenHaptics.
//!
//! The maker's libHD is loaded only when a graph asks for the device; nothing of it is linked or shipped.
//! The library's scheduler calls us at 1 kHz. Each call reads the position, computes the force by the
//! law in [`servo`](crate::servo), and sends a sample. The time of a sample is that of the reading. Its
//! force is the commanded force along the surface's normal, which for a hand at rest is how hard it presses;
//! these devices measure no force.
//!
//! The device's x points right, y up and z at the user, so the default axes are `x,-z,y`. The maker's tools
//! calibrate the device. When it switches its motors off itself (too warm, too much force), the force
//! restarts from 0. An unplugged device is reported, and reopened when it answers, with a new stroke. A
//! process can have one such source at a time, since the library has one scheduler.

mod library;
mod tick;

use std::ffi::{CString, c_uint, c_ulong};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Acquire, Ordering::Relaxed};
use std::sync::mpsc::{self, SyncSender};
use std::thread;
use std::time::{Duration, Instant};

use asperity_live::{ForceReader, SampleWriter};
use asperity_node::Diagnostic;

use crate::arm::{AGAIN, Arm, ArmLoop, LET_GO};
use crate::handle::Shared;
use crate::{ArmOptions, Handle, error};
use library::{DEFAULT_PRIORITY, FORCE_OUTPUT, Hd, INVALID_HANDLE, NOMINAL_MAX_FORCE, NOMINAL_MAX_STIFFNESS};
use tick::{Parked, Signals, Tick};

/// Servo rate of the maker's devices [Hz].
const SERVO_HZ: u32 = 1000;
/// Largest force of a device that does not report one \[N\].
const UNTOLD_N: f64 = 1.0;
/// Longest time for the library to start.
const BEGIN: Duration = Duration::from_secs(10);
/// Time between two looks of the source's thread at the servo.
const LOOK: Duration = Duration::from_millis(20);
/// Time without a call of the servo that is a stall.
const STALL: Duration = Duration::from_millis(200);

static TAKEN: AtomicBool = AtomicBool::new(false);

/// The kind of devices. The library has one scheduler, so one source excludes another.
pub(crate) const ARM: Arm = Arm {
    input: ["openhaptics_input", "Reads the stylus of a haptic arm through the OpenHaptics library."],
    force: ["openhaptics_force", "Renders a plane on an OpenHaptics device, in the device's own servo loop."],
    max_force_n: 3.3,
    device: "Name of the device in its setup tool; empty: the default device.",
    by: ["library", "", "File of the vendor's library libHD; empty: the system's usual folders."],
    axes: "x,-z,y",
    start,
    excludes: |_, _| true,
    servo: [SERVO_HZ as f64, 0.0],
};

/// Opens the device and starts its servo. Without `models` the motors stay off. Error: the library is
/// missing or incomplete; the device does not answer; another source uses it.
pub fn start(
    options: ArmOptions,
    writer: SampleWriter,
    models: Option<ForceReader>,
) -> Result<Handle, Diagnostic> {
    let name = options.device.map(CString::new).transpose().map_err(|_| {
        error("the device's name has a zero byte in it", "write the name as the setup tool has it")
    })?;
    let turn = Turn::take()?;
    let hd = Hd::load(options.by.as_deref())?;
    let shared = Arc::new(Shared::default());
    let signals = Arc::new(Signals::default());
    // The first use of the clock sets it up, which a servo must not do.
    asperity_live::now_ns();
    let tick = Tick {
        hd,
        device: INVALID_HANDLE,
        arm: ArmLoop::new(options.axes, writer, models, shared.clone()),
        last_ns: None,
        shared: shared.clone(),
        signals: signals.clone(),
    };
    let device_thread = DeviceThread {
        hd,
        name,
        max_force_n: options.max_force_n,
        tick: Parked::new(tick),
        device: INVALID_HANDLE,
        shared: shared.clone(),
        signals,
        _turn: turn,
    };
    let (say, hear) = mpsc::sync_channel(1);
    let mut handle = Handle::start("openhaptics", shared, None, move || device_thread.run(&say))?;
    hear.recv_timeout(BEGIN).unwrap_or_else(|_| {
        // The thread is inside the library; it ends when the library returns.
        handle.thread = None;
        Err(error(
            format!("hdInitDevice has not answered for {} s", BEGIN.as_secs()),
            "unplug the device, plug it in again, and try its own test program",
        ))
    })?;
    Ok(handle)
}

/// The right to use the library's one scheduler.
struct Turn;

impl Turn {
    fn take() -> Result<Self, Diagnostic> {
        if TAKEN.swap(true, Relaxed) {
            return Err(error(
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
    max_force_n: f64,
    tick: Parked,
    device: c_uint,
    shared: Arc<Shared>,
    signals: Arc<Signals>,
    _turn: Turn,
}

impl DeviceThread {
    fn run(mut self, say: &SyncSender<Result<(), Diagnostic>>) {
        let opened = self.open();
        let failed = opened.is_err();
        let told = say.send(opened.map_err(|what| {
            error(
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
        // SAFETY: a device is opened while nothing is scheduled, and after `stop` has waited for the
        // callback.
        let tick = unsafe { self.tick.mine() };
        let most = says(NOMINAL_MAX_FORCE).unwrap_or(UNTOLD_N).min(self.max_force_n);
        tick.device = device;
        tick.arm.begin(most);
        self.shared.recommends(says(NOMINAL_MAX_STIFFNESS));
        if tick.arm.pushes() {
            // SAFETY: the device was initialised above.
            unsafe { (self.hd.enable)(FORCE_OUTPUT) };
        }
        // A device may lack one of these figures.
        self.hd.errors();
        self.device = device;
        Ok(())
    }

    fn schedule(&mut self) -> c_ulong {
        self.signals.lost.store(0, Relaxed);
        let user = self.tick.lend();
        // SAFETY: the tick is not touched from here until `stop` has taken the callback back.
        unsafe {
            (self.hd.set_rate)(c_ulong::from(SERVO_HZ));
            let handle = (self.hd.schedule)(tick::tick, user, DEFAULT_PRIORITY);
            (self.hd.start_scheduler)();
            handle
        }
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
                return self.shared.trouble(format!("{} is lost: {}", self.called(), self.hd.name(lost)));
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
                }
            } else if moved.elapsed() > STALL {
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
                return;
            }
            thread::sleep(Duration::from_millis(1));
        }
        self.signals.closing.store(false, Relaxed);
        self.signals.quiet.store(false, Relaxed);
    }

    fn close(&mut self) {
        // SAFETY: the device was initialised, and nothing is scheduled on it.
        unsafe { (self.hd.disable_device)(self.device) };
        self.hd.errors();
    }

    /// Reopens the device, until it answers or the source stops.
    fn wait(&mut self) {
        let shared = self.shared.clone();
        if shared.reopen(AGAIN, || self.open().ok()).is_some() {
            shared.well(&format!("{} is back", self.called()));
        }
    }
}
