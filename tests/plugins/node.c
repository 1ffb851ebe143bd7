/*
 * A plugin to check: three kinds that are well, or broken in one way by -DBREAK=name.
 */

#define _POSIX_C_SOURCE 200809L

#include <fenv.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "asperity_plugin.h"

enum {
    NOTHING, SEGFAULT, ABORT, ENDLESS, EXITS, CRASHES_OPENING, UNSAID_SAMPLES, UNSAID_FRAME, PAST_THE_END, HALF_A_FRAME,
    WRITES_NAN, NO_SUCH_STATUS, FAILS_WITH_CODE, NO_FULL_STOP, NOT_PREPARED, ZERO_BY_ZERO, TRIPS_ON_STEPS,
    TRIPS_ON_DENORMALS, OVERFLOWS, KEEPS_NAN, SHORT_BUFFER, FEW_BINS, NEEDS_THE_OPTIONAL, NEEDS_EVERY_FRAME, FORGETS_TO_RESET,
    STATIC_COUNTER, SLEEPS_TOO_EARLY, DEAF_TO_ELAPSED, ABSORB_FAILS, SAVES_TOO_LITTLE, SAVES_TOO_MUCH, TRUSTS_ANY_STATE, DIVIDES_BY_GAIN,
    TIRES, ALLOCATES, ALLOCATES_IN_RESET, PROCESS_ID, WRITES_TO_INPUTS, NO_OUTPUTS,
    ROUNDS_TO_ZERO, HANDLES_SIGNALS, CHANGES_FOLDER, LEAVES_A_THREAD,
};
#ifndef BREAK
#define BREAK NOTHING
#endif

typedef struct {
    double gain;
    float memory;
    uint64_t ticks;
    double held;
    int closes_cycle;
    uint64_t calls;
    float table[16];
} Node;

static uint64_t all_calls;

static void *without_end(void *nothing) {
    for (;;)
        pause();
    return nothing;
}

static void ignore(int signal) {
    (void)signal;
}

static void *create(const AsperityKind *kind) {
    pthread_t thread;
    (void)kind;
    if (BREAK == LEAVES_A_THREAD)
        pthread_create(&thread, NULL, without_end, NULL);
    if (BREAK == HANDLES_SIGNALS)
        signal(SIGSEGV, ignore);
    if (BREAK == CHANGES_FOLDER && chdir("/") != 0)
        return NULL;
    return calloc(1, sizeof(Node));
}

static void destroy(void *instance) {
    free(instance);
}

static int32_t prepare(void *instance, const AsperitySetup *setup, AsperityError *error) {
    Node *it = instance;
    it->gain = setup->param_count > 0 ? setup->params[0].number : 1.0;
    it->closes_cycle = (int)setup->closes_cycle;
    if (BREAK == NOT_PREPARED) {
        strncpy(error->message, "it is not in the mood", error->message_capacity - 1);
        return ASPERITY_FAILED;
    }
    return ASPERITY_OK;
}

static int32_t reset(void *instance) {
    Node *it = instance;
    it->ticks = 0;
    it->held = 0.0;
    if (BREAK != KEEPS_NAN && BREAK != FORGETS_TO_RESET)
        it->memory = 0.0f;
    if (BREAK == ALLOCATES_IN_RESET)
        free(strdup("what a plugin should not do"));
    return ASPERITY_OK;
}

static int32_t set_parameter(void *instance, uint32_t index, double value) {
    if (index == 0)
        ((Node *)instance)->gain = value;
    return ASPERITY_OK;
}

static int32_t elapsed(void *instance, uint64_t ticks) {
    if (BREAK != DEAF_TO_ELAPSED)
        ((Node *)instance)->ticks += ticks;
    return ASPERITY_OK;
}

typedef struct {
    uint64_t ticks;
    float memory;
    uint32_t at;
} Saved;

static uint64_t state_size(void *instance) {
    (void)instance;
    return sizeof(Saved);
}

static int64_t save(void *instance, uint8_t *bytes, uint64_t capacity) {
    Node *it = instance;
    Saved saved = {it->ticks, BREAK == SAVES_TOO_LITTLE ? 0.0f : it->memory, (uint32_t)(it->ticks % 16)};
    if (capacity < sizeof saved && BREAK != SAVES_TOO_MUCH)
        return -1;
    memcpy(bytes, &saved, sizeof saved);
    return sizeof saved;
}

static int32_t restore(void *instance, const uint8_t *bytes, uint64_t len) {
    Node *it = instance;
    Saved saved;
    if (len != sizeof saved && BREAK != TRUSTS_ANY_STATE)
        return ASPERITY_FAILED;
    memcpy(&saved, bytes, sizeof saved);
    if ((saved.at >= 16 || !isfinite(saved.memory)) && BREAK != TRUSTS_ANY_STATE)
        return ASPERITY_FAILED;
    it->table[saved.at] = 1.0f;
    it->ticks = saved.ticks;
    it->memory = saved.memory;
    return ASPERITY_OK;
}

