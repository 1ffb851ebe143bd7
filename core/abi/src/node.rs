//! Arguments and results of an instance's functions.

use std::ffi::{c_char, c_void};

use crate::AsperitySlot;

/// Success. (`prepare`, `ports`, `reset`, `absorb`, `elapsed`, `set_parameter`, `restore`)
pub const ASPERITY_OK: i32 = 0;
/// Failure. For `process` its number is in [`AsperityTick::detail`].
pub const ASPERITY_FAILED: i32 = -1;
/// A panic or an exception was caught on the plugin's side.
pub const ASPERITY_PANICKED: i32 = -2;

/// Result of `process`: the node has more output.
pub const ASPERITY_CONTINUE: i32 = 0;
/// Result of `process`: the outputs of this tick are silent; call again.
pub const ASPERITY_QUIET: i32 = 1;
/// Result of `process`: so many more ticks until silence, in [`AsperityTick::detail`], unless an input
/// wakes the node.
pub const ASPERITY_TAIL: i32 = 2;
/// Result of `process`: no output until an input that wakes carries something.
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
    /// Whole number, flag (0 or 1), or index of a choice's word.
    pub integer: i64,
    /// Text, word of a choice or path of a file; never NULL.
    pub text: *const c_char,
    /// Folder of a relative path in `text`; never NULL, empty for the current folder. Paths of files
    /// are ready to be opened.
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

/// Connection of one port. Arrays of these advance by the first one's `size`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityWire {
    /// `sizeof(AsperityWire)`.
    pub size: u32,
    /// 1 if a wire ends (or begins) there.
    pub connected: u32,
    /// Content of a tick: `ASPERITY_CONTROL` and so on; 0 for an unconnected port whose type nothing
    /// determines.
    pub carries: u32,
    /// `ASPERITY_LIMITED`.
    pub flags: u32,
    /// Control: number of values.
    pub count: u32,
    /// Audio: samples a second. Frames: samples a second of the analysed signal.
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

/// Configuration of an instance.
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
    /// Seed of this node.
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
    /// 1 if this node closes a cycle: then `process` runs before its inputs are ready, and `absorb`
    /// after.
    pub closes_cycle: u32,
    /// Slots of an effect, in the order of its list. Since 1.1.
    pub slots: *const AsperitySlot,
    /// Number of slots. Since 1.1.
    pub slot_count: u32,
    /// 0.
    pub reserved: u32,
}

/// Error of `prepare` or `ports`. Both texts are the host's memory, empty at first; longer ones are
/// cut.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityError {
    /// `sizeof(AsperityError)`.
    pub size: u32,
    /// Index of the wrong parameter; -1 (the initial value) for the node as a whole.
    pub param: i32,
    /// Bytes at `message`, including the zero.
    pub message_capacity: u32,
    /// Bytes at `help`, including the zero.
    pub help_capacity: u32,
    /// The problem, in one sentence.
    pub message: *mut c_char,
    /// Suggested fix.
    pub help: *mut c_char,
}

/// Properties of a prepared instance. Times are exact: `num / den` seconds; a `den` of 0 means none.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityInfo {
    /// `sizeof(AsperityInfo)`.
    pub size: u32,
    /// 1 (the initial value) if `process` does not allocate; a node that allocates sets 0.
    pub allocation_free: u32,
    /// Latency from inputs to outputs, signed; negative is early.
    pub latency_num: i64,
    /// Denominator of the latency.
    pub latency_den: i64,
    /// Duration of the outputs after the inputs become silent.
    pub tail_num: i64,
    /// Denominator of the tail.
    pub tail_den: i64,
    /// Sources only: duration of the output.
    pub duration_num: i64,
    /// Denominator of the duration.
    pub duration_den: i64,
}

/// Flag of a buffer: a wire ends (or begins) there.
pub const ASPERITY_CONNECTED: u32 = 1;
/// Flag of a buffer: the content is valid; no node before it failed.
pub const ASPERITY_VALID: u32 = 2;
/// Flag of a control input: the values differ from the tick before.
pub const ASPERITY_CHANGED: u32 = 4;
/// Flag of an audio input: known to be zero in all samples.
pub const ASPERITY_SILENT: u32 = 8;
/// Flag of a frame buffer: there is a frame. A node that outputs a frame sets it, and `frame_index` and
/// `frame_start`.
pub const ASPERITY_FRAME: u32 = 16;
/// Flag of an audio output: the node wrote samples. Without it the output is silent.
pub const ASPERITY_WRITTEN: u32 = 32;

/// Content of one port in a tick. Arrays of these advance by [`AsperityTick::buffer_size`].
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityBuffer {
    /// Type of the content: `ASPERITY_CONTROL` and so on; 0 for an input whose type nothing determines.
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
    /// spectrum. Do not write to inputs. NULL if `count` is 0.
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
