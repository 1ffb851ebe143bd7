//! What goes in and out of an instance's functions.

use std::ffi::{c_char, c_void};

/// All went well. (`prepare`, `ports`, `reset`, `absorb`, `elapsed`, `set_parameter`, `restore`)
pub const ASPERITY_OK: i32 = 0;
/// It failed. Of `process` the number that says how is in [`AsperityTick::detail`].
pub const ASPERITY_FAILED: i32 = -1;
/// A panic or an exception was caught on the plugin's side.
pub const ASPERITY_PANICKED: i32 = -2;

/// Answer of `process`: more to come.
pub const ASPERITY_CONTINUE: i32 = 0;
/// Answer of `process`: the outputs of this tick are silent; call again.
pub const ASPERITY_QUIET: i32 = 1;
/// Answer of `process`: so many more ticks until silence, in [`AsperityTick::detail`], unless an input
/// wakes the node.
pub const ASPERITY_TAIL: i32 = 2;
/// Answer of `process`: nothing to come until an input that wakes carries something.
pub const ASPERITY_ASLEEP: i32 = 3;

/// The value of a parameter. Arrays of these advance by the first one's `size`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityValue {
    /// `sizeof(AsperityValue)`.
    pub size: u32,
    /// 0: it has no value; 1: its default; 2: the graph sets it.
    pub set: u32,
    /// Number or whole number.
    pub number: f64,
    /// Whole number, flag (0 or 1), or the place of a choice's word.
    pub integer: i64,
    /// Text, word of a choice or path of a file; never NULL.
    pub text: *const c_char,
    /// The folder that a relative path in `text` is relative to; never NULL, empty for the one the
    /// program runs in. Paths of files are ready to be opened.
    pub base: *const c_char,
    /// Numbers of a list, `count` of them.
    pub numbers: *const f64,
    /// Texts of a list, `count` of them.
    pub texts: *const *const c_char,
    /// Length of a list.
    pub count: u32,
    /// 0.
    pub reserved: u32,
}

/// How one port is connected. Arrays of these advance by the first one's `size`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityWire {
    /// `sizeof(AsperityWire)`.
    pub size: u32,
    /// 1 where a wire ends (or begins) there.
    pub connected: u32,
    /// What it carries: `ASPERITY_CONTROL` and so on; 0 for an unconnected port whose type nothing settles.
    pub carries: u32,
    /// `ASPERITY_LIMITED`.
    pub flags: u32,
    /// Control: number of values.
    pub count: u32,
    /// Audio: samples a second. Frames: samples a second of the signal they describe.
    pub rate_hz: u32,
    /// Frames: window and DFT length in samples.
    pub length: u32,
    /// Frames: number of bins, from bin 0 on; at most length / 2 + 1.
    pub bins: u32,
    /// Frames: frames a second, numerator. Frame n starts at sample floor(n rate_hz frame_den / frame_num).
    pub frame_num: u32,
    /// Frames: frames a second, denominator.
    pub frame_den: u32,
    /// Symbol of the unit; never NULL.
    pub unit: *const c_char,
}

/// What an instance is prepared for.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperitySetup {
    /// `sizeof(AsperitySetup)`.
    pub size: u32,
    /// Ticks a second.
    pub tick_hz: u32,
    /// The node runs every `every`-th tick.
    pub every: u32,
    /// The graph's audio rate in Hz.
    pub audio_hz: u32,
    /// A seed of the node's own.
    pub seed: u64,
    /// The node's name in the graph.
    pub id: *const c_char,
    /// Values of the parameters, in the descriptor's order.
    pub params: *const AsperityValue,
    /// Inputs, in the descriptor's order.
    pub inputs: *const AsperityWire,
    /// Outputs, in the descriptor's order.
    pub outputs: *const AsperityWire,
    /// Number of parameters.
    pub param_count: u32,
    /// Number of inputs.
    pub input_count: u32,
    /// Number of outputs.
    pub output_count: u32,
    /// 1 where this node closes a cycle: `process` then runs before its inputs are there, and `absorb`
    /// when they are.
    pub closes_cycle: u32,
}

