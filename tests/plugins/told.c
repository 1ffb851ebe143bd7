/* A slow wave that goes wrong when told to, and how. */

#define _POSIX_C_SOURCE 199309L

#include "asperity_plugin.h"

#include <fenv.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#ifndef AMPLITUDE
#define AMPLITUDE 0.1f
#endif

typedef struct Told {
    uint64_t from, to;
    int64_t what;
} Told;

#ifdef TRAP
/* As a file that is damaged: its code is no code. */
__attribute__((constructor)) static void trap(void) {
    __builtin_trap();
}
#endif

#ifdef TOUCH
/* What a stranger's plugin may do before anybody calls it. */
__attribute__((constructor)) static void touch(void) {
    FILE *file = fopen("touched", "w");
    if (file)
        fclose(file);
}
#endif

#ifdef HANDLER
/* What a debugger or a runtime of another language may do. */
static void handler(int signal) {
    (void)signal;
}
__attribute__((constructor)) static void install(void) {
    signal(SIGSEGV, handler);
}
#endif

static uint64_t instances;

static void *create(const AsperityKind *kind) {
    (void)kind;
    instances++;
    return calloc(1, sizeof(Told));
}

static void destroy(void *instance) {
    instances--;
    free(instance);
}

/* How many instances there are, so that a test sees that none is left behind. */
static void facts(const AsperityKind *kind, void *instance, const AsperityFactSink *sink) {
    (void)kind, (void)instance;
    sink->count(sink->context, "instances", instances);
}

static const void *extension(const char *name) {
    static const AsperityFacts told = {.size = sizeof(AsperityFacts), .facts = facts};
    return strcmp(name, ASPERITY_EXTENSION_FACTS) == 0 ? &told : NULL;
}

static int32_t prepare(void *instance, const AsperitySetup *setup, AsperityError *error) {
    Told *it = instance;
    (void)error;
    it->from = (uint64_t)setup->params[0].integer;
    it->to = (uint64_t)setup->params[1].integer;
    it->what = setup->params[2].integer;
    return ASPERITY_OK;
}

static int32_t process(void *instance, AsperityTick *tick) {
    Told *it = instance;
    AsperityBuffer *out = &tick->outputs[0];
    float *y = out->data;
    uint64_t first = tick->index * 48000 / tick->tick_hz;
    for (uint32_t i = 0; i < out->count; i++) {
        y[i] = AMPLITUDE * sinf(0.01f * (float)(first + i));
    }
    out->flags |= ASPERITY_WRITTEN;
    if (tick->index < it->from || tick->index >= it->to) {
        return ASPERITY_CONTINUE;
    }
    switch (it->what) {
    case 0: /* an error */
        tick->detail = 7;
        return ASPERITY_FAILED;
    case 1: /* not a number */
        y[out->count / 2] = NAN;
        return ASPERITY_CONTINUE;
    case 2: /* what a C++ node answers for an exception */
        return ASPERITY_PANICKED;
    case 3: { /* too long */
        struct timespec span = {0, 30 * 1000 * 1000};
        nanosleep(&span, NULL);
        return ASPERITY_CONTINUE;
    }
    case 5: /* without end */
        for (volatile uint64_t spins = 0;; spins++) {
        }
    case 6: /* as if all were done */
        exit(0);
    case 7: /* and leaves another rounding behind */
        fesetround(FE_UPWARD);
        return ASPERITY_CONTINUE;
    default: /* an answer that there is not */
        return 99;
    }
}

static int32_t reset(void *instance) {
    (void)instance;
    return ASPERITY_OK;
}

static const AsperityPort outputs[] = {{
    .size = sizeof(AsperityPort),
    .carries = ASPERITY_AUDIO,
    .name = "out",
    .doc = "a slow wave",
    .unit = "A",
}};

static const char *const words[] = {"error", "nan", "exception", "overrun", "nonsense", "endless", "exit", "rounding", NULL};

static const AsperityParam params[] = {
    {.size = sizeof(AsperityParam), .holds = ASPERITY_INTEGER, .name = "from", .doc = "First tick.", .integer_max = 1000000},
    {.size = sizeof(AsperityParam), .holds = ASPERITY_INTEGER, .name = "to", .doc = "Last tick.", .integer_max = 1000000},
    {.size = sizeof(AsperityParam), .holds = ASPERITY_CHOICE, .name = "what", .doc = "How.", .words = words},
};

static const AsperityKind kind = {
    .size = sizeof(AsperityKind),
    .output_count = 1,
    .param_count = 3,
    .kind = "told",
    .summary = "Goes wrong when told to.",
    .outputs = outputs,
    .params = params,
    .create = create,
    .prepare = prepare,
    .process = process,
    .reset = reset,
    .destroy = destroy,
};

static const AsperityPlugin *open_plugin(const AsperityHost *host) {
    static const AsperityKind *const kinds[] = {&kind};
    static const AsperityPlugin plugin = {
        .size = sizeof(AsperityPlugin), .kind_count = 1, .kinds = kinds, .name = "told", .version = "1", .extension = extension};
    (void)host;
    return &plugin;
}

ASPERITY_EXPORT const AsperityEntry asperity_entry = {
    .magic = ASPERITY_MAGIC,
    .size = sizeof(AsperityEntry),
    .major = ASPERITY_MAJOR,
    .minor = ASPERITY_MINOR,
    .open = open_plugin,
};
