/*
 * Asperity's plugin interface, for C and C++. Generated from the crate asperity-abi: do not edit.
 *
 * A plugin is a shared library that exports one symbol:
 *
 *     ASPERITY_EXPORT const AsperityEntry asperity_entry = {
 *         ASPERITY_MAGIC, sizeof(AsperityEntry), ASPERITY_MAJOR, ASPERITY_MINOR, open_plugin,
 *     };
 *
 * Every struct that may grow begins with its own size; members are only ever added at the end. "Control thread" functions
 * may allocate, lock and read files. "Tick thread" functions run in real time and may do none of that. No two functions
 * of one instance are called at once. Texts are UTF-8 and end with a zero byte. Nothing may be thrown across a call.
 */

#ifndef ASPERITY_PLUGIN_H
#define ASPERITY_PLUGIN_H

#include <stddef.h>
#include <stdint.h>
#ifdef _WIN32
#define ASPERITY_VISIBLE __declspec(dllexport)
#else
#define ASPERITY_VISIBLE __attribute__((visibility("default")))
#endif
// What stands before a plugin's one exported symbol.
#ifdef __cplusplus
#define ASPERITY_EXPORT extern "C" ASPERITY_VISIBLE
#else
#define ASPERITY_EXPORT ASPERITY_VISIBLE
#endif

// Names of extensions.
#define ASPERITY_EXTENSION_RANDOM "asperity.random/1"
#define ASPERITY_EXTENSION_FACTS "asperity.facts/1"
#define ASPERITY_EXTENSION_EFFECT "asperity.effect/1"

// The element `i` of an array of structs that may grow: a newer host's are longer.
#define ASPERITY_AT(type, first, i) ((const type *)((const char *)(first) + (size_t)(i) * (first)->size))


// The first eight bytes of `AsperityEntry`: `ASPERITY` in ASCII, read as a little-endian number.
#define ASPERITY_MAGIC 6436850385118319425

// Major version: a host refuses plugins of another one.
#define ASPERITY_MAJOR 1

// Minor version: additions to the major one.
#define ASPERITY_MINOR 1

// Acts while a wall is touched. A wall is a surface with a stiffness.
#define ASPERITY_TOUCHING 1

// Acts while a wall is touched, and inside of a volume, a surface without a stiffness.
#define ASPERITY_INSIDE 2

// Acts from both sides of a surface, as far as the field `reach_mm` says.
#define ASPERITY_NEAR 3

// Acts while a stylus glides over a wall: a texture.
#define ASPERITY_GLIDING 4

// The force acts along the surface's normal.
#define ASPERITY_NORMAL 1

// The force acts along the surface.
#define ASPERITY_SURFACE 2

// The force acts against any motion.
#define ASPERITY_ANY 3

// A port with the type of all ports with its `shape_var`. Not for a single port.
#define ASPERITY_LIKE 1

// `count` values (f64), held between ticks.
#define ASPERITY_CONTROL 2

// This tick's samples (f32) of one channel.
#define ASPERITY_AUDIO 3

// At most one frame of magnitudes (f32) a tick, as amplitudes: 2 |sum w x| / sum w with a periodic Hann
// window w.
#define ASPERITY_MAGNITUDE 4

// At most one frame of complex bins (pairs of f32: real, imaginary) a tick, in the same scale; phases
// are counted from the first sample of the frame.
#define ASPERITY_SPECTRUM 5

// The node is reset when it wakes.
#define ASPERITY_RESTART 0

// `elapsed` tells the node how many ticks it slept.
#define ASPERITY_ELAPSED 1

// The node continues as it was: its output depends on the tick and its inputs, not on the number of
// calls.
#define ASPERITY_RESUME 2

// The node never sleeps, because its state must stay up to date.
#define ASPERITY_NEVER 3

// Flag of a kind: a sink. Nodes that reach no sink are not built.
#define ASPERITY_SINK 1

// Flag of a kind: a sink that only observes and keeps nothing awake.
#define ASPERITY_PASSIVE 2

