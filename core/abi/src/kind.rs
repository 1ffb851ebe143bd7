//! A kind of node: its descriptor, and the functions of its instances.

use std::ffi::{c_char, c_void};

use crate::{AsperityError, AsperityInfo, AsperitySetup, AsperityTick};

/// A port with the type of all ports with its `shape_var`. Not for a single port.
pub const ASPERITY_LIKE: u32 = 1;
/// `count` values (f64), held between ticks.
pub const ASPERITY_CONTROL: u32 = 2;
/// This tick's samples (f32) of one channel.
pub const ASPERITY_AUDIO: u32 = 3;
/// At most one frame of magnitudes (f32) a tick, as amplitudes: 2 |sum w x| / sum w with a periodic Hann
/// window w.
pub const ASPERITY_MAGNITUDE: u32 = 4;
/// At most one frame of complex bins (pairs of f32: real, imaginary) a tick, in the same scale; phases
/// are counted from the first sample of the frame.
pub const ASPERITY_SPECTRUM: u32 = 5;

/// The node is reset when it wakes.
pub const ASPERITY_RESTART: u32 = 0;
/// `elapsed` tells the node how many ticks it slept.
pub const ASPERITY_ELAPSED: u32 = 1;
/// The node continues as it was: its output depends on the tick and its inputs, not on the number of
/// calls.
pub const ASPERITY_RESUME: u32 = 2;
/// The node never sleeps, because its state must stay up to date.
pub const ASPERITY_NEVER: u32 = 3;

/// Flag of a kind: a sink. Nodes that reach no sink are not built.
pub const ASPERITY_SINK: u32 = 1;
/// Flag of a kind: a sink that only observes and keeps nothing awake.
pub const ASPERITY_PASSIVE: u32 = 2;

/// Flag of an input: may stay unconnected. A control then reads `default_value`, audio is silent, no
/// frame comes.
pub const ASPERITY_OPTIONAL: u32 = 1;
/// Flag of a control input: a change wakes a sleeping node. Audio and frames always do.
pub const ASPERITY_WAKES: u32 = 2;
/// Flag of an input: accepts only a limited signal, which comes from the built-in limiter. No output of
/// a plugin may have it.
pub const ASPERITY_LIMITED: u32 = 4;

/// A finite number between `min` and `max`, in `default_number`.
pub const ASPERITY_NUMBER: u32 = 1;
/// A whole number between `integer_min` and `integer_max`, in `default_integer`.
pub const ASPERITY_INTEGER: u32 = 2;
/// 0 or 1, in `default_integer`.
pub const ASPERITY_FLAG: u32 = 3;
/// Any text, in `default_text`.
pub const ASPERITY_TEXT: u32 = 4;
/// One of `words`; `default_text`, or the first if that is NULL.
pub const ASPERITY_CHOICE: u32 = 5;
/// A file that must exist; never has a default. The node gets a path that it can open.
pub const ASPERITY_FILE: u32 = 6;
/// A list of numbers, each between `min` and `max`; `default_count` of them in `default_numbers`.
pub const ASPERITY_NUMBERS: u32 = 7;
/// A list of texts, empty by default.
pub const ASPERITY_TEXTS: u32 = 8;

/// Flag of a parameter: has no default, and a graph must set it.
pub const ASPERITY_REQUIRED: u32 = 1;
/// Flag of a parameter: has no default, and a graph may leave it out; it then has no value.
pub const ASPERITY_MAY_BE_LEFT_OUT: u32 = 2;
/// Flag of a parameter: `set_parameter` takes a new value while the node runs. Numbers, whole numbers,
/// flags and choices only.
pub const ASPERITY_LIVE: u32 = 4;

