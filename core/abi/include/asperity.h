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

#ifndef ASPERITY_H
#define ASPERITY_H

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


// The first eight bytes of `AsperityEntry`: `ASPERITY` in ASCII, read as a little-endian number.
#define ASPERITY_MAGIC 6436850385118319425

// Major version: a host refuses plugins of another one.
#define ASPERITY_MAJOR 1

// Minor version: what has been added to the major one.
#define ASPERITY_MINOR 0

// A port that carries whatever the other ports with its `shape_var` carry. Not for a port of its own.
#define ASPERITY_LIKE 1

// `count` values (f64), held between ticks.
#define ASPERITY_CONTROL 2

// This tick's samples (f32) of one channel.
#define ASPERITY_AUDIO 3

// At most one frame of magnitudes (f32) a tick, as amplitudes: 2 |sum w x| / sum w with a periodic Hann window w.
#define ASPERITY_MAGNITUDE 4

// At most one frame of complex bins (pairs of f32: real, imaginary) a tick, in the same scale; phases are counted from
// the first sample of the frame.
#define ASPERITY_SPECTRUM 5

// The node is reset when it wakes.
#define ASPERITY_RESTART 0

// The node is told by `elapsed` how many ticks it slept through.
#define ASPERITY_ELAPSED 1

// The node goes on as it was: what it puts out depends on the tick and its inputs, not on how often it was called.
#define ASPERITY_RESUME 2

// The node never sleeps: what it remembers must stay up to date.
#define ASPERITY_NEVER 3

// Flag of a kind: wanted for its own sake; what leads to no sink is not built.
#define ASPERITY_SINK 1

// Flag of a kind: a sink that only looks on and keeps nothing awake.
#define ASPERITY_PASSIVE 2

// Flag of an input: may stay unconnected. A control then reads `default_value`, audio is silent, no frame comes.
#define ASPERITY_OPTIONAL 1

// Flag of a control input: a change wakes a node that said it sleeps. Audio and frames always do.
#define ASPERITY_WAKES 2

// Flag of an input: takes only a limited signal, which the built-in limiter promises; no output of a plugin may.
#define ASPERITY_LIMITED 4

// A finite number between `min` and `max`, in `default_number`.
#define ASPERITY_NUMBER 1

// A whole number between `integer_min` and `integer_max`, in `default_integer`.
#define ASPERITY_INTEGER 2

// 0 or 1, in `default_integer`.
#define ASPERITY_FLAG 3

// Any text, in `default_text`.
#define ASPERITY_TEXT 4

// One of `words`; `default_text`, or the first where that is NULL.
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

// Flag of a parameter: `set_parameter` takes a new value while the node runs. Numbers, whole numbers, flags and choices only.
#define ASPERITY_LIVE 4

// All went well. (`prepare`, `ports`, `reset`, `absorb`, `elapsed`, `set_parameter`, `restore`)
#define ASPERITY_OK 0

// It failed. Of `process` the number that says how is in `AsperityTick::detail`.
#define ASPERITY_FAILED -1

// A panic or an exception was caught on the plugin's side.
#define ASPERITY_PANICKED -2

// Answer of `process`: more to come.
#define ASPERITY_CONTINUE 0

// Answer of `process`: the outputs of this tick are silent; call again.
#define ASPERITY_QUIET 1

// Answer of `process`: so many more ticks until silence, in `AsperityTick::detail`, unless an input wakes the node.
#define ASPERITY_TAIL 2

// Answer of `process`: nothing to come until an input that wakes carries something.
#define ASPERITY_ASLEEP 3

// Flag of a buffer: a wire ends (or begins) there.
#define ASPERITY_CONNECTED 1

// Flag of a buffer: the value is to be trusted; a node before did not fail.
#define ASPERITY_VALID 2

// Flag of a control input: the values are others than in the tick before.
#define ASPERITY_CHANGED 4

// Flag of an audio input: known to be zero in all samples.
#define ASPERITY_SILENT 8