// Flag of an input: may stay unconnected. A control then reads `default_value`, audio is silent, no
// frame comes.
#define ASPERITY_OPTIONAL 1

// Flag of a control input: a change wakes a sleeping node. Audio and frames always do.
#define ASPERITY_WAKES 2

// Flag of an input: accepts only a limited signal, which comes from the built-in limiter. No output of
// a plugin may have it.
#define ASPERITY_LIMITED 4

// A finite number between `min` and `max`, in `default_number`.
#define ASPERITY_NUMBER 1

// A whole number between `integer_min` and `integer_max`, in `default_integer`.
#define ASPERITY_INTEGER 2

// 0 or 1, in `default_integer`.
#define ASPERITY_FLAG 3

// Any text, in `default_text`.
#define ASPERITY_TEXT 4

// One of `words`; `default_text`, or the first if that is NULL.
#define ASPERITY_CHOICE 5

// A file that must exist; never has a default. The node gets a path that it can open.
#define ASPERITY_FILE 6

// A list of numbers, each between `min` and `max`; `default_count` of them in `default_numbers`.
#define ASPERITY_NUMBERS 7

// A list of texts, empty by default.
#define ASPERITY_TEXTS 8

// Flag of a parameter: has no default, and a graph must set it.
#define ASPERITY_REQUIRED 1

// Flag of a parameter: has no default, and a graph may leave it out; it then has no value.
#define ASPERITY_MAY_BE_LEFT_OUT 2

// Flag of a parameter: `set_parameter` takes a new value while the node runs. Numbers, whole numbers,
// flags and choices only.
#define ASPERITY_LIVE 4

// Success. (`prepare`, `ports`, `reset`, `absorb`, `elapsed`, `set_parameter`, `restore`)
#define ASPERITY_OK 0

// Failure. For `process` its number is in `AsperityTick::detail`.
#define ASPERITY_FAILED -1

// A panic or an exception was caught on the plugin's side.
#define ASPERITY_PANICKED -2

// Result of `process`: the node has more output.
#define ASPERITY_CONTINUE 0

// Result of `process`: the outputs of this tick are silent; call again.
#define ASPERITY_QUIET 1

// Result of `process`: so many more ticks until silence, in `AsperityTick::detail`, unless an input
// wakes the node.
#define ASPERITY_TAIL 2

// Result of `process`: no output until an input that wakes carries something.
#define ASPERITY_ASLEEP 3

// Flag of a buffer: a wire ends (or begins) there.
#define ASPERITY_CONNECTED 1

// Flag of a buffer: the content is valid; no node before it failed.
#define ASPERITY_VALID 2

// Flag of a control input: the values differ from the tick before.
#define ASPERITY_CHANGED 4

// Flag of an audio input: known to be zero in all samples.
#define ASPERITY_SILENT 8

// Flag of a frame buffer: there is a frame. A node that outputs a frame sets it, and `frame_index` and
// `frame_start`.
#define ASPERITY_FRAME 16

// Flag of an audio output: the node wrote samples. Without it the output is silent.
#define ASPERITY_WRITTEN 32

// An input or output. Arrays of these advance by the first one's `size`.
typedef struct AsperityPort {
    // `sizeof(AsperityPort)`.
    uint32_t size;
    // Content of a tick: `ASPERITY_CONTROL` and so on.
    uint32_t carries;
    // Name in a graph file: lower case, words joined by `_`.
    const char *name;
    // Meaning, in a few words.
    const char *doc;
    // Symbol of the unit, such as `mm/s`; `1` for none. NULL if `unit_var` is set.
    const char *unit;
    // A letter: any unit, the same for every port with this letter. 0 for none.
    uint32_t unit_var;
    // A letter: any rate (audio) or layout (frames), the same for every port with this letter. 0 for none.
    uint32_t shape_var;
    // The units that `unit_var` may be, ending with NULL; NULL for any.
    const char *const *units;
    // Control: number of values.
    uint32_t count;
    // Audio without `shape_var`: samples a second, 0 for the graph's audio rate. Frames without
    // `shape_var`: samples a second of the signal they describe.
    uint32_t rate_hz;
    // Frames without `shape_var`: window and DFT length in samples.
    uint32_t length;
    // Frames without `shape_var`: number of bins, from bin 0 on.
    uint32_t bins;
    // Frames without `shape_var`: frames a second, numerator.
    uint32_t frame_num;
    // Frames without `shape_var`: frames a second, denominator.
    uint32_t frame_den;
    // `ASPERITY_OPTIONAL`, `ASPERITY_WAKES`, `ASPERITY_LIMITED`.
    uint32_t flags;
    // 0.
    uint32_t reserved;
    // Value of an unconnected control.
    double default_value;
} AsperityPort;

