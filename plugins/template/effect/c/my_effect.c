/* `my_effect`: an effect of surfaces to change, in C. Ridges across a surface catch the stylus. */

#include "asperity_plugin.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define TAU 6.283185307179586

/* The force to leave a ridge in N, and their spacing in mm. */
typedef struct Ridges {
    double force_n;
    double spacing_mm;
} Ridges;

/* Those of every surface that has some. */
typedef struct MyEffectNode {
    uint32_t count;
    Ridges *ridges;
} MyEffectNode;

/* The values come in the order of the form's fields. */
static Ridges ridges_of(const AsperitySettings *settings) {
    Ridges ridges = {settings->values->number, ASPERITY_AT(AsperityValue, settings->values, 1)->number};
    return ridges;
}

static void *create(const AsperityKind *kind) {
    (void)kind;
    return calloc(1, sizeof(MyEffectNode));
}

static int32_t prepare(void *instance, const AsperitySetup *setup, AsperityError *error) {
    MyEffectNode *it = instance;
    it->ridges = calloc(setup->slot_count ? setup->slot_count : 1, sizeof(Ridges));
    if (!it->ridges) {
        strncpy(error->message, "there is no memory left", error->message_capacity - 1);
        return ASPERITY_FAILED;
    }
    it->count = setup->slot_count;
    for (uint32_t i = 0; i < it->count; i++) {
        it->ridges[i] = ridges_of(ASPERITY_AT(AsperitySlot, setup->slots, i)->settings);
    }
    return ASPERITY_OK;
}

/* Real time: nothing here may allocate, lock, print or wait. */
static int32_t process(void *instance, AsperityTick *tick) {
    const MyEffectNode *it = instance;
    double slot = *(const double *)tick->inputs[0].data;
    const double *place = tick->inputs[1].data;
    const double *tangents = tick->inputs[2].data;
    double *force = tick->outputs[0].data;
    /* What is not a number is not at least 0. */
    if (!(slot >= 0.0 && slot < it->count)) {
        memset(force, 0, 3 * sizeof(double));
        return ASPERITY_ASLEEP;
    }
    const Ridges *ridges = &it->ridges[(uint32_t)slot];
    double along = -ridges->force_n * sin(TAU * place[0] / ridges->spacing_mm);
    for (int i = 0; i < 3; i++) {
        double part = along * tangents[i];
        force[i] = isfinite(part) ? part : 0.0;
    }
    return ASPERITY_CONTINUE;
}

static int32_t reset(void *instance) {
    (void)instance;
    return ASPERITY_OK;
}

static void destroy(void *instance) {
    free(((MyEffectNode *)instance)->ridges);
    free(instance);
}

static const AsperityPort inputs[] = {
    {
        .size = sizeof(AsperityPort),
        .carries = ASPERITY_CONTROL,
        .name = "slot",
        .doc = "index into `ridges`, from 0; below 0: no force",
        .unit = "1",
        .count = 1,
        .flags = ASPERITY_OPTIONAL | ASPERITY_WAKES,
    },
    {
        .size = sizeof(AsperityPort),
        .carries = ASPERITY_CONTROL,
        .name = "place",
        .doc = "stylus position along `tangents`, then height",
        .unit = "mm",
        .count = 3,
    },
    {
        .size = sizeof(AsperityPort),
        .carries = ASPERITY_CONTROL,
        .name = "tangents",
        .doc = "two unit vectors along the surface",
        .unit = "1",
        .count = 6,
    },
};

static const AsperityPort outputs[] = {{
    .size = sizeof(AsperityPort),
    .carries = ASPERITY_CONTROL,
    .name = "force",
    .doc = "force on the stylus",
    .unit = "N",
    .count = 3,
}};

static const AsperityParam params[] = {{
    .size = sizeof(AsperityParam),
    .holds = ASPERITY_TEXTS,
    .name = "ridges",
    .doc = "Ridges of each slot, written as after `my_effect` in a scene.",
}};

static const AsperityKind my_effect_kind = {
    .size = sizeof(AsperityKind),
    .input_count = 3,
    .output_count = 1,
    .param_count = 1,
    .kind = "my_effect",
    .summary = "Ridges across a surface that catch the stylus.",
    .inputs = inputs,
    .outputs = outputs,
    .params = params,
    .create = create,
    .prepare = prepare,
    .process = process,
    .reset = reset,
    .destroy = destroy,
};

/* What a scene may write behind `my_effect`, and what it connects to this node. */
static const AsperityParam fields[] = {
    {
        .size = sizeof(AsperityParam),
        .holds = ASPERITY_NUMBER,
        .name = "force_n",
        .doc = "force that leaves a ridge",
        .unit = "N",
        .max = 10.0,
        .default_number = 0.3,
    },
    {
        .size = sizeof(AsperityParam),
        .holds = ASPERITY_NUMBER,
        .name = "spacing_mm",
        .doc = "distance between ridges",
        .unit = "mm",
        .min = 0.1,
        .max = 100.0,
        .default_number = 2.0,
    },
};

static const AsperityForm forms[] = {{
    .size = sizeof(AsperityForm),
    .field_count = 2,
    .name = "",
    .fields = fields,
    .example = "(force_n: 0.3, spacing_mm: 2)",
}};

static const AsperityNeed needs[] = {
    {.size = sizeof(AsperityNeed), .input = "place", .quantity = "place"},
    {.size = sizeof(AsperityNeed), .input = "tangents", .quantity = "tangents"},
};

/* The steepest slope of the force tells a scene whether the device bears it. */
static int32_t law(const AsperityKind *kind, const AsperitySettings *settings, double normal_force_n,
                   AsperityLaw *law) {
    Ridges ridges = ridges_of(settings);
    (void)kind;
    (void)normal_force_n;
    law->stiffness_n_per_mm = TAU * ridges.force_n / ridges.spacing_mm;
    return ASPERITY_OK;
}

static const AsperityEffect my_effect = {
    .size = sizeof(AsperityEffect),
    .acts = ASPERITY_TOUCHING,
    .list = "ridges",
    .form_count = 1,
    .need_count = 2,
    .forms = forms,
    .needs = needs,
    .direction = ASPERITY_SURFACE,
    .law = law,
};

static const AsperityEffect *effect(const AsperityKind *kind) {
    return kind == &my_effect_kind ? &my_effect : NULL;
}

static const void *extension(const char *name) {
    static const AsperityEffects effects = {.size = sizeof(AsperityEffects), .effect = effect};
    return strcmp(name, ASPERITY_EXTENSION_EFFECT) == 0 ? &effects : NULL;
}

static const AsperityPlugin *open_plugin(const AsperityHost *host) {
    static const AsperityKind *const kinds[] = {&my_effect_kind};
    static const AsperityPlugin plugin = {
        .size = sizeof(AsperityPlugin),
        .kind_count = 1,
        .kinds = kinds,
        .name = "my_effect",
        .version = "0.1.0",
        .extension = extension,
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