// Flag of a frame buffer: there is a frame. A node that puts a frame out sets it, and `frame_index` and `frame_start`.
#define ASPERITY_FRAME 16

// Flag of an audio output: the node wrote samples. Without it the output is silent.
#define ASPERITY_WRITTEN 32

// An input or output. Arrays of these advance by the first one's `size`.
typedef struct AsperityPort {
    // `sizeof(AsperityPort)`.
    uint32_t size;
    // What a tick carries: `ASPERITY_CONTROL` and so on.
    uint32_t carries;
    // Name in a graph file: lower case, words joined by `_`.
    const char *name;
    // What it is, in a few words.
    const char *doc;
    // Symbol of the unit, such as `mm/s`; `1` for none. NULL where `unit_var` is set.
    const char *unit;
    // A letter: any unit, the same for every port with this letter. 0 for none.
    uint32_t unit_var;
    // A letter: any rate (audio) or layout (frames), the same for every port with this letter. 0 for none.
    uint32_t shape_var;
    // The units that `unit_var` may be, ending with NULL; NULL for any.
    const char *const *units;
    // Control: number of values.
    uint32_t count;
    // Audio without `shape_var`: samples a second, 0 for the graph's audio rate. Frames without `shape_var`: samples a second of
    // the signal they describe.
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
    // What an unconnected control reads.
    double default_value;
} AsperityPort;