// A parameter. Arrays of these advance by the first one's `size`.
typedef struct AsperityParam {
    // `sizeof(AsperityParam)`.
    uint32_t size;
    // Type of the value: `ASPERITY_NUMBER` and so on.
    uint32_t holds;
    // Name in a graph file: lower case, words joined by `_`.
    const char *name;
    // Meaning and effect, in a sentence.
    const char *doc;
    // Symbol of the unit of a number; NULL for none.
    const char *unit;
    // `ASPERITY_REQUIRED`, `ASPERITY_MAY_BE_LEFT_OUT`, `ASPERITY_LIVE`.
    uint32_t flags;
    // Number of `default_numbers`.
    uint32_t default_count;
    // Least number.
    double min;
    // Greatest number.
    double max;
    // Least whole number.
    int64_t integer_min;
    // Greatest whole number.
    int64_t integer_max;
    // Default of a number.
    double default_number;
    // Default of a whole number or flag.
    int64_t default_integer;
    // Default of a text or choice; NULL for the empty text or the first word.
    const char *default_text;
    // The words of a choice, ending with NULL.
    const char *const *words;
    // Default of a list of numbers.
    const double *default_numbers;
} AsperityParam;

// The value of a parameter. Arrays of these advance by the first one's `size`.
typedef struct AsperityValue {
    // `sizeof(AsperityValue)`.
    uint32_t size;
    // 0: it has no value; 1: its default; 2: the graph sets it.
    uint32_t set;
    // Number or whole number.
    double number;
    // Whole number, flag (0 or 1), or index of a choice's word.
    int64_t integer;
    // Text, word of a choice or path of a file; never NULL.
    const char *text;
    // Folder of a relative path in `text`; never NULL, empty for the current folder. Paths of files
    // are ready to be opened.
    const char *base;
    // Numbers of a list, `count` of them.
    const double *numbers;
    // Texts of a list, `count` of them.
    const char *const *texts;
    // Length of a list.
    uint32_t count;
    // 0.
    uint32_t reserved;
} AsperityValue;

// Connection of one port. Arrays of these advance by the first one's `size`.
typedef struct AsperityWire {
    // `sizeof(AsperityWire)`.
    uint32_t size;
    // 1 if a wire ends (or begins) there.
    uint32_t connected;
    // Content of a tick: `ASPERITY_CONTROL` and so on; 0 for an unconnected port whose type nothing
    // determines.
    uint32_t carries;
    // `ASPERITY_LIMITED`.
    uint32_t flags;
    // Control: number of values.
    uint32_t count;
    // Audio: samples a second. Frames: samples a second of the analysed signal.
    uint32_t rate_hz;
    // Frames: window and DFT length in samples.
    uint32_t length;
    // Frames: number of bins, from bin 0 on; at most length / 2 + 1.
    uint32_t bins;
    // Frames: frames a second, numerator. Frame n starts at sample floor(n rate_hz frame_den / frame_num).
    uint32_t frame_num;
    // Frames: frames a second, denominator.
    uint32_t frame_den;
    // Symbol of the unit; never NULL.
    const char *unit;
} AsperityWire;

// Settings of an effect. Arrays of these advance by the first one's `size`.
typedef struct AsperitySettings {
    // `sizeof(AsperitySettings)`.
    uint32_t size;
    // Index of the form.
    uint32_t form;
    // Values of the form's fields, in its order.
    const struct AsperityValue *values;
    // Number of values.
    uint32_t value_count;
    // 0.
    uint32_t reserved;
} AsperitySettings;