/* What breaks whatever the kind. Answers whether `process` is to end with that. */
static int broken(Node *it, AsperityTick *tick, int32_t *answer) {
    *answer = ASPERITY_FAILED;
    it->calls++;
    all_calls++;
    if (BREAK == SEGFAULT && it->calls == 50)
        *(volatile int *)8 = 1;
    if (BREAK == ROUNDS_TO_ZERO && it->calls == 50)
        fesetround(FE_TOWARDZERO);
    if (BREAK == ABORT && it->calls == 50)
        abort();
    if (BREAK == EXITS && it->calls == 50)
        exit(3);
    while (BREAK == ENDLESS && it->calls >= 50)
        (void)*(volatile uint64_t *)&all_calls;
    if (BREAK == ALLOCATES) {
        /* Volatile, or it would be left out. */
        void *volatile taken = malloc(100);
        free(taken);
    }
    if (BREAK == FAILS_WITH_CODE && it->calls == 50) {
        tick->detail = 7;
        return 1;
    }
    *answer = 9;
    return BREAK == NO_SUCH_STATUS && it->calls == 50;
}

static int trips(float x, float rms, uint32_t count) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (BREAK == TRIPS_ON_STEPS && (x == 2.0f || x == -2.0f))
        || (BREAK == TRIPS_ON_DENORMALS && (bits & 0x7f800000u) == 0 && (bits & 0x007fffffu) != 0)
        || (BREAK == SHORT_BUFFER && count > 400)
        || (BREAK == TIRES && rms >= 0.0f);
}

/* Audio through a one-pole low-pass. */
static int32_t low_pass(void *instance, AsperityTick *tick) {
    Node *it = instance;
    int32_t answer;
    if (broken(it, tick, &answer))
        return answer;
    const AsperityBuffer *in = &tick->inputs[0], *level = &tick->inputs[1];
    AsperityBuffer *out = &tick->outputs[0];
    if (BREAK == NEEDS_THE_OPTIONAL && !(level->flags & ASPERITY_CONNECTED))
        return ASPERITY_FAILED;
    const float *x = in->data;
    float *y = out->data;
    double gain = BREAK == DIVIDES_BY_GAIN ? 1.0 / it->gain : it->gain;
    if (isfinite(*(const double *)level->data))
        gain *= 1.0 / (1.0 + fabs(*(const double *)level->data));
    float sum = 0.0f;
    for (uint32_t i = 0; i < in->count; i++) {
        if (trips(x[i], it->calls > 1500 ? 1.0f : -1.0f, in->count))
            return ASPERITY_FAILED;
        float now = BREAK == KEEPS_NAN || isfinite(x[i]) ? x[i] : 0.0f;
        it->memory += 0.05f * (now - it->memory);
        sum += fabsf(now);
        y[i] = (float)gain * it->memory;
        if (BREAK == ZERO_BY_ZERO)
            y[i] = now / fabsf(now);
        if (BREAK == OVERFLOWS)
            y[i] = now * now * 1e30f;
        if (BREAK == STATIC_COUNTER)
            y[i] += (float)(all_calls % 7);
        if (BREAK == PROCESS_ID)
            y[i] += (float)getpid();
        if (BREAK == WRITES_TO_INPUTS)
            ((float *)in->data)[i] = 3.0f;
    }
    if (BREAK == WRITES_NAN && it->calls == 50 && out->count > 0)
        y[0] = NAN;
    if (BREAK == PAST_THE_END)
        y[out->count] = 1.0f;
    if (BREAK == SLEEPS_TOO_EARLY && (in->flags & ASPERITY_SILENT)) {
        out->flags |= ASPERITY_WRITTEN;
        tick->detail = 0;
        return ASPERITY_TAIL;
    }
    if (BREAK != UNSAID_SAMPLES)
        out->flags |= ASPERITY_WRITTEN;
    return ASPERITY_CONTINUE;
}

/* Magnitudes with a phase that turns with the ticks. */
static int32_t turning(void *instance, AsperityTick *tick) {
    Node *it = instance;
    const AsperityBuffer *in = &tick->inputs[0];
    AsperityBuffer *out = &tick->outputs[0];
    uint64_t now = it->ticks++;
    if (!(in->flags & ASPERITY_FRAME))
        return BREAK == NEEDS_EVERY_FRAME ? ASPERITY_FAILED : ASPERITY_QUIET;
    if (BREAK == FEW_BINS && in->count > 512)
        return ASPERITY_FAILED;
    const float *m = in->data;
    float *z = out->data;
    float re = (float)cos(0.1 * (double)(now % 1000)), im = (float)sin(0.1 * (double)(now % 1000));
    for (uint32_t i = 0; i < out->count; i++) {
        if (BREAK == HALF_A_FRAME && i > out->count / 2)
            break;
        float ok = isfinite(m[i]) && m[i] > 0.0f ? m[i] : 0.0f;
        z[2 * i] = ok * re;
        z[2 * i + 1] = ok * im;
    }
    out->frame_index = in->frame_index;
    out->frame_start = in->frame_start;
    if (BREAK != UNSAID_FRAME)
        out->flags |= ASPERITY_FRAME;
    return ASPERITY_CONTINUE;
}