/// An input or output. Arrays of these advance by the first one's `size`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityPort {
    /// `sizeof(AsperityPort)`.
    pub size: u32,
    /// Content of a tick: [`ASPERITY_CONTROL`] and so on.
    pub carries: u32,
    /// Name in a graph file: lower case, words joined by `_`.
    pub name: *const c_char,
    /// Meaning, in a few words.
    pub doc: *const c_char,
    /// Symbol of the unit, such as `mm/s`; `1` for none. NULL if `unit_var` is set.
    pub unit: *const c_char,
    /// A letter: any unit, the same for every port with this letter. 0 for none.
    pub unit_var: u32,
    /// A letter: any rate (audio) or layout (frames), the same for every port with this letter. 0 for none.
    pub shape_var: u32,
    /// The units that `unit_var` may be, ending with NULL; NULL for any.
    pub units: *const *const c_char,
    /// Control: number of values.
    pub count: u32,
    /// Audio without `shape_var`: samples a second, 0 for the graph's audio rate. Frames without
    /// `shape_var`: samples a second of the signal they describe.
    pub rate_hz: u32,
    /// Frames without `shape_var`: window and DFT length in samples.
    pub length: u32,
    /// Frames without `shape_var`: number of bins, from bin 0 on.
    pub bins: u32,
    /// Frames without `shape_var`: frames a second, numerator.
    pub frame_num: u32,
    /// Frames without `shape_var`: frames a second, denominator.
    pub frame_den: u32,
    /// [`ASPERITY_OPTIONAL`], [`ASPERITY_WAKES`], [`ASPERITY_LIMITED`].
    pub flags: u32,
    /// 0.
    pub reserved: u32,
    /// Value of an unconnected control.
    pub default_value: f64,
}

/// A parameter. Arrays of these advance by the first one's `size`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityParam {
    /// `sizeof(AsperityParam)`.
    pub size: u32,
    /// Type of the value: [`ASPERITY_NUMBER`] and so on.
    pub holds: u32,
    /// Name in a graph file: lower case, words joined by `_`.
    pub name: *const c_char,
    /// Meaning and effect, in a sentence.
    pub doc: *const c_char,
    /// Symbol of the unit of a number; NULL for none.
    pub unit: *const c_char,
    /// [`ASPERITY_REQUIRED`], [`ASPERITY_MAY_BE_LEFT_OUT`], [`ASPERITY_LIVE`].
    pub flags: u32,
    /// Number of `default_numbers`.
    pub default_count: u32,
    /// Least number.
    pub min: f64,
    /// Greatest number.
    pub max: f64,
    /// Least whole number.
    pub integer_min: i64,
    /// Greatest whole number.
    pub integer_max: i64,
    /// Default of a number.
    pub default_number: f64,
    /// Default of a whole number or flag.
    pub default_integer: i64,
    /// Default of a text or choice; NULL for the empty text or the first word.
    pub default_text: *const c_char,
    /// The words of a choice, ending with NULL.
    pub words: *const *const c_char,
    /// Default of a list of numbers.
    pub default_numbers: *const f64,
}

/// Receives ports from [`AsperityKind::ports`]. Valid during that call.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityPortSink {
    /// `sizeof(AsperityPortSink)`.
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// The first argument of the functions below.
    pub context: *mut c_void,
    /// Adds an input, and copies the data of `port`. Call it only during that call, on its thread.
    pub input: Option<unsafe extern "C" fn(context: *mut c_void, port: *const AsperityPort)>,
    /// Adds an output, and copies the data of `port`. Call it only during that call, on its thread.
    pub output: Option<unsafe extern "C" fn(context: *mut c_void, port: *const AsperityPort)>,
}

