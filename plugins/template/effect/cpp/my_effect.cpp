// `my_effect`: an effect of surfaces to change, in C++. Ridges across a surface catch the stylus.

#include "asperity_plugin.h"

#include <cmath>
#include <cstring>
#include <new>
#include <vector>

namespace {

constexpr double TAU = 6.283185307179586;

// The force to leave a ridge in N, and their spacing in mm.
struct Ridges {
    double force_n;
    double spacing_mm;

    // The values come in the order of the form's fields.
    explicit Ridges(const AsperitySettings &settings)
        : force_n(settings.values->number), spacing_mm(ASPERITY_AT(AsperityValue, settings.values, 1)->number) {}
};

struct MyEffectNode {
    // Those of every surface that has some.
    std::vector<Ridges> all;

    // Real time: nothing here may allocate, lock, print, wait or throw.
    int32_t process(const AsperityTick &tick) const {
        const auto in = [&tick](int i) { return static_cast<const double *>(tick.inputs[i].data); };
        const double slot = *in(0);
        // What is not a number is not at least 0.
        double *force = static_cast<double *>(tick.outputs[0].data);
        if (!(slot >= 0.0 && slot < double(all.size()))) {
            std::memset(force, 0, 3 * sizeof(double));
            return ASPERITY_ASLEEP;
        }
        const Ridges &ridges = all[size_t(slot)];
        const double along = -ridges.force_n * std::sin(TAU * *in(1) / ridges.spacing_mm);
        for (int i = 0; i < 3; i++) {
            const double part = along * in(2)[i];
            force[i] = std::isfinite(part) ? part : 0.0;
        }
        return ASPERITY_CONTINUE;
    }
};

AsperityPort port(const char *name, const char *doc, const char *unit, uint32_t count) {
    AsperityPort port = {};
    port.size = sizeof(AsperityPort);
    port.carries = ASPERITY_CONTROL;
    port.name = name;
    port.doc = doc;
    port.unit = unit;
    port.count = count;
    return port;
}

AsperityParam field(const char *name, const char *doc, const char *unit, double min, double max, double usual) {
    AsperityParam field = {};
    field.size = sizeof(AsperityParam);
    field.holds = ASPERITY_NUMBER;
    field.name = name;
    field.doc = doc;
    field.unit = unit;
    field.min = min;
    field.max = max;
    field.default_number = usual;
    return field;
}

// What the host calls. Where something could throw, it is caught and answered as ASPERITY_PANICKED.
AsperityKind make_kind() {
    static AsperityPort inputs[] = {
        port("slot", "index into `ridges`, from 0; below 0: no force", "1", 1),
        port("place", "stylus position along `tangents`, then height", "mm", 3),
        port("tangents", "two unit vectors along the surface", "1", 6),
    };
    inputs[0].flags = ASPERITY_OPTIONAL | ASPERITY_WAKES;
    static const AsperityPort output = port("force", "force on the stylus", "N", 3);

    static AsperityParam param = {};
    param.size = sizeof(AsperityParam);
    param.holds = ASPERITY_TEXTS;
    param.name = "ridges";
    param.doc = "Ridges of each slot, written as after `my_effect` in a scene.";

    AsperityKind kind = {};
    kind.size = sizeof(AsperityKind);
    kind.kind = "my_effect";
    kind.summary = "Ridges across a surface that catch the stylus.";
    kind.inputs = inputs;
    kind.outputs = &output;
    kind.params = &param;
    kind.input_count = 3;
    kind.output_count = kind.param_count = 1;
    kind.create = [](const AsperityKind *) -> void * { return new (std::nothrow) MyEffectNode; };
    kind.prepare = [](void *instance, const AsperitySetup *setup, AsperityError *) -> int32_t {
        try {
            for (uint32_t i = 0; i < setup->slot_count; i++) {
                const auto slot = ASPERITY_AT(AsperitySlot, setup->slots, i);
                static_cast<MyEffectNode *>(instance)->all.emplace_back(*slot->settings);
            }
            return ASPERITY_OK;
        } catch (...) {
            return ASPERITY_PANICKED;
        }
    };
    kind.process = [](void *instance, AsperityTick *tick) -> int32_t {
        return static_cast<MyEffectNode *>(instance)->process(*tick);
    };
    kind.reset = [](void *) -> int32_t { return ASPERITY_OK; };
    kind.destroy = [](void *instance) { delete static_cast<MyEffectNode *>(instance); };
    return kind;
}

// What a scene may write behind `my_effect`, and what it connects to this node.
AsperityEffect make_effect() {
    static const AsperityParam fields[] = {
        field("force_n", "force that leaves a ridge", "N", 0.0, 10.0, 0.3),
        field("spacing_mm", "distance between ridges", "mm", 0.1, 100.0, 2.0),
    };
    static AsperityForm form = {};
    form.size = sizeof(AsperityForm);
    form.name = "";
    form.fields = fields;
    form.field_count = 2;
    form.example = "(force_n: 0.3, spacing_mm: 2)";
    static const AsperityNeed needs[] = {
        {sizeof(AsperityNeed), 0, "place", "place"},
        {sizeof(AsperityNeed), 0, "tangents", "tangents"},
    };

    AsperityEffect effect = {};
    effect.size = sizeof(AsperityEffect);
    effect.acts = ASPERITY_TOUCHING;
    effect.list = "ridges";
    effect.forms = &form;
    effect.form_count = 1;
    effect.needs = needs;
    effect.need_count = 2;
    effect.direction = ASPERITY_SURFACE;
    // The steepest slope of the force tells a scene whether the device bears it.
    effect.law = [](const AsperityKind *, const AsperitySettings *settings, double, AsperityLaw *law) -> int32_t {
        const Ridges ridges(*settings);
        law->stiffness_n_per_mm = TAU * ridges.force_n / ridges.spacing_mm;
        return ASPERITY_OK;
    };
    return effect;
}

const void *extension(const char *name) {
    static const AsperityEffect effect = make_effect();
    // This plugin has one kind, and it is an effect.
    static const AsperityEffects effects = {
        sizeof(AsperityEffects), 0, [](const AsperityKind *) -> const AsperityEffect * { return &effect; }};
    return std::strcmp(name, ASPERITY_EXTENSION_EFFECT) == 0 ? &effects : nullptr;
}

const AsperityPlugin *open_plugin(const AsperityHost *) {
    static const AsperityKind kind = make_kind();
    static const AsperityKind *const kinds[] = {&kind};
    static const AsperityPlugin plugin = {sizeof(AsperityPlugin), 1, kinds, "my_effect", "0.1.0", extension};
    return &plugin;
}

} // namespace

ASPERITY_EXPORT const AsperityEntry asperity_entry = {
    ASPERITY_MAGIC, sizeof(AsperityEntry), ASPERITY_MAJOR, ASPERITY_MINOR, open_plugin,
};
