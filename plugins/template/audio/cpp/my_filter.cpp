// `my_filter`: a node to change, in C++. It softens a signal with a one-pole low pass.

#include "asperity_plugin.h"

#include <cmath>
#include <cstring>
#include <new>

namespace {

struct MyFilterNode {
    float memory = 0.0f;
    float softness = 0.0f;

    // Real time: nothing here may allocate, lock, print, wait or throw.
    int32_t process(const AsperityBuffer &in, AsperityBuffer &out) {
        const float *x = static_cast<const float *>(in.data);
        float *y = static_cast<float *>(out.data);
        for (uint32_t i = 0; i < out.count && i < in.count; i++) {
            // What is not a number must not stay for ever.
            memory = std::isfinite(x[i]) ? x[i] + softness * (memory - x[i]) : 0.0f;
            y[i] = memory;
        }
        out.flags |= ASPERITY_WRITTEN;
        return ASPERITY_CONTINUE;
    }
};

MyFilterNode &self(void *instance) { return *static_cast<MyFilterNode *>(instance); }

// What the host calls. Nothing below throws; where something could, it would have to be caught and answered as
// ASPERITY_PANICKED. Members are set by name, since C++11 has no other way to say which is which.
AsperityKind make_kind() {
    static AsperityPort input = {}, output = {};
    input.size = output.size = sizeof(AsperityPort);
    input.carries = output.carries = ASPERITY_AUDIO;
    input.name = "in";
    input.doc = "any signal";
    output.name = "out";
    output.doc = "softer signal";
    // A unit or a rate with a letter is that of every port with the same letter.
    input.unit_var = output.unit_var = 'u';
    input.shape_var = output.shape_var = 'r';

    static AsperityParam param = {};
    param.size = sizeof(AsperityParam);
    param.holds = ASPERITY_NUMBER;
    param.name = "softness";
    param.doc = "Softness; 0 changes nothing.";
    param.flags = ASPERITY_LIVE;
    param.max = 0.999;
    param.default_number = 0.9;

    AsperityKind kind = {};
    kind.size = sizeof(AsperityKind);
    kind.kind = "my_filter";
    kind.summary = "Softens a signal.";
    kind.inputs = &input;
    kind.outputs = &output;
    kind.params = &param;
    kind.input_count = kind.output_count = kind.param_count = 1;
    kind.create = [](const AsperityKind *) -> void * { return new (std::nothrow) MyFilterNode; };
    kind.prepare = [](void *instance, const AsperitySetup *setup, AsperityError *) -> int32_t {
        self(instance).softness = float(setup->params[0].number);
        return ASPERITY_OK;
    };
    kind.process = [](void *instance, AsperityTick *tick) -> int32_t {
        return self(instance).process(tick->inputs[0], tick->outputs[0]);
    };
    kind.set_parameter = [](void *instance, uint32_t, double value) -> int32_t {
        self(instance).softness = float(value);
        return ASPERITY_OK;
    };
    kind.reset = [](void *instance) -> int32_t {
        self(instance).memory = 0.0f;
        return ASPERITY_OK;
    };
    // What another instance needs to go on without a break when the plugin is swapped while it runs.
    kind.state_size = [](void *) -> uint64_t { return sizeof(float); };
    kind.save = [](void *instance, uint8_t *bytes, uint64_t capacity) -> int64_t {
        if (capacity < sizeof(float)) {
            return -1;
        }
        std::memcpy(bytes, &self(instance).memory, sizeof(float));
        return sizeof(float);
    };
    kind.restore = [](void *instance, const uint8_t *bytes, uint64_t len) -> int32_t {
        if (len != sizeof(float)) {
            return ASPERITY_FAILED;
        }
        std::memcpy(&self(instance).memory, bytes, sizeof(float));
        return ASPERITY_OK;
    };
    kind.destroy = [](void *instance) { delete static_cast<MyFilterNode *>(instance); };
    return kind;
}

const AsperityPlugin *open_plugin(const AsperityHost *) {
    static const AsperityKind kind = make_kind();
    static const AsperityKind *const kinds[] = {&kind};
    static const AsperityPlugin plugin = {sizeof(AsperityPlugin), 1, kinds, "my_filter", "0.1.0", nullptr};
    return &plugin;
}

} // namespace

ASPERITY_EXPORT const AsperityEntry asperity_entry = {
    ASPERITY_MAGIC, sizeof(AsperityEntry), ASPERITY_MAJOR, ASPERITY_MINOR, open_plugin,
};