/// A kind of node.
///
/// The life of an instance: `create`, `prepare` once, then any number of the tick functions, `destroy`.
/// Functions that are marked optional may be NULL.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityKind {
    /// `sizeof(AsperityKind)`.
    pub size: u32,
    /// [`ASPERITY_SINK`], [`ASPERITY_PASSIVE`].
    pub flags: u32,
    /// Behaviour on waking: [`ASPERITY_RESTART`] and so on.
    pub resume: u32,
    /// Number of inputs.
    pub input_count: u32,
    /// Number of outputs.
    pub output_count: u32,
    /// Number of parameters.
    pub param_count: u32,
    /// Name in a graph file: lower case, words joined by `_`; no other kind may have it.
    pub kind: *const c_char,
    /// Purpose, in a sentence that ends with a full stop.
    pub summary: *const c_char,
    /// Notes on latency and tail; NULL if both are 0.
    pub timing: *const c_char,
    /// Inputs. If they depend on parameters, those for the defaults.
    pub inputs: *const AsperityPort,
    /// Outputs. If they depend on parameters, those for the defaults.
    pub outputs: *const AsperityPort,
    /// Parameters.
    pub params: *const AsperityParam,
    /// Name of the input that this node gates, with `wants`; NULL for none.
    pub gate: *const c_char,
    /// Name of the parameter with the node's delay, for a node that can close a cycle, with `absorb`;
    /// NULL for one that cannot.
    pub feedback: *const c_char,
    /// Reports the ports for these parameters; `inputs` and `outputs` of `setup` are empty. Optional:
    /// the ports above. [`ASPERITY_OK`], or [`ASPERITY_FAILED`] with `error` filled in. Control thread.
    pub ports: Option<
        unsafe extern "C" fn(
            setup: *const AsperitySetup,
            sink: *const AsperityPortSink,
            error: *mut AsperityError,
        ) -> i32,
    >,
    /// Makes an instance that `prepare` fills; NULL on failure. `kind` is the pointer from the plugin.
    /// Control thread.
    pub create: Option<unsafe extern "C" fn(kind: *const AsperityKind) -> *mut c_void>,
    /// Prepares the instance for its place in a graph: allocates, reads files, and may fail with
    /// `error` filled in. Called once, before all functions below. After a failure only `destroy`
    /// follows. Control thread.
    pub prepare: Option<
        unsafe extern "C" fn(
            instance: *mut c_void,
            setup: *const AsperitySetup,
            error: *mut AsperityError,
        ) -> i32,
    >,
    /// Writes latency, tail and the like of a prepared instance. Optional. Control thread.
    pub info: Option<unsafe extern "C" fn(instance: *mut c_void, info: *mut AsperityInfo)>,
    /// Runs one tick: [`ASPERITY_CONTINUE`] and so on. At the start audio outputs are zero, frames are
    /// absent, and controls hold their values. Tick thread.
    pub process: Option<unsafe extern "C" fn(instance: *mut c_void, tick: *mut AsperityTick) -> i32>,
    /// Restores the state after `prepare`, with the current parameters. Tick thread.
    pub reset: Option<unsafe extern "C" fn(instance: *mut c_void) -> i32>,
    /// Gates only: 1 if the gated input is wanted this tick, else 0; or an error. Called once a tick,
    /// before `process`, when all inputs but the gated one are ready, and without outputs. Tick thread.
    pub wants: Option<unsafe extern "C" fn(instance: *mut c_void, tick: *mut AsperityTick) -> i32>,
    /// Nodes that close a cycle only: takes this tick's inputs, after `process` has run without them.
    /// Tick thread.
    pub absorb: Option<unsafe extern "C" fn(instance: *mut c_void, tick: *mut AsperityTick) -> i32>,
    /// Required with [`ASPERITY_ELAPSED`], else unused: tells how many ticks the node slept. Its state
    /// must become that of as many calls. Tick thread.
    pub elapsed: Option<unsafe extern "C" fn(instance: *mut c_void, ticks: u64) -> i32>,
    /// Sets the live parameter at `index` to a value in its range. A flag is 0 or 1, a choice the index
    /// of its word. Optional if no parameter is live. Tick thread.
    pub set_parameter: Option<unsafe extern "C" fn(instance: *mut c_void, index: u32, value: f64) -> i32>,
    /// Most bytes that `save` writes, always the same. Optional together with `save` and `restore`.
    /// Control thread.
    pub state_size: Option<unsafe extern "C" fn(instance: *mut c_void) -> u64>,
    /// Writes the instance's state to `bytes`, at most `capacity` of them, and returns its length; less
    /// than 0 on failure. Tick thread.
    pub save: Option<unsafe extern "C" fn(instance: *mut c_void, bytes: *mut u8, capacity: u64) -> i64>,
    /// Continues from the state of an instance of this kind, perhaps with other parameters or from
    /// another build of the plugin: check it. [`ASPERITY_OK`], or [`ASPERITY_FAILED`], and then the
    /// host calls `reset`. Tick thread.
    pub restore: Option<unsafe extern "C" fn(instance: *mut c_void, bytes: *const u8, len: u64) -> i32>,
    /// Frees the instance. Control thread.
    pub destroy: Option<unsafe extern "C" fn(instance: *mut c_void)>,
}