/// Where `prepare` and `ports` say what is wrong. Both texts are the host's memory, empty at first; what
/// is longer is cut off.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityError {
    /// `sizeof(AsperityError)`.
    pub size: u32,
    /// Place of the parameter that is wrong; -1 (as it comes) for the node as a whole.
    pub param: i32,
    /// Bytes at `message`, the zero included.
    pub message_capacity: u32,
    /// Bytes at `help`, the zero included.
    pub help_capacity: u32,
    /// What was found, in one sentence.
    pub message: *mut c_char,
    /// What would fit.
    pub help: *mut c_char,
}

/// What a prepared instance says of itself. Times are exact: `num / den` seconds; a `den` of 0 means none.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityInfo {
    /// `sizeof(AsperityInfo)`.
    pub size: u32,
    /// 1 (as it comes) where `process` does not allocate; a node that cannot keep that rule sets 0.
    pub allocation_free: u32,
    /// Latency from inputs to outputs, signed: a node that emits ahead of its input's time is early.
    pub latency_num: i64,
    /// Denominator of the latency.
    pub latency_den: i64,
    /// How long the outputs go on once the inputs are silent.
    pub tail_num: i64,
    /// Denominator of the tail.
    pub tail_den: i64,
    /// Sources only: how long there is something to play.
    pub duration_num: i64,
    /// Denominator of the duration.
    pub duration_den: i64,
}

/// Flag of a buffer: a wire ends (or begins) there.
pub const ASPERITY_CONNECTED: u32 = 1;
/// Flag of a buffer: the value is to be trusted; a node before did not fail.
pub const ASPERITY_VALID: u32 = 2;
/// Flag of a control input: the values are others than in the tick before.
pub const ASPERITY_CHANGED: u32 = 4;
/// Flag of an audio input: known to be zero in all samples.
pub const ASPERITY_SILENT: u32 = 8;
/// Flag of a frame buffer: there is a frame. A node that puts a frame out sets it, and `frame_index` and
/// `frame_start`.
pub const ASPERITY_FRAME: u32 = 16;
/// Flag of an audio output: the node wrote samples. Without it the output is silent.
pub const ASPERITY_WRITTEN: u32 = 32;

/// What one port holds in a tick. Arrays of these advance by [`AsperityTick::buffer_size`].
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityBuffer {
    /// What it carries: `ASPERITY_CONTROL` and so on; 0 for an input that nothing settles.
    pub carries: u32,
    /// `ASPERITY_CONNECTED` and so on.
    pub flags: u32,
    /// Values of a control; samples of this tick, which may be 0; bins of a frame.
    pub count: u32,
    /// 0.
    pub reserved: u32,
    /// Number of the frame.
    pub frame_index: u64,
    /// First sample of the frame, at the layout's rate.
    pub frame_start: u64,
    /// `count` values: `double` for a control, `float` for audio and magnitudes, pairs of `float` for a
    /// spectrum. Inputs are not to be written to. NULL where `count` is 0.
    pub data: *mut c_void,
}

/// One call of a node.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityTick {
    /// `sizeof(AsperityTick)`.
    pub size: u32,
    /// `sizeof(AsperityBuffer)` of the host.
    pub buffer_size: u32,
    /// The tick's number, from 0. Tick k begins at sample floor(k rate / tick_hz) of every rate.
    pub index: u64,
    /// Ticks a second.
    pub tick_hz: u32,
    /// Number of inputs.
    pub input_count: u32,
    /// Number of outputs.
    pub output_count: u32,
    /// 0.
    pub reserved: u32,
    /// Inputs, in the descriptor's order.
    pub inputs: *const AsperityBuffer,
    /// Outputs, in the descriptor's order.
    pub outputs: *mut AsperityBuffer,
    /// For the node to set: ticks of [`ASPERITY_TAIL`], or the number of [`ASPERITY_FAILED`].
    pub detail: u64,
}
