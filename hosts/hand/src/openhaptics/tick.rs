//! Runs in the library's servo thread, 1000 times a second. Never allocates, locks or waits.

use std::ffi::{c_uint, c_void};
use std::ptr::NonNull;
use std::sync::Arc;
use std::sync::atomic::{
    AtomicBool, AtomicU32, AtomicU64, Ordering::AcqRel, Ordering::Relaxed, Ordering::Release,
};

use asperity_live::now_ns;

use super::library::{CONTINUE, CURRENT_FORCE, CURRENT_POSITION, DONE, Hd, fatal, force_off};
use crate::arm::ArmLoop;
use crate::handle::Shared;

/// Longest valid distance of the device \[mm\].
const FAR_MM: f64 = 1e4;

/// After a longer gap between calls, a new stroke begins: the motion in between is unknown.
const GAP_NS: u64 = 50_000_000;

/// Signals between the servo callback and the source's own thread.
#[derive(Debug, Default)]
pub(super) struct Signals {
    /// Request to release the force.
    pub(super) closing: AtomicBool,
    /// The force is 0 and stays 0.
    pub(super) quiet: AtomicBool,
    /// Error with which the device was lost; 0 for none.
    pub(super) lost: AtomicU32,
    /// Last other error; 0 for none.
    pub(super) minor: AtomicU32,
    pub(super) ticks: AtomicU64,
    /// Whether the callback is running. The callback releases it at its end.
    pub(super) inside: AtomicBool,
}

/// State of the servo. The library's thread owns it while scheduled, the source's thread otherwise.
pub(super) struct Tick {
    pub(super) hd: Hd,
    pub(super) device: c_uint,
    pub(super) arm: ArmLoop,
    pub(super) last_ns: Option<u64>,
    pub(super) shared: Arc<Shared>,
    pub(super) signals: Arc<Signals>,
}

/// A [`Tick`] whose address the library holds. It is lent to the library's thread between [`Parked::lend`]
/// and the end of its schedule, and not touched here meanwhile. It is never freed: a library may go on using
/// it.
pub(super) struct Parked(NonNull<Tick>);

// SAFETY: this owns its tick, which may be sent.
unsafe impl Send for Parked {}
const _: () = sent::<Tick>();
const fn sent<T: Send>() {}

impl Parked {
    pub(super) fn new(tick: Tick) -> Self {
        Self(NonNull::from(Box::leak(Box::new(tick))))
    }

    /// Argument of the scheduled callback.
    pub(super) fn lend(&mut self) -> *mut c_void {
        self.0.as_ptr().cast()
    }

    /// The tick.
    ///
    /// # Safety
    /// The callback is not scheduled, and was seen not to be inside.
    pub(super) unsafe fn mine(&mut self) -> &mut Tick {
        // SAFETY: made from a box; nobody else has it, by the caller's promise.
        unsafe { self.0.as_mut() }
    }
}

/// The callback.
///
/// # Safety
/// `user` points to a [`Tick`] that nothing else touches while this is scheduled.
pub(super) unsafe extern "system" fn tick(user: *mut c_void) -> c_uint {
    // SAFETY: the caller's promise.
    let tick = unsafe { &mut *user.cast::<Tick>() };
    tick.signals.inside.swap(true, AcqRel);
    let answer = tick.run();
    tick.signals.ticks.fetch_add(1, Relaxed);
    tick.signals.inside.store(false, Release);
    answer
}

impl Tick {
    fn run(&mut self) -> c_uint {
        let mut read = [f64::NAN; 3];
        // SAFETY: the device is initialised while this is scheduled; the position has three values.
        unsafe {
            (self.hd.begin_frame)(self.device);
            (self.hd.get_doubles)(CURRENT_POSITION, read.as_mut_ptr());
        }
        let now = now_ns();
        if self.last_ns.is_some_and(|then| now.saturating_sub(then) > GAP_NS) {
            self.arm.stroke = self.arm.stroke.wrapping_add(1);
        }
        self.last_ns = Some(now);
        let there = read.iter().all(|x| x.abs() < FAR_MM);
        let closing = self.signals.closing.load(Relaxed);
        let force = self.arm.step(now, (there && !closing).then_some(read));
        // SAFETY: inside a frame, which is closed here; the force has three values.
        unsafe {
            if self.arm.pushes() {
                (self.hd.set_doubles)(CURRENT_FORCE, force.as_ptr());
            }
            (self.hd.end_frame)(self.device);
        }
        self.signals.quiet.store(closing && force == [0.0; 3], Relaxed);
        if let Some(code) = self.hd.errors() {
            if fatal(code) {
                self.signals.lost.store(code, Relaxed);
                return DONE;
            }
            if force_off(code) {
                self.arm.servo.restart();
            }
            self.signals.minor.store(code, Relaxed);
        }
        self.arm.send();
        if !there {
            self.shared.bad.fetch_add(1, Relaxed);
        }
        CONTINUE
    }
}
