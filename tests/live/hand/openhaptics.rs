//! An OpenHaptics device, played by a stand-in library that is built here.
#![cfg(unix)]

use std::ffi::{c_uint, c_void};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, PoisonError, RwLockReadGuard};
use std::time::Duration;

use asperity_hand::openhaptics::start;
use asperity_hand::{ArmOptions, Handle};
use asperity_live::{ForceReader, SampleReader, force_model, now_ns, samples};
use asperity_motion::AxisMap;
use harness::alone::beside_others;
use harness::counting::allocations;
use harness::live::{Background, until};
use libloading::{Library, Symbol};

use super::{floor, library, newest, problem};

/// A stand-in of its own: the library, where it lies, and the turn to use it. The library has one scheduler,
/// so a process has one device at a time.
struct Standin {
    library: Library,
    path: PathBuf,
    _folder: tempfile::TempDir,
    _turn: (MutexGuard<'static, ()>, RwLockReadGuard<'static, ()>),
}

static TURN: Mutex<()> = Mutex::new(());

impl Standin {
    fn new() -> Self {
        let turn = (TURN.lock().unwrap_or_else(PoisonError::into_inner), beside_others());
        let folder = tempfile::tempdir().unwrap();
        let path = library(folder.path(), "hd.c", "-DWHOLE");
        // SAFETY: the stand-in has no initialisers.
        let library = unsafe { Library::new(&path) }.unwrap();
        Self { library, path, _folder: folder, _turn: turn }
    }

    fn get<T>(&self, name: &str) -> Symbol<'_, T> {
        // SAFETY: every use below names the type that hd.c has.
        unsafe { self.library.get(name) }.unwrap()
    }

    fn set(&self, name: &str, value: c_uint) {
        // SAFETY: these functions take one 32-bit number and answer nothing.
        unsafe { self.get::<unsafe extern "C" fn(c_uint)>(name)(value) }
    }

    fn number(&self, name: &str) -> f64 {
        // SAFETY: these functions take nothing and answer a double.
        unsafe { self.get::<unsafe extern "C" fn() -> f64>(name)() }
    }

    fn hand(&self, at: [f64; 3]) {
        // SAFETY: takes three doubles.
        unsafe { self.get::<unsafe extern "C" fn(f64, f64, f64)>("standin_move")(at[0], at[1], at[2]) }
    }

    fn force(&self) -> [f64; 3] {
        let mut force = [0.0; 3];
        // SAFETY: writes three doubles.
        unsafe { self.get::<unsafe extern "C" fn(*mut f64)>("standin_force")(force.as_mut_ptr()) };
        force
    }

    fn options(&self) -> ArmOptions {
        ArmOptions {
            device: None,
            by: Some(self.path.display().to_string()),
            axes: AxisMap::parse("x,-z,y").unwrap(),
            max_force_n: f64::INFINITY,
        }
    }

    fn start(&self, models: Option<ForceReader>) -> (Handle, SampleReader) {
        let (to, from) = samples();
        (start(self.options(), to, models).unwrap(), from)
    }

    /// A hand that presses 4 mm into a floor of 0.5 N/mm.
    fn pressing(&self) -> (Handle, SampleReader, Background) {
        self.hand([0.0, -4.0, 0.0]);
        let (models, reader) = force_model();
        let held = floor(models);
        let (handle, from) = self.start(Some(reader));
        until("the force", || (self.force()[1] - 2.0).abs() < 1e-6);
        (handle, from, held)
    }
}

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);
static CALLS: AtomicU64 = AtomicU64::new(0);

/// Runs the source's callback in the stand-in's thread, and counts its allocations.
unsafe extern "C" fn forbid(
    callback: unsafe extern "C" fn(*mut c_void) -> c_uint,
    user: *mut c_void,
    answer: *mut c_uint,
) {
    // SAFETY: what the scheduler would have called; the answer is the stand-in's own.
    let ((), count) = allocations(|| unsafe { *answer = callback(user) });
    ALLOCATIONS.fetch_add(count, Relaxed);
    CALLS.fetch_add(1, Relaxed);
}

#[test]
fn openhaptics_hand_has_z_up_and_floor_pushes_along_y() {
    let standin = Standin::new();
    standin.hand([1.0, -4.0, 2.0]);
    let (models, reader) = force_model();
    // SAFETY: takes a function of this type.
    unsafe { standin.get::<unsafe extern "C" fn(*const c_void)>("standin_wrap")(forbid as *const c_void) };
    let held = floor(models);
    let (handle, mut from) = standin.start(Some(reader));
    assert_eq!(handle.max_stiffness_n_per_mm(), Some(0.5));
    // The scheduler is started once the device is known to be there.
    until("the servo", || {
        ["standin_rate", "standin_output"].map(|name| standin.number(name)) == [1000.0, 1.0]
    });
    // 4 mm in a floor of 0.5 N/mm.
    until("the force", || (standin.force()[1] - 2.0).abs() < 1e-6);
    assert!(standin.force()[0] == 0.0 && standin.force()[2] == 0.0, "{:?}", standin.force());
    until("a sample with the force", || newest(&mut from).is_some_and(|s| (s.force - 2.0).abs() < 1e-6));
    until("another sample", || {
        newest(&mut from).is_some_and(|s| {
            assert_eq!((s.position, s.stroke), ([1.0, -2.0, -4.0], 0));
            assert!(s.time_ns == s.arrived_ns && s.time_ns <= now_ns());
            true
        })
    });
    // Deeper than the device can push.
    standin.hand([0.0, -40.0, 0.0]);
    until("the greatest force", || (standin.force()[1] - 3.3).abs() < 1e-6);
    // Off the floor.
    standin.hand([0.0, 1.0, 0.0]);
    until("no force", || standin.force() == [0.0; 3]);
    assert!(
        CALLS.load(Relaxed) > 200 && ALLOCATIONS.load(Relaxed) == 0,
        "{} allocations",
        ALLOCATIONS.load(Relaxed)
    );
    assert_eq!((handle.problem(), handle.bad()), (None, 0));
    drop(held);
}

