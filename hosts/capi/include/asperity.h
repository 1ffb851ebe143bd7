/*
 * Asperity from C and C++. Generated from the crate asperity-capi: do not edit. docs/c.md shows how to use it.
 *
 * Functions answer a status. Handles are opaque: a wrong or freed one is an error, never a crash. Every function
 * says which thread may call it, and whether it may block. Where one thread is allowed at a time, the call of
 * another is refused with ASPERITY_BUSY. Texts are UTF-8 and end with a zero byte.
 */

#ifndef ASPERITY_H
#define ASPERITY_H

#include <stddef.h>
#include <stdint.h>

// Version of the header, checked by `asperity_check_version`.
#define ASPERITY_VERSION_MAJOR 0

// Version of the header, checked by `asperity_check_version`.
#define ASPERITY_VERSION_MINOR 1

// Version of the header.
#define ASPERITY_VERSION_PATCH 0

// The stylus goes on as the graph says: by its own stroke, or that of `asperity_graph_stroke`.
#define ASPERITY_STROKE 0

// The caller moves the stylus.
#define ASPERITY_HAND 1

// Nothing was pulled so far, or the output fades in.
#define ASPERITY_STARTING 0

// The output is at its full level.
#define ASPERITY_PLAYING 1

// The output is muted. Ticks go on.
#define ASPERITY_MUTED 2

// The engine broke off, and the output is silent. Free the handle.
#define ASPERITY_BROKEN 3

// A graph at a tick. It has no clock and no device. The same graph, stroke and seed give the same samples,
// as the program `asperity render` gives them. One thread at a time.
typedef struct AsperityEngine AsperityEngine;

// A graph or scene with its settings. One thread at a time.
typedef struct AsperityGraph AsperityGraph;

// A run in real time. Four threads may use it at once, each for its own functions: one that pulls audio, one
// that pushes the stylus, one that renders forces, and one that controls the run.
typedef struct AsperityLive AsperityLive;

// Result of a function: one of the values below. `asperity_last_error` has the reason.
typedef int32_t AsperityStatus;

// Figures of a graph.
typedef struct AsperityGraphInfo {
    // Ticks a second, 100 to 4000.
    uint32_t tick_hz;
    // Samples a second of each channel.
    uint32_t audio_hz;
    // Channels of the output, at least 1. A graph without an output is silent on one.
    uint32_t channels;
    // Most frames (samples of each channel) of a tick.
    uint32_t tick_frames;
    // Duration of the stroke in ticks; 0 if nothing has a duration.
    uint64_t stroke_ticks;
    // Number from which all random numbers follow.
    uint64_t seed;
    // 1 if a stylus moves in the graph, else 0.
    uint32_t has_stylus;
    // 1 if a node pushes back, so that there are forces to read, else 0.
    uint32_t has_force;
} AsperityGraphInfo;

// The stylus.
typedef struct AsperityHand {
    // x, y, z in mm, finite; z points up.
    double position_mm[3];
    // Force with which the hand presses [N], finite; 0 if it is not measured.
    double force_n;
    // Number of the stroke. A new number means that the stylus was put down elsewhere: the way there is no
    // motion.
    uint32_t stroke;
} AsperityHand;

// The surface under the stylus: a plane with a spring and a damper, for the loop of a device that pushes
// back.
typedef struct AsperityForce {
    // A point of the plane [mm].
    double point_mm[3];
    // Outward normal of the plane: a unit vector, or all 0 for no surface.
    double normal[3];
    // Stiffness [N/mm], at least 0.
    double stiffness_n_per_mm;
    // Damping along the normal while in the plane [N s/m], at least 0.
    double damping_ns_per_m;
    // Force beside the plane [N]: friction, drag, pull.
    double beside_n[3];
    // Largest force [N] that the graph allows.
    double max_force_n;
    // Time of the tick by `asperity_now_ns` [ns]; 0 in an engine, which has no clock.
    uint64_t time_ns;
    // 1 if the values count. If it is 0, push with no force.
    uint32_t valid;
} AsperityForce;

