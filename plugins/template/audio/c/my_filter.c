/* `my_filter`: a node to change, in C. It softens a signal with a one-pole low pass. */

#include "asperity_plugin.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct MyFilterNode {
    float memory;
    float softness;
} MyFilterNode;

static void *create(const AsperityKind *kind) {
    (void)kind;
    return calloc(1, sizeof(MyFilterNode));
}

static int32_t prepare(void *instance, const AsperitySetup *setup, AsperityError *error) {
    (void)error;
    ((MyFilterNode *)instance)->softness = (float)setup->params[0].number;
    return ASPERITY_OK;
}

/* Real time: nothing here may allocate, lock, print or wait. */
static int32_t process(void *instance, AsperityTick *tick) {
    MyFilterNode *it = instance;
    const float *in = tick->inputs[0].data;
    float *out = tick->outputs[0].data;
    for (uint32_t i = 0; i < tick->outputs[0].count && i < tick->inputs[0].count; i++) {
        /* What is not a number must not stay for ever. */
        it->memory = isfinite(in[i]) ? in[i] + it->softness * (it->memory - in[i]) : 0.0f;
        out[i] = it->memory;
    }
    tick->outputs[0].flags |= ASPERITY_WRITTEN;
    return ASPERITY_CONTINUE;
}

static int32_t set_parameter(void *instance, uint32_t index, double value) {
    (void)index;
    ((MyFilterNode *)instance)->softness = (float)value;
    return ASPERITY_OK;
}

static int32_t reset(void *instance) {
    ((MyFilterNode *)instance)->memory = 0.0f;
    return ASPERITY_OK;
}

/* What another instance needs to go on without a break when the plugin is swapped while it runs. */
static uint64_t state_size(void *instance) {
    (void)instance;
    return sizeof(float);
}

static int64_t save(void *instance, uint8_t *bytes, uint64_t capacity) {
    if (capacity < sizeof(float)) {
        return -1;
    }
    memcpy(bytes, &((MyFilterNode *)instance)->memory, sizeof(float));
    return sizeof(float);
}

static int32_t restore(void *instance, const uint8_t *bytes, uint64_t len) {
    if (len != sizeof(float)) {
        return ASPERITY_FAILED;
    }
    memcpy(&((MyFilterNode *)instance)->memory, bytes, sizeof(float));
    return ASPERITY_OK;
}

static void destroy(void *instance) {
    free(instance);
}

/* A unit or a rate with a letter is that of every port with the same letter. */
static const AsperityPort inputs[] = {{
    .size = sizeof(AsperityPort),
    .carries = ASPERITY_AUDIO,
    .name = "in",
    .doc = "any signal",
    .unit_var = 'u',
    .shape_var = 'r',
}};

static const AsperityPort outputs[] = {{
    .size = sizeof(AsperityPort),
    .carries = ASPERITY_AUDIO,
    .name = "out",
    .doc = "softer signal",
    .unit_var = 'u',
    .shape_var = 'r',
}};

static const AsperityParam params[] = {{
    .size = sizeof(AsperityParam),
    .holds = ASPERITY_NUMBER,
    .name = "softness",
    .doc = "Softness; 0 changes nothing.",
    .flags = ASPERITY_LIVE,
    .max = 0.999,
    .default_number = 0.9,
}};

static const AsperityKind my_filter_kind = {
    .size = sizeof(AsperityKind),
    .input_count = 1,
    .output_count = 1,
    .param_count = 1,
    .kind = "my_filter",
    .summary = "Softens a signal.",
    .inputs = inputs,
    .outputs = outputs,
    .params = params,
    .create = create,
    .prepare = prepare,
    .process = process,
    .reset = reset,
    .set_parameter = set_parameter,
    .state_size = state_size,
    .save = save,
    .restore = restore,
    .destroy = destroy,
};

static const AsperityPlugin *open_plugin(const AsperityHost *host) {
    static const AsperityKind *const kinds[] = {&my_filter_kind};
    static const AsperityPlugin plugin = {
        .size = sizeof(AsperityPlugin),
        .kind_count = 1,
        .kinds = kinds,
        .name = "my_filter",
        .version = "0.1.0",
    };
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
