/* `my_phase`: a phase-retrieval node to change, in C.
 *
 * It is told how strong each frequency is to be, frame by frame, and has to find phases with which overlapping frames agree.
 * This one lets every bin run on at the frequency of its centre, which is simple and not very good: a sinusoid that lies between
 * two bins beats. `asperity compare --plugin` says how it does beside all others. */

#include "asperity_plugin.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const AsperityRandom *host_random;

typedef struct MyPhaseNode {
    uint32_t length; /* samples of a frame */
    uint32_t bins;
    double *turns; /* phase of each bin at the frame's first sample, in turns */
    uint64_t before; /* first sample of the frame before */
    uint64_t started;
    double spread;
    uint64_t seed;
    uint64_t bad;
} MyPhaseNode;

static void *create(const AsperityKind *kind) {
    (void)kind;
    return calloc(1, sizeof(MyPhaseNode));
}

static int32_t reset(void *instance) {
    MyPhaseNode *it = instance;
    for (uint32_t k = 0; k < it->bins; k++) {
        it->turns[k] = host_random ? it->spread * host_random->uniform(it->seed, k) : 0.0;
    }
    it->started = 0;
    return ASPERITY_OK;
}

static int32_t prepare(void *instance, const AsperitySetup *setup, AsperityError *error) {
    MyPhaseNode *it = instance;
    it->length = setup->inputs[0].length;
    it->bins = setup->inputs[0].bins;
    it->spread = setup->params[0].number;
    it->seed = setup->seed;
    if (it->length == 0 || it->bins == 0) {
        snprintf(error->message, error->message_capacity, "nothing settles the layout of the frames");
        return ASPERITY_FAILED;
    }
    it->turns = calloc(it->bins, sizeof(double));
    if (!it->turns) {
        snprintf(error->message, error->message_capacity, "there is no memory for %u bins", (unsigned)it->bins);
        return ASPERITY_FAILED;
    }
    return reset(it);
}

/* Real time: nothing here may allocate, lock, print or wait. */
static int32_t process(void *instance, AsperityTick *tick) {
    MyPhaseNode *it = instance;
    const AsperityBuffer *in = &tick->inputs[0];
    AsperityBuffer *out = &tick->outputs[0];
    if (!(in->flags & ASPERITY_FRAME)) {
        return ASPERITY_QUIET;
    }
    const float *magnitudes = in->data;
    float *bins = out->data; /* real, imaginary, real, ... */
    double hop = it->started && in->frame_start > it->before ? (double)(in->frame_start - it->before) : 0.0;
    it->before = in->frame_start;
    it->started = 1;
    for (uint32_t k = 0; k < it->bins; k++) {
        double turns = it->turns[k] + k * hop / it->length;
        it->turns[k] = turns - floor(turns);
        int good = magnitudes[k] >= 0.0f && isfinite(magnitudes[k]);
        it->bad += !good;
        double m = good ? magnitudes[k] : 0.0, phase = 6.283185307179586 * it->turns[k];
        bins[2 * k] = (float)(m * cos(phase));
        bins[2 * k + 1] = (float)(m * sin(phase));
    }
    out->flags |= ASPERITY_FRAME;
    out->frame_index = in->frame_index;
    out->frame_start = in->frame_start;
    return ASPERITY_CONTINUE;
}

/* What another instance needs to go on without a break when the plugin is swapped while it runs. */
static uint64_t state_size(void *instance) {
    MyPhaseNode *it = instance;
    return 2 * sizeof(uint64_t) + it->bins * sizeof(double);
}

static int64_t save(void *instance, uint8_t *bytes, uint64_t capacity) {
    MyPhaseNode *it = instance;
    if (capacity < state_size(it)) {
        return -1;
    }
    memcpy(bytes, &it->before, sizeof(uint64_t));
    memcpy(bytes + sizeof(uint64_t), &it->started, sizeof(uint64_t));
    memcpy(bytes + 2 * sizeof(uint64_t), it->turns, it->bins * sizeof(double));
    return (int64_t)state_size(it);
}

static int32_t restore(void *instance, const uint8_t *bytes, uint64_t len) {
    MyPhaseNode *it = instance;
    if (len != state_size(it)) {
        return ASPERITY_FAILED;
    }
    memcpy(&it->before, bytes, sizeof(uint64_t));
    memcpy(&it->started, bytes + sizeof(uint64_t), sizeof(uint64_t));
    memcpy(it->turns, bytes + 2 * sizeof(uint64_t), it->bins * sizeof(double));
    return ASPERITY_OK;
}

static void destroy(void *instance) {
    MyPhaseNode *it = instance;
    if (it) {
        free(it->turns);
        free(it);
    }
}

/* What a report says of the node. */
static void facts(const AsperityKind *kind, void *instance, const AsperityFactSink *sink) {
    (void)kind;
    sink->count(sink->context, "bad_magnitudes", ((MyPhaseNode *)instance)->bad);
}

/* A unit or a layout with a letter is that of every port with the same letter. */
static const AsperityPort inputs[] = {{
    .size = sizeof(AsperityPort),
    .carries = ASPERITY_MAGNITUDE,
    .name = "magnitude",
    .doc = "magnitudes of the next frame",
    .unit_var = 'u',
    .shape_var = 'l',
}};

static const AsperityPort outputs[] = {{
    .size = sizeof(AsperityPort),
    .carries = ASPERITY_SPECTRUM,
    .name = "spectrum",
    .doc = "the same magnitudes with phases",
    .unit_var = 'u',
    .shape_var = 'l',
}};

static const AsperityParam params[] = {{
    .size = sizeof(AsperityParam),
    .holds = ASPERITY_NUMBER,
    .name = "spread",
    .doc = "Spread of the start phases, in turns.",
    .min = 0.0,
    .max = 1.0,
    .default_number = 1.0,
}};

static const AsperityKind my_phase_kind = {
    .size = sizeof(AsperityKind),
    .resume = ASPERITY_RESTART,
    .input_count = 1,
    .output_count = 1,
    .param_count = 1,
    .kind = "my_phase",
    .summary = "Continues every bin at its centre frequency.",
    .inputs = inputs,
    .outputs = outputs,
    .params = params,
    .create = create,
    .prepare = prepare,
    .process = process,
    .reset = reset,
    .state_size = state_size,
    .save = save,
    .restore = restore,
    .destroy = destroy,
};

static const void *extension(const char *name) {
    static const AsperityFacts told = {.size = sizeof(AsperityFacts), .facts = facts};
    return strcmp(name, ASPERITY_EXTENSION_FACTS) == 0 ? &told : NULL;
}

static const AsperityPlugin *open_plugin(const AsperityHost *host) {
    static const AsperityKind *const kinds[] = {&my_phase_kind};
    static const AsperityPlugin plugin = {
        .size = sizeof(AsperityPlugin),
        .kind_count = 1,
        .kinds = kinds,
        .name = "my_phase",
        .version = "0.1.0",
        .extension = extension,
    };
    host_random = host->extension(host, ASPERITY_EXTENSION_RANDOM);
    return &plugin;
}

ASPERITY_EXPORT const AsperityEntry asperity_entry = {
    .magic = ASPERITY_MAGIC,
    .size = sizeof(AsperityEntry),
    .major = ASPERITY_MAJOR,
    .minor = ASPERITY_MINOR,
    .open = open_plugin,
};