// Figures of a run since its start. A frame is a sample of each channel.
typedef struct AsperityFigures {
    // ASPERITY_STARTING, ASPERITY_PLAYING, ASPERITY_MUTED or ASPERITY_BROKEN.
    uint32_t state;
    // 1 if no sample of the stylus came within its timeout, else 0. The position is held meanwhile.
    uint32_t hand_stalled;
    // Ticks so far.
    uint64_t ticks;
    // Ticks left out because pulls came too late.
    uint64_t skipped_ticks;
    // Ticks that ended more than a tick after they were due.
    uint64_t deadline_misses;
    // Frames that were never played.
    uint64_t lost_frames;
    // Gaps between pulls: the audio system lost time.
    uint64_t gaps;
    // Samples that the last limit before the device changed.
    uint64_t limited_samples;
    // Failures of nodes; `asperity_live_faults` names them.
    uint64_t faults;
    // Samples of the stylus so far.
    uint64_t hand_samples;
    // Largest sample since the last call of `asperity_live_figures`, of full scale 1.
    double peak;
    // Age of the newest sample of the stylus in the last tick [ms].
    double hand_age_ms;
    // Time by which ticks read the stylus in the past [ms].
    double hand_delay_ms;
    // Time between a tick's reading of the stylus and the pull of its first sample [ms].
    double lead_ms;
    // Time of a tick: the deadline [us].
    double deadline_us;
    // Computing time of a tick, 99th percentile [us].
    double tick_p99_us;
    // Longest computing time of a tick [us].
    double tick_max_us;
} AsperityFigures;

// Done.
#define ASPERITY_OK 0

// An argument, a handle or a file is wrong. Nothing changed. Do not try again with the same.
#define ASPERITY_INVALID 1

// Another thread is in a call with this handle, or a queue is full. Nothing changed. Try again later.
#define ASPERITY_BUSY 2

// The run broke off, or the machine refused. Free the handle.
#define ASPERITY_FAILED 3

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Version of the library, such as `0.1.0`.
//
// Any thread. Never blocks.
const char *asperity_version(void);

// Checks that a program that was built with this version of the header can use the library. Give it
// ASPERITY_VERSION_MAJOR and ASPERITY_VERSION_MINOR before all other calls. The major versions must be the
// same, and the library at least as new. Before 1.0, the minor versions must be the same too.
//
// Any thread. Never blocks.
AsperityStatus asperity_check_version(uint32_t major, uint32_t minor);

// Text of the last error of this thread: `file:line:column: error: ...`, the line with a caret, and help.
// Empty before the first error. It is valid until the next error of this thread. A call that succeeds leaves
// it as it is.
//
// Any thread. Never blocks.
const char *asperity_last_error(void);

// Opens a graph file or scene file. A path that begins with `graphs/` and does not exist names a file that
// ships with the library. `graph` gets the handle, or NULL.
//
// Any thread. Blocks: reads files, compiles, allocates.
//
// `path` ends with a zero byte, and `graph` may be written. Either may be NULL.
AsperityStatus asperity_graph_open(const char *path, struct AsperityGraph **graph);

// Reads a graph or scene from a text. `path` stands for its file in errors, and files that it names are
// relative to its folder; NULL for the working folder. `graph` gets the handle, or NULL.
//
// Any thread. Blocks: reads files, compiles, allocates.
//
// `text` and `path` end with a zero byte, and `graph` may be written. Each may be NULL.
AsperityStatus asperity_graph_parse(const char *text, const char *path, struct AsperityGraph **graph);

// Frees a graph. Engines and runs that were made of it go on. NULL is nothing to free.
//
// Any thread. Waits up to 2 s for a call of another thread with this handle.
AsperityStatus asperity_graph_free(struct AsperityGraph *graph);

// Sets a parameter, such as `texture.material` to `oak`, or `tick_hz`, `audio_hz`, `seed`. Engines and runs
// that were made of the graph stay as they are.
//
// One thread at a time. Blocks: compiles, allocates.
//
// `name` and `value` are NULL or end with a zero byte.
AsperityStatus asperity_graph_set(struct AsperityGraph *graph, const char *name, const char *value);