// A slot of an effect. Arrays of these advance by the first one's `size`.
typedef struct AsperitySlot {
    // `sizeof(AsperitySlot)`.
    uint32_t size;
    // Number of settings: 1, or more for a texture of several parts.
    uint32_t count;
    // Settings.
    const struct AsperitySettings *settings;
} AsperitySlot;

// Configuration of an instance.
typedef struct AsperitySetup {
    // `sizeof(AsperitySetup)`.
    uint32_t size;
    // Ticks a second.
    uint32_t tick_hz;
    // The node runs every `every`-th tick.
    uint32_t every;
    // The graph's audio rate in Hz.
    uint32_t audio_hz;
    // Seed of this node.
    uint64_t seed;
    // The node's name in the graph.
    const char *id;
    // Values of the parameters, in the descriptor's order.
    const struct AsperityValue *params;
    // Inputs, in the descriptor's order.
    const struct AsperityWire *inputs;
    // Outputs, in the descriptor's order.
    const struct AsperityWire *outputs;
    // Number of parameters.
    uint32_t param_count;
    // Number of inputs.
    uint32_t input_count;
    // Number of outputs.
    uint32_t output_count;
    // 1 if this node closes a cycle: then `process` runs before its inputs are ready, and `absorb`
    // after.
    uint32_t closes_cycle;
    // Slots of an effect, in the order of its list. Since 1.1.
    const struct AsperitySlot *slots;
    // Number of slots. Since 1.1.
    uint32_t slot_count;
    // 0.
    uint32_t reserved;
} AsperitySetup;

// Receives ports from `AsperityKind::ports`. Valid during that call.
typedef struct AsperityPortSink {
    // `sizeof(AsperityPortSink)`.
    uint32_t size;
    // 0.
    uint32_t reserved;
    // The first argument of the functions below.
    void *context;
    // Adds an input, and copies the data of `port`. Call it only during that call, on its thread.
    void (*input)(void *context, const struct AsperityPort *port);
    // Adds an output, and copies the data of `port`. Call it only during that call, on its thread.
    void (*output)(void *context, const struct AsperityPort *port);
} AsperityPortSink;

// Error of `prepare` or `ports`. Both texts are the host's memory, empty at first; longer ones are
// cut.
typedef struct AsperityError {
    // `sizeof(AsperityError)`.
    uint32_t size;
    // Index of the wrong parameter; -1 (the initial value) for the node as a whole.
    int32_t param;
    // Bytes at `message`, including the zero.
    uint32_t message_capacity;
    // Bytes at `help`, including the zero.
    uint32_t help_capacity;
    // The problem, in one sentence.
    char *message;
    // Suggested fix.
    char *help;
} AsperityError;

// Properties of a prepared instance. Times are exact: `num / den` seconds; a `den` of 0 means none.
typedef struct AsperityInfo {
    // `sizeof(AsperityInfo)`.
    uint32_t size;
    // 1 (the initial value) if `process` does not allocate; a node that allocates sets 0.
    uint32_t allocation_free;
    // Latency from inputs to outputs, signed; negative is early.
    int64_t latency_num;
    // Denominator of the latency.
    int64_t latency_den;
    // Duration of the outputs after the inputs become silent.
    int64_t tail_num;
    // Denominator of the tail.
    int64_t tail_den;
    // Sources only: duration of the output.
    int64_t duration_num;
    // Denominator of the duration.
    int64_t duration_den;
} AsperityInfo;

// Content of one port in a tick. Arrays of these advance by `AsperityTick::buffer_size`.
typedef struct AsperityBuffer {
    // Type of the content: `ASPERITY_CONTROL` and so on; 0 for an input whose type nothing determines.
    uint32_t carries;
    // `ASPERITY_CONNECTED` and so on.
    uint32_t flags;
    // Values of a control; samples of this tick, which may be 0; bins of a frame.
    uint32_t count;
    // 0.
    uint32_t reserved;
    // Number of the frame.
    uint64_t frame_index;
    // First sample of the frame, at the layout's rate.
    uint64_t frame_start;
    // `count` values: `double` for a control, `float` for audio and magnitudes, pairs of `float` for a
    // spectrum. Do not write to inputs. NULL if `count` is 0.
    void *data;
} AsperityBuffer;