/* A control, one tick late; closes cycles. */
static int32_t absorb(void *instance, AsperityTick *tick) {
    double x = *(const double *)tick->inputs[0].data;
    ((Node *)instance)->held = isfinite(x) ? x : 0.0;
    return BREAK == ABSORB_FAILS ? ASPERITY_FAILED : ASPERITY_OK;
}

static int32_t late(void *instance, AsperityTick *tick) {
    Node *it = instance;
    *(double *)tick->outputs[0].data = it->held;
    if (!it->closes_cycle) {
        double x = *(const double *)tick->inputs[0].data;
        it->held = isfinite(x) ? x : 0.0;
    }
    return ASPERITY_CONTINUE;
}

#define PORT(what, called) .size = sizeof(AsperityPort), .carries = what, .name = called, .doc = "a signal"

static const AsperityPort audio_in[] = {
    {PORT(ASPERITY_AUDIO, "in"), .unit = "A"},
    {PORT(ASPERITY_CONTROL, "level"), .unit = "1", .count = 1, .flags = ASPERITY_OPTIONAL, .default_value = 0.5},
};
static const AsperityPort audio_out[] = {{PORT(ASPERITY_AUDIO, "out"), .unit = "A"}};
static const AsperityPort magnitude[] = {{PORT(ASPERITY_MAGNITUDE, "magnitude"), .unit_var = 'u', .shape_var = 'l'}};
static const AsperityPort spectrum[] = {{PORT(ASPERITY_SPECTRUM, "spectrum"), .unit_var = 'u', .shape_var = 'l'}};
static const AsperityPort control_in[] = {{PORT(ASPERITY_CONTROL, "in"), .unit = "N", .count = 1}};
static const AsperityPort control_out[] = {{PORT(ASPERITY_CONTROL, "out"), .unit = "N", .count = 1}};

static const AsperityParam gain[] = {{.size = sizeof(AsperityParam), .holds = ASPERITY_NUMBER, .name = "gain", .doc = "The gain.",
    .flags = ASPERITY_LIVE, .min = 0.0, .max = 4.0, .default_number = 1.0}};
static const AsperityParam delay[] = {{.size = sizeof(AsperityParam), .holds = ASPERITY_NUMBER, .name = "delay_ticks",
    .doc = "The delay.", .min = 1.0, .max = 1.0, .default_number = 1.0}};

#define COMMON .size = sizeof(AsperityKind), .create = create, .prepare = prepare, .reset = reset, .destroy = destroy

static const AsperityKind low_pass_kind = {COMMON, .kind = "low_pass",
    .summary = BREAK == NO_FULL_STOP ? "Low-pass" : "A low-pass of the first order.",
    .inputs = audio_in, .input_count = 2, .outputs = audio_out, .output_count = 1, .params = gain, .param_count = 1,
    .process = low_pass, .set_parameter = set_parameter, .state_size = state_size, .save = save, .restore = restore};
static const AsperityKind turning_kind = {COMMON, .kind = "turning", .summary = "Turns the phase of every bin.",
    .inputs = magnitude, .input_count = 1, .outputs = spectrum, .output_count = BREAK == NO_OUTPUTS ? 0 : 1,
    .resume = ASPERITY_ELAPSED, .elapsed = elapsed, .process = turning,
    .state_size = state_size, .save = save, .restore = restore};
static const AsperityKind late_kind = {COMMON, .kind = "late", .summary = "A tick late.",
    .inputs = control_in, .input_count = 1, .outputs = control_out, .output_count = 1, .params = delay, .param_count = 1,
    .feedback = "delay_ticks", .process = late, .absorb = absorb};

static const AsperityKind *const kinds[] = {&low_pass_kind, &turning_kind, &late_kind};
static const AsperityPlugin plugin = {sizeof(AsperityPlugin), 3, kinds, "made for a test", "1.0.0", NULL};

static const AsperityPlugin *open_plugin(const AsperityHost *host) {
    (void)host;
    if (BREAK == CRASHES_OPENING)
        *(volatile int *)8 = 1;
    return &plugin;
}

ASPERITY_EXPORT const AsperityEntry asperity_entry = {
    ASPERITY_MAGIC, sizeof(AsperityEntry), ASPERITY_MAJOR, ASPERITY_MINOR, open_plugin,
};