// Plays a recorded stroke in place of the graph's own: a CSV file with times in s and positions in mm.
//
// One thread at a time. Blocks: reads files, compiles, allocates.
//
// `path` is NULL or ends with a zero byte.
AsperityStatus asperity_graph_stroke(struct AsperityGraph *graph, const char *path);

// Makes a port readable in engines that are made later, such as `floor.force`: see `asperity_engine_read`.
//
// One thread at a time. Blocks: compiles, allocates.
//
// `port` is NULL or ends with a zero byte.
AsperityStatus asperity_graph_probe(struct AsperityGraph *graph, const char *port);

// Writes the figures of a graph.
//
// One thread at a time. Never blocks.
//
// `info` is NULL or may be written.
AsperityStatus asperity_graph_info(struct AsperityGraph *graph, struct AsperityGraphInfo *info);

// Warnings about a graph: settings that are probably mistakes. One a line; empty for none. NULL after an
// error. The text is valid until this thread asks for another text.
//
// One thread at a time. Allocates.
const char *asperity_graph_warnings(struct AsperityGraph *graph);

// Makes an engine at tick 0. `stylus` says who moves the stylus: ASPERITY_STROKE or ASPERITY_HAND. `engine`
// gets the handle, or NULL.
//
// One thread at a time. Blocks: compiles, allocates.
//
// `engine` is NULL or may be written.
AsperityStatus asperity_engine_new(struct AsperityGraph *graph,
                                   uint32_t stylus,
                                   struct AsperityEngine **engine);

// Frees an engine. NULL is nothing to free.
//
// Any thread. Waits up to 2 s for a call of another thread with this handle.
AsperityStatus asperity_engine_free(struct AsperityEngine *engine);

// Moves the stylus, runs one tick, and writes its samples: interleaved, full scale 1. NULL for `hand` leaves
// the stylus where it is, or to its stroke. `room` is the number of samples that `out` has room for, at
// least `tick_frames` times `channels` of `asperity_graph_info`. `frames` gets the frames of the tick; it
// may be NULL.
//
// One thread at a time. Never waits or allocates, if no node does.
//
// `hand` and `frames` are NULL or valid, and `out` has room for that many samples.
AsperityStatus asperity_engine_tick(struct AsperityEngine *engine,
                                    const struct AsperityHand *hand,
                                    float *out,
                                    size_t room,
                                    size_t *frames);

// Writes the surface of the last tick.
//
// One thread at a time. Never waits or allocates.
//
// `force` is NULL or may be written.
AsperityStatus asperity_engine_force(struct AsperityEngine *engine, struct AsperityForce *force);

// Writes the values of a port in the last tick: those of a control, the samples of a signal, the bins of a
// frame (real and imaginary part of complex ones). `count` gets their number, also if that is more than
// `room`; then the first ones are written. It is 0 in a tick without a frame. The port was named by
// `asperity_graph_probe`.
//
// One thread at a time. Allocates.
//
// `port` is NULL or ends with a zero byte, `values` has room for so many, and `count` may be written.
AsperityStatus asperity_engine_read(struct AsperityEngine *engine,
                                    const char *port,
                                    float *values,
                                    size_t room,
                                    size_t *count);

// Goes back to tick 0, as after `asperity_engine_new`.
//
// One thread at a time. Allocates.
AsperityStatus asperity_engine_reset(struct AsperityEngine *engine);

// Nodes that failed so far, one a line: how often, and how at last. Empty for none. NULL after an error. The
// text is valid until this thread asks for another text.
//
// One thread at a time. Allocates.
const char *asperity_engine_faults(struct AsperityEngine *engine);

// Time by the clock of this library [ns]: monotonic, from about the start of the program. Times of samples
// are by this clock.
//
// Any thread. Never blocks.
uint64_t asperity_now_ns(void);

// Makes a run of a graph. `stylus` says who moves the stylus: ASPERITY_STROKE or ASPERITY_HAND. Set
// `audio_hz` of the graph to the rate of your device before. `live` gets the handle, or NULL. Time begins
// with the first pull.
//
// The heat of the actuator's coil begins cold. Keep one run for a device, and swap its graphs.
//
// One thread at a time. Blocks: compiles, allocates.
//
// `live` is NULL or may be written.
AsperityStatus asperity_live_new(struct AsperityGraph *graph, uint32_t stylus, struct AsperityLive **live);