// One call of a node.
typedef struct AsperityTick {
    // `sizeof(AsperityTick)`.
    uint32_t size;
    // `sizeof(AsperityBuffer)` of the host.
    uint32_t buffer_size;
    // The tick's number, from 0. Tick k begins at sample floor(k rate / tick_hz) of every rate.
    uint64_t index;
    // Ticks a second.
    uint32_t tick_hz;
    // Number of inputs.
    uint32_t input_count;
    // Number of outputs.
    uint32_t output_count;
    // 0.
    uint32_t reserved;
    // Inputs, in the descriptor's order.
    const struct AsperityBuffer *inputs;
    // Outputs, in the descriptor's order.
    struct AsperityBuffer *outputs;
    // For the node to set: ticks of `ASPERITY_TAIL`, or the number of `ASPERITY_FAILED`.
    uint64_t detail;
} AsperityTick;

// A kind of node.
//
// The life of an instance: `create`, `prepare` once, then any number of the tick functions, `destroy`.
// Functions that are marked optional may be NULL.
typedef struct AsperityKind {
    // `sizeof(AsperityKind)`.
    uint32_t size;
    // `ASPERITY_SINK`, `ASPERITY_PASSIVE`.
    uint32_t flags;
    // Behaviour on waking: `ASPERITY_RESTART` and so on.
    uint32_t resume;
    // Number of inputs.
    uint32_t input_count;
    // Number of outputs.
    uint32_t output_count;
    // Number of parameters.
    uint32_t param_count;
    // Name in a graph file: lower case, words joined by `_`; no other kind may have it.
    const char *kind;
    // Purpose, in a sentence that ends with a full stop.
    const char *summary;
    // Notes on latency and tail; NULL if both are 0.
    const char *timing;
    // Inputs. If they depend on parameters, those for the defaults.
    const struct AsperityPort *inputs;
    // Outputs. If they depend on parameters, those for the defaults.
    const struct AsperityPort *outputs;
    // Parameters.
    const struct AsperityParam *params;
    // Name of the input that this node gates, with `wants`; NULL for none.
    const char *gate;
    // Name of the parameter with the node's delay, for a node that can close a cycle, with `absorb`;
    // NULL for one that cannot.
    const char *feedback;
    // Reports the ports for these parameters; `inputs` and `outputs` of `setup` are empty. Optional:
    // the ports above. `ASPERITY_OK`, or `ASPERITY_FAILED` with `error` filled in. Control thread.
    int32_t (*ports)(const struct AsperitySetup *setup,
                     const struct AsperityPortSink *sink,
                     struct AsperityError *error);
    // Makes an instance that `prepare` fills; NULL on failure. `kind` is the pointer from the plugin.
    // Control thread.
    void *(*create)(const struct AsperityKind *kind);
    // Prepares the instance for its place in a graph: allocates, reads files, and may fail with
    // `error` filled in. Called once, before all functions below. After a failure only `destroy`
    // follows. Control thread.
    int32_t (*prepare)(void *instance, const struct AsperitySetup *setup, struct AsperityError *error);
    // Writes latency, tail and the like of a prepared instance. Optional. Control thread.
    void (*info)(void *instance, struct AsperityInfo *info);
    // Runs one tick: `ASPERITY_CONTINUE` and so on. At the start audio outputs are zero, frames are
    // absent, and controls hold their values. Tick thread.
    int32_t (*process)(void *instance, struct AsperityTick *tick);
    // Restores the state after `prepare`, with the current parameters. Tick thread.
    int32_t (*reset)(void *instance);
    // Gates only: 1 if the gated input is wanted this tick, else 0; or an error. Called once a tick,
    // before `process`, when all inputs but the gated one are ready, and without outputs. Tick thread.
    int32_t (*wants)(void *instance, struct AsperityTick *tick);
    // Nodes that close a cycle only: takes this tick's inputs, after `process` has run without them.
    // Tick thread.
    int32_t (*absorb)(void *instance, struct AsperityTick *tick);
    // Required with `ASPERITY_ELAPSED`, else unused: tells how many ticks the node slept. Its state
    // must become that of as many calls. Tick thread.
    int32_t (*elapsed)(void *instance, uint64_t ticks);
    // Sets the live parameter at `index` to a value in its range. A flag is 0 or 1, a choice the index
    // of its word. Optional if no parameter is live. Tick thread.
    int32_t (*set_parameter)(void *instance, uint32_t index, double value);
    // Most bytes that `save` writes, always the same. Optional together with `save` and `restore`.
    // Control thread.
    uint64_t (*state_size)(void *instance);
    // Writes the instance's state to `bytes`, at most `capacity` of them, and returns its length; less
    // than 0 on failure. Tick thread.
    int64_t (*save)(void *instance, uint8_t *bytes, uint64_t capacity);
    // Continues from the state of an instance of this kind, perhaps with other parameters or from
    // another build of the plugin: check it. `ASPERITY_OK`, or `ASPERITY_FAILED`, and then the
    // host calls `reset`. Tick thread.
    int32_t (*restore)(void *instance, const uint8_t *bytes, uint64_t len);
    // Frees the instance. Control thread.
    void (*destroy)(void *instance);
} AsperityKind;