// A parameter. Arrays of these advance by the first one's `size`.
typedef struct AsperityParam {
    // `sizeof(AsperityParam)`.
    uint32_t size;
    // What it may be: `ASPERITY_NUMBER` and so on.
    uint32_t holds;
    // Name in a graph file: lower case, words joined by `_`.
    const char *name;
    // What it is and what it does, in a sentence.
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
    // Whole number, flag (0 or 1), or the place of a choice's word.
    int64_t integer;
    // Text, word of a choice or path of a file; never NULL.
    const char *text;
    // The folder that a relative path in `text` is relative to; never NULL, empty for the one the program runs in. Paths of files
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

// How one port is connected. Arrays of these advance by the first one's `size`.
typedef struct AsperityWire {
    // `sizeof(AsperityWire)`.
    uint32_t size;
    // 1 where a wire ends (or begins) there.
    uint32_t connected;
    // What it carries: `ASPERITY_CONTROL` and so on; 0 for an unconnected port whose type nothing settles.
    uint32_t carries;
    // `ASPERITY_LIMITED`.
    uint32_t flags;
    // Control: number of values.
    uint32_t count;
    // Audio: samples a second. Frames: samples a second of the signal they describe.
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

// What an instance is prepared for.
typedef struct AsperitySetup {
    // `sizeof(AsperitySetup)`.
    uint32_t size;
    // Ticks a second.
    uint32_t tick_hz;
    // The node runs every `every`-th tick.
    uint32_t every;
    // The graph's audio rate in Hz.
    uint32_t audio_hz;
    // A seed of the node's own.
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
    // 1 where this node closes a cycle: `process` then runs before its inputs are there, and `absorb` when they are.
    uint32_t closes_cycle;
} AsperitySetup;

// Where `AsperityKind::ports` says which ports there are. Valid during that call.
typedef struct AsperityPortSink {
    // `sizeof(AsperityPortSink)`.
    uint32_t size;
    // 0.
    uint32_t reserved;
    // The first argument of the functions below.
    void *context;
    // Adds an input. What `port` points at is copied. To be called during that call only, on its thread.
    void (*input)(void *context, const struct AsperityPort *port);
    // Adds an output. What `port` points at is copied. To be called during that call only, on its thread.
    void (*output)(void *context, const struct AsperityPort *port);
} AsperityPortSink;

// Where `prepare` and `ports` say what is wrong. Both texts are the host's memory, empty at first; what is longer is cut off.
typedef struct AsperityError {
    // `sizeof(AsperityError)`.
    uint32_t size;
    // Place of the parameter that is wrong; -1 (as it comes) for the node as a whole.
    int32_t param;
    // Bytes at `message`, the zero included.
    uint32_t message_capacity;
    // Bytes at `help`, the zero included.
    uint32_t help_capacity;
    // What was found, in one sentence.
    char *message;
    // What would fit.
    char *help;
} AsperityError;

// What a prepared instance says of itself. Times are exact: `num / den` seconds; a `den` of 0 means none.
typedef struct AsperityInfo {
    // `sizeof(AsperityInfo)`.
    uint32_t size;
    // 1 (as it comes) where `process` does not allocate; a node that cannot keep that rule sets 0.
    uint32_t allocation_free;
    // Latency from inputs to outputs, signed: a node that emits ahead of its input's time is early.
    int64_t latency_num;
    // Denominator of the latency.
    int64_t latency_den;
    // How long the outputs go on once the inputs are silent.
    int64_t tail_num;
    // Denominator of the tail.
    int64_t tail_den;
    // Sources only: how long there is something to play.
    int64_t duration_num;
    // Denominator of the duration.
    int64_t duration_den;
} AsperityInfo;

// What one port holds in a tick. Arrays of these advance by `AsperityTick::buffer_size`.
typedef struct AsperityBuffer {
    // What it carries: `ASPERITY_CONTROL` and so on; 0 for an input that nothing settles.
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
    // `count` values: `double` for a control, `float` for audio and magnitudes, pairs of `float` for a spectrum. Inputs are
    // not to be written to. NULL where `count` is 0.
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
// The life of an instance: `create`, `prepare` once, then any number of the tick functions, `destroy`. Functions that are marked
// optional may be NULL.
typedef struct AsperityKind {
    // `sizeof(AsperityKind)`.
    uint32_t size;
    // `ASPERITY_SINK`, `ASPERITY_PASSIVE`.
    uint32_t flags;
    // How it wakes: `ASPERITY_RESTART` and so on.
    uint32_t resume;
    // Number of inputs.
    uint32_t input_count;
    // Number of outputs.
    uint32_t output_count;
    // Number of parameters.
    uint32_t param_count;
    // Name in a graph file: lower case, words joined by `_`; no other kind may have it.
    const char *kind;
    // What it does, in a sentence that ends with a full stop.
    const char *summary;
    // What there is to say of latency and tail; NULL where both are 0.
    const char *timing;
    // Inputs. Where they depend on parameters, these are the ones of the defaults.
    const struct AsperityPort *inputs;
    // Outputs. Where they depend on parameters, these are the ones of the defaults.
    const struct AsperityPort *outputs;
    // Parameters.
    const struct AsperityParam *params;
    // Name of the input that this node gates, with `wants`; NULL for none.
    const char *gate;
    // Name of the parameter that says how long it delays, for a node that can close a cycle, with `absorb`; NULL for
    // one that cannot.
    const char *feedback;
    // Says which ports there are for these parameters; `inputs` and `outputs` of `setup` are empty. Optional: the ports above.
    // `ASPERITY_OK`, or `ASPERITY_FAILED` with `error` filled in. Control thread.
    int32_t (*ports)(const struct AsperitySetup *setup,
                     const struct AsperityPortSink *sink,
                     struct AsperityError *error);
    // Makes an instance that `prepare` fills; NULL where it cannot. `kind` is the very pointer that the plugin handed out. Control
    // thread.
    void *(*create)(const struct AsperityKind *kind);
    // Makes the instance ready for its place in a graph: allocates, reads files, and may fail with `error` filled in. Called once,
    // before all below; if it fails only `destroy` follows. Control thread.
    int32_t (*prepare)(void *instance, const struct AsperitySetup *setup, struct AsperityError *error);
    // Says latency, tail and the like of a prepared instance. Optional: nothing to say. Control thread.
    void (*info)(void *instance, struct AsperityInfo *info);
    // One tick: `ASPERITY_CONTINUE` and so on. Outputs arrive zeroed (audio), absent (frames) or as they were
    // (controls). Tick thread.
    int32_t (*process)(void *instance, struct AsperityTick *tick);
    // Back to the state after `prepare`, but for parameters that were set since. Tick thread.
    int32_t (*reset)(void *instance);
    // Gates only: 1 where the gated input is wanted this tick, else 0; or an error. Called once a tick, before `process`, with
    // every input there but the gated one, and no outputs. Tick thread.
    int32_t (*wants)(void *instance, struct AsperityTick *tick);
    // Nodes that close a cycle only: takes this tick's inputs, after `process` has put out without them. Tick thread.
    int32_t (*absorb)(void *instance, struct AsperityTick *tick);
    // With `ASPERITY_ELAPSED` only, and then needed: how many ticks the node slept through. It leaves the state that as many calls
    // would have left. Tick thread.
    int32_t (*elapsed)(void *instance, uint64_t ticks);
    // Takes a new value of the parameter at `index`, which is live; it lies in its range. A flag is 0 or 1, a choice the place of
    // its word. Optional where no parameter is live. Tick thread.
    int32_t (*set_parameter)(void *instance, uint32_t index, double value);
    // The most bytes that `save` writes; the same at any time. Optional together with `save` and `restore`. Control thread.
    uint64_t (*state_size)(void *instance);
    // Writes what the instance remembers to `bytes`, at most `capacity` of them, and answers how many; less than 0 where it
    // cannot. Tick thread.
    int64_t (*save)(void *instance, uint8_t *bytes, uint64_t capacity);
    // Goes on from what an instance of this kind saved, perhaps with other parameters or by another build of the
    // plugin: check it. `ASPERITY_OK`, or `ASPERITY_FAILED`, and then the host calls `reset`. Tick thread.
    int32_t (*restore)(void *instance, const uint8_t *bytes, uint64_t len);
    // Frees the instance. Control thread.
    void (*destroy)(void *instance);
} AsperityKind;

// What a plugin offers.
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
    // Finds an extension of the plugin by name and revision, such as `asperity.facts/1`; NULL where it has none of that name.
    // Any thread. The pointer itself may be NULL.
    const void *(*extension)(const char *name);
} AsperityPlugin;

// What the host says of itself.
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
    // Finds an extension of the host by name and revision, such as `asperity.random/1`; NULL where it has none of that
    // name. Any thread.
    const void *(*extension)(const struct AsperityHost *host, const char *name);
} AsperityHost;

// What a plugin exports, as constant data under the name `asperity_entry`.
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
    // Answers what the plugin offers, or NULL where this host does not suit it. Control thread; called once, before
    // anything else. `host` stays valid for as long as the process lives.
    const struct AsperityPlugin *(*open)(const struct AsperityHost *host);
} AsperityEntry;

// The host's extension `asperity.random/1`: random numbers by index, so that skipped work does not change what follows.
typedef struct AsperityRandom {
    // `sizeof(AsperityRandom)`.
    uint32_t size;
    // 0.
    uint32_t reserved;
    // Uniform in [0, 1), a function of both arguments alone. Any thread.
    double (*uniform)(uint64_t seed, uint64_t index);
} AsperityRandom;

// Where facts are told. Names are lower case, words joined by `_`. Valid during the call it is handed to, on its thread.
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

// The plugin's extension `asperity.facts/1`: what an instance tells about itself in reports.
typedef struct AsperityFacts {
    // `sizeof(AsperityFacts)`.
    uint32_t size;
    // 0.
    uint32_t reserved;
    // Tells `sink` every fact of an instance of `kind` (the very pointer that the plugin handed out) that has been prepared.
    // Control thread.
    void (*facts)(const struct AsperityKind *kind, void *instance, const struct AsperityFactSink *sink);
} AsperityFacts;

#endif  /* ASPERITY_H */