// Ramps the output down within 15 ms and ends the run. Pull meanwhile, until this returns: that plays the
// ramp. If nobody pulls, it returns within a second. NULL is nothing to free.
//
// Any thread but the one that pulls. Blocks.
AsperityStatus asperity_live_free(struct AsperityLive *live);

// Fills `out` with the next `frames` frames: interleaved, full scale 1. Any number of frames. `channels` is
// that of `asperity_graph_info`. Unless the result is ASPERITY_OK, `out` is silent.
//
// Call it as an audio device does, at its rate: the pulls are the clock of the run. A late pull counts as a
// gap. For blocks that are longer than a tick, the stylus is read one block ago.
//
// The audio thread: one at a time, with 128 KiB of stack. Never waits, locks, allocates or calls the system,
// except for reading the clock.
//
// `out` is NULL or has room for `frames` times `channels` samples.
AsperityStatus asperity_live_pull(struct AsperityLive *live, float *out, size_t frames, uint32_t channels);

// Gives a sample of the stylus. `time_ns` is when it was measured, by `asperity_now_ns`; 0 for now. Samples
// come in the order of their times. ASPERITY_BUSY means that this sample is lost: give the next one.
//
// The thread of the stylus: one at a time. Never waits, locks or allocates.
//
// `hand` is NULL or valid.
AsperityStatus asperity_live_push(struct AsperityLive *live,
                                  const struct AsperityHand *hand,
                                  uint64_t time_ns);

// Writes the newest surface, for a device with a loop of its own. One that is older than 100 ms should not
// push any more.
//
// The thread of forces: one at a time. Never waits, locks or allocates.
//
// `force` is NULL or may be written.
AsperityStatus asperity_live_force(struct AsperityLive *live, struct AsperityForce *force);

// Writes the force [N] on a stylus at `position_mm`, x, y and z of both. Call it about 1000 times a second.
// It evaluates the newest surface at this place and time, limits force and slew, and lets go within 20 ms
// when the surface is older than 100 ms. After an error, `force_n` is 0.
//
// The thread of forces: one at a time. Never waits, locks or allocates.
//
// `position_mm` is NULL or has 3 numbers, and `force_n` is NULL or has room for 3.
AsperityStatus asperity_live_servo(struct AsperityLive *live, const double *position_mm, double *force_n);

// Sets a parameter while it runs, such as `strength.gain` to `0.1`, or `texture.material` to `oak`. One that
// its node can change goes to the next tick. Any other makes another graph, which takes over as in
// `asperity_live_swap`.
//
// The thread of control: one at a time. Blocks: may compile, allocates.
//
// `name` and `value` are NULL or end with a zero byte.
AsperityStatus asperity_live_set(struct AsperityLive *live, const char *name, const char *value);

// Exchanges the graph of a run. The next ticks take it over: parts that are new fade in, and the rest goes
// on. Rates and channels must be the same. ASPERITY_BUSY means that the exchange before is not over: pull,
// and try again.
//
// The thread of control: one at a time. Blocks: compiles, allocates.
AsperityStatus asperity_live_swap(struct AsperityLive *live, struct AsperityGraph *graph);

// Mutes the output within 15 ms (1), or unmutes it (0). Ticks go on.
//
// Any thread. Never blocks.
AsperityStatus asperity_live_mute(struct AsperityLive *live, uint32_t mute);

// Sets the strength of the output: a factor from 0 to 1 before every limiter, which it reaches within 20 ms.
//
// Any thread. Never blocks.
AsperityStatus asperity_live_strength(struct AsperityLive *live, double strength);

// Writes the figures of a run.
//
// The thread of control: one at a time. Allocates.
//
// `figures` is NULL or may be written.
AsperityStatus asperity_live_figures(struct AsperityLive *live, struct AsperityFigures *figures);

// Nodes that failed so far, one a line: how often, and how at last. Empty for none. NULL after an error. The
// text is valid until this thread asks for another text.
//
// The thread of control: one at a time. Allocates.
const char *asperity_live_faults(struct AsperityLive *live);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* ASPERITY_H */