// Description of a plugin.
typedef struct AsperityPlugin {
    // `sizeof(AsperityPlugin)`.
    uint32_t size;
    // Number of node kinds.
    uint32_t kind_count;
    // The kinds, as an array of `kind_count` pointers.
    const struct AsperityKind *const *kinds;
    // The plugin's name.
    const char *name;
    // The plugin's version.
    const char *version;
    // Finds an extension of the plugin by name and revision, such as `asperity.facts/1`; NULL if there
    // is none. Any thread. The pointer itself may be NULL.
    const void *(*extension)(const char *name);
} AsperityPlugin;

// Description of the host.
typedef struct AsperityHost {
    // `sizeof(AsperityHost)`.
    uint32_t size;
    // The host's major version.
    uint16_t major;
    // The host's minor version.
    uint16_t minor;
    // The program's name.
    const char *name;
    // The program's version.
    const char *version;
    // Finds an extension of the host by name and revision, such as `asperity.random/1`; NULL if there
    // is none. Any thread.
    const void *(*extension)(const struct AsperityHost *host, const char *name);
} AsperityHost;

// The symbol `asperity_entry` that a plugin exports, as constant data.
//
// The host reads `magic`, `size` and `major` before it calls anything.
typedef struct AsperityEntry {
    // `ASPERITY_MAGIC`.
    uint64_t magic;
    // `sizeof(AsperityEntry)`.
    uint32_t size;
    // `ASPERITY_MAJOR` that the plugin was built with.
    uint16_t major;
    // `ASPERITY_MINOR` that the plugin was built with.
    uint16_t minor;
    // Returns the plugin's description, or NULL if this host does not suit it. Control thread; called
    // once, before anything else. `host` stays valid for the life of the process.
    const struct AsperityPlugin *(*open)(const struct AsperityHost *host);
} AsperityEntry;

// The host's extension `asperity.random/1`: random numbers by index, so that skipped work does not
// change later numbers.
typedef struct AsperityRandom {
    // `sizeof(AsperityRandom)`.
    uint32_t size;
    // 0.
    uint32_t reserved;
    // Uniform in [0, 1), a function of both arguments alone. Any thread.
    double (*uniform)(uint64_t seed, uint64_t index);
} AsperityRandom;

// Receives facts. Names are lower case, words joined by `_`. Valid during the call that gets it, on
// its thread.
typedef struct AsperityFactSink {
    // `sizeof(AsperityFactSink)`.
    uint32_t size;
    // 0.
    uint32_t reserved;
    // The first argument of the functions below.
    void *context;
    // A text.
    void (*text)(void *context, const char *name, const char *text);
    // A number in a unit; an empty unit for none.
    void (*number)(void *context, const char *name, double number, const char *unit);
    // A count.
    void (*count)(void *context, const char *name, uint64_t count);
} AsperityFactSink;