#[test]
fn stalled_graph_or_dropped_source_lets_go_without_a_step() {
    let standin = Standin::new();
    let (handle, _from, held) = standin.pressing();
    // The graph stops telling: 100 ms, then 20 ms.
    drop(held);
    until("no force", || standin.force() == [0.0; 3]);
    drop(handle);
    let (handle, _from, _floor) = standin.pressing();
    standin.set("standin_forget", 0);
    drop(handle);
    assert_eq!(standin.force(), [0.0; 3]);
    assert_eq!(["standin_open", "standin_scheduled"].map(|name| standin.number(name)), [0.0; 2]);
    // 2 N in 20 ms are 0.1 N a tick; a late tick of this machine makes up to a few at once.
    let worst = standin.number("standin_worst_step");
    assert!(worst < 1.9, "{worst} N at once");
}

#[test]
fn unplugged_device_is_told_once_and_goes_on_when_back() {
    let standin = Standin::new();
    let (handle, mut from) = standin.start(None);
    assert_eq!(standin.number("standin_output"), 0.0, "nobody asked for force");
    until("samples", || newest(&mut from).is_some_and(|s| s.stroke == 0));
    standin.set("standin_plug", 0);
    let said = problem(&handle);
    assert!(
        said.contains(
            "the default device is lost: communication error between host and device (error 0x0302)"
        ),
        "{said}"
    );
    std::thread::sleep(Duration::from_millis(700));
    assert_eq!(handle.problem(), None);
    newest(&mut from);
    standin.set("standin_plug", 1);
    assert!(problem(&handle).contains("is back"));
    until("samples of a new stroke", || newest(&mut from).is_some_and(|s| s.stroke == 1));
}

#[test]
fn motors_that_switch_off_begin_again_from_no_force() {
    let standin = Standin::new();
    let (handle, _from, _floor) = standin.pressing();
    standin.set("standin_error_always", 0x201);
    assert!(problem(&handle).contains("switched its force off: (error 0x0201)"));
    until("no force", || standin.force()[1] < 0.1);
    standin.set("standin_error_always", 0);
    assert!(problem(&handle).contains("works again"));
    until("the force again", || (standin.force()[1] - 2.0).abs() < 1e-6);
}

#[test]
fn stalled_servo_is_told_and_begins_a_new_stroke() {
    let standin = Standin::new();
    let (handle, mut from) = standin.start(None);
    until("samples", || newest(&mut from).is_some());
    standin.set("standin_hang", 1);
    assert!(problem(&handle).contains("stands still"));
    newest(&mut from);
    standin.set("standin_hang", 0);
    assert!(problem(&handle).contains("works again"));
    until("samples of a new stroke", || newest(&mut from).is_some_and(|s| s.stroke == 1));
}

#[test]
fn a_position_that_is_not_finite_is_counted_and_lets_go() {
    let standin = Standin::new();
    let (handle, mut from, _floor) = standin.pressing();
    standin.hand([0.0, f64::NAN, 0.0]);
    until("no force", || standin.force() == [0.0; 3]);
    assert!(handle.bad() > 0);
    assert!(std::iter::from_fn(|| from.take()).all(|s| s.position.iter().all(|x| x.is_finite())));
}

#[test]
fn device_without_a_force_limit_is_held_to_1_n() {
    let standin = Standin::new();
    standin.set("standin_untold", 1);
    standin.hand([0.0, -40.0, 0.0]);
    let (models, reader) = force_model();
    let _floor = floor(models);
    let (handle, _from) = standin.start(Some(reader));
    assert_eq!(handle.max_stiffness_n_per_mm(), None);
    until("the force", || (standin.force()[1] - 1.0).abs() < 1e-6);
}

#[test]
fn what_is_missing_is_told_with_what_to_do() {
    let standin = Standin::new();
    let run = |options| start(options, samples().0, None).unwrap_err();
    let by = |path: &str| ArmOptions { by: Some(path.to_owned()), ..ArmOptions::default() };
    let e = run(by("/nowhere/libHD.so"));
    assert!(e.message.contains("/nowhere/libHD.so"), "{e}");
    assert!(e.help.is_some_and(|help| help.contains("install") && help.contains("OpenHaptics")));

    let folder = tempfile::tempdir().unwrap();
    let half = library(folder.path(), "hd.c", "-DWITHOUT_UNSCHEDULE");
    let e = run(by(&half.display().to_string()));
    assert!(e.message.contains("has no function hdUnschedule"), "{e}");

    let named = |name: &str| ArmOptions { device: Some(name.to_owned()), ..standin.options() };
    let e = run(named("Left"));
    assert!(e.message.contains("the device `Left` does not answer: communication error"), "{e}");

    let first = standin.start(None);
    let e = run(standin.options());
    assert!(e.message.contains("another OpenHaptics source"), "{e}");
    drop(first);
    start(named("Touch"), samples().0, None).unwrap();
}