// The plugin's extension `asperity.facts/1`: facts about an instance, for reports.
typedef struct AsperityFacts {
    // `sizeof(AsperityFacts)`.
    uint32_t size;
    // 0.
    uint32_t reserved;
    // Reports every fact of a prepared instance of `kind` (the pointer from the plugin) to `sink`.
    // Control thread.
    void (*facts)(const struct AsperityKind *kind, void *instance, const struct AsperityFactSink *sink);
} AsperityFacts;

// One way to write the settings of an effect: `name(field: value, ...)`. Arrays of these advance by the
// first one's `size`.
typedef struct AsperityForm {
    // `sizeof(AsperityForm)`.
    uint32_t size;
    // Number of fields.
    uint32_t field_count;
    // The word before the parenthesis; empty for the only form of an effect.
    const char *name;
    // Fields.
    const struct AsperityParam *fields;
    // A text of this form, such as `(stiffness_n_per_mm: 0.2)`.
    const char *example;
} AsperityForm;

// A quantity of the contact that a scene connects to an input. Arrays of these advance by the first
// one's `size`.
typedef struct AsperityNeed {
    // `sizeof(AsperityNeed)`.
    uint32_t size;
    // 0.
    uint32_t reserved;
    // Name of the input.
    const char *input;
    // Name of the quantity: an output of the kind `contact` or `velocity`.
    const char *quantity;
} AsperityNeed;

// A linear law of force F = K x + B v along one direction, as it is near the place where it is steepest.
typedef struct AsperityLaw {
    // `sizeof(AsperityLaw)`.
    uint32_t size;
    // 0.
    uint32_t reserved;
    // Stiffness K in N/mm, at least 0.
    double stiffness_n_per_mm;
    // Damping B in N s/m, of either sign.
    double damping_ns_per_m;
} AsperityLaw;

// An effect. The node renders it for many surfaces. Surfaces with the same settings share a slot. The
// input `slot` picks one; 0 is the first. A value below 0, beyond the last or not a number picks none.
typedef struct AsperityEffect {
    // `sizeof(AsperityEffect)`.
    uint32_t size;
    // Where it acts: `ASPERITY_TOUCHING` and so on.
    uint32_t acts;
    // Name of the parameter (a list of texts) with the settings of each slot.
    const char *list;
    // Number of forms.
    uint32_t form_count;
    // Number of needs.
    uint32_t need_count;
    // Ways to write the settings; the first is the usual one.
    const struct AsperityForm *forms;
    // Quantities of the contact that a scene connects to inputs.
    const struct AsperityNeed *needs;
    // Direction of the force: `ASPERITY_NORMAL` and so on; 0 for an effect without `law`.
    uint32_t direction;
    // 0.
    uint32_t reserved;
    // Law of the force for some settings and a normal force in N. It tells a scene whether the device
    // bears the effect. NULL for an effect without a force. Control thread.
    int32_t (*law)(const struct AsperityKind *kind,
                   const struct AsperitySettings *settings,
                   double normal_force_n,
                   struct AsperityLaw *law);
    // Checks settings beyond the ranges of their fields. The index in `error` is that of a field.
    // Optional. Control thread.
    int32_t (*check)(const struct AsperityKind *kind,
                     const struct AsperitySettings *settings,
                     struct AsperityError *error);
} AsperityEffect;

// The plugin's extension `asperity.effect/1`: kinds that are effects of surfaces.
typedef struct AsperityEffects {
    // `sizeof(AsperityEffects)`.
    uint32_t size;
    // 0.
    uint32_t reserved;
    // The effect of a kind (the pointer from the plugin); NULL for a kind that is no effect. It stays valid
    // for the life of the process. Control thread.
    const struct AsperityEffect *(*effect)(const struct AsperityKind *kind);
} AsperityEffects;

#endif  /* ASPERITY_PLUGIN_H */
