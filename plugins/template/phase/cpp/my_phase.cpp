// `my_phase`: a phase-retrieval node to change, in C++.
//
// It is told how strong each frequency is to be, frame by frame, and has to find phases with which overlapping frames agree.
// This one lets every bin run on at the frequency of its centre, which is simple and not very good: a sinusoid that lies between
// two bins beats. `asperity compare --plugin` says how it does beside all others.

#include "asperity_plugin.h"

#include <cmath>
#include <complex>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <vector>

namespace {

const AsperityRandom *host_random = nullptr;

// Says what is wrong, in the host's memory.
int32_t fail(AsperityError *error, const char *message) {
    std::snprintf(error->message, error->message_capacity, "%s", message);
    return ASPERITY_FAILED;
}

class MyPhaseNode {
  public:
    void prepare(const AsperitySetup &setup) {
        length = setup.inputs[0].length;
        spread = setup.params[0].number;
        seed = setup.seed;
        turns.resize(setup.inputs[0].bins);
        if (turns.empty() || setup.inputs[0].length == 0) {
            throw std::runtime_error("nothing settles the layout of the frames");
        }
        reset();
    }

    void reset() {
        for (std::size_t k = 0; k < turns.size(); k++) {
            turns[k] = host_random ? spread * host_random->uniform(seed, k) : 0.0;
        }
        started = 0;
    }

    // Real time: nothing here may allocate, lock, print, wait or throw.
    int32_t process(const AsperityBuffer &in, AsperityBuffer &out) {
        if (!(in.flags & ASPERITY_FRAME)) {
            return ASPERITY_QUIET;
        }
        const float *magnitudes = static_cast<const float *>(in.data);
        std::complex<float> *bins = static_cast<std::complex<float> *>(out.data);
        double hop = started && in.frame_start > before ? double(in.frame_start - before) : 0.0;
        before = in.frame_start;
        started = 1;
        for (std::size_t k = 0; k < turns.size(); k++) {
            turns[k] += double(k) * hop / length;
            turns[k] -= std::floor(turns[k]);
            bool good = magnitudes[k] >= 0.0f && std::isfinite(magnitudes[k]);
            bad += !good;
            bins[k] = std::polar(good ? magnitudes[k] : 0.0f, float(6.283185307179586 * turns[k]));
        }
        out.flags |= ASPERITY_FRAME;
        out.frame_index = in.frame_index;
        out.frame_start = in.frame_start;
        return ASPERITY_CONTINUE;
    }

    // What another instance needs to go on without a break when the plugin is swapped while it runs.
    std::size_t state_size() const { return 2 * sizeof(uint64_t) + turns.size() * sizeof(double); }

    void save(uint8_t *bytes) const {
        std::memcpy(bytes, &before, sizeof before);
        std::memcpy(bytes + sizeof before, &started, sizeof started);
        std::memcpy(bytes + sizeof before + sizeof started, turns.data(), turns.size() * sizeof(double));
    }

    void restore(const uint8_t *bytes) {
        std::memcpy(&before, bytes, sizeof before);
        std::memcpy(&started, bytes + sizeof before, sizeof started);
        std::memcpy(turns.data(), bytes + sizeof before + sizeof started, turns.size() * sizeof(double));
    }

    uint64_t bad = 0;

  private:
    double length = 1.0; // samples of a frame
    std::vector<double> turns; // phase of each bin at the frame's first sample, in turns
    uint64_t before = 0; // first sample of the frame before
    uint64_t started = 0;
    double spread = 1.0;
    uint64_t seed = 0;
};

MyPhaseNode &self(void *instance) { return *static_cast<MyPhaseNode *>(instance); }

// An exception must not leave the plugin.
template <typename F> int32_t guarded(F f) {
    try {
        return f();
    } catch (...) {
        return ASPERITY_PANICKED;
    }
}

// What the host calls. Members are set by name, since C++11 has no other way to say which is which.
AsperityKind make_kind() {
    static AsperityPort input = {}, output = {};
    input.size = output.size = sizeof(AsperityPort);
    input.carries = ASPERITY_MAGNITUDE;
    input.name = "magnitude";
    input.doc = "magnitudes of the next frame";
    output.carries = ASPERITY_SPECTRUM;
    output.name = "spectrum";
    output.doc = "the same magnitudes with phases";
    // A unit or a layout with a letter is that of every port with the same letter.
    input.unit_var = output.unit_var = 'u';
    input.shape_var = output.shape_var = 'l';

    static AsperityParam param = {};
    param.size = sizeof(AsperityParam);
    param.holds = ASPERITY_NUMBER;
    param.name = "spread";
    param.doc = "Spread of the start phases, in turns.";
    param.max = 1.0;
    param.default_number = 1.0;

    AsperityKind kind = {};
    kind.size = sizeof(AsperityKind);
    kind.kind = "my_phase";
    kind.summary = "Continues every bin at its centre frequency.";
    kind.inputs = &input;
    kind.outputs = &output;
    kind.params = &param;
    kind.input_count = kind.output_count = kind.param_count = 1;
    kind.create = [](const AsperityKind *) -> void * {
        try {
            return new MyPhaseNode;
        } catch (...) {
            return nullptr;
        }
    };
    kind.prepare = [](void *instance, const AsperitySetup *setup, AsperityError *error) -> int32_t {
        try {
            self(instance).prepare(*setup);
            return ASPERITY_OK;
        } catch (const std::exception &e) {
            return fail(error, e.what());
        } catch (...) {
            return fail(error, "something was thrown while it was prepared");
        }
    };
    kind.process = [](void *instance, AsperityTick *tick) -> int32_t {
        return guarded([&] { return self(instance).process(tick->inputs[0], tick->outputs[0]); });
    };
    kind.reset = [](void *instance) -> int32_t {
        return guarded([&] { return self(instance).reset(), ASPERITY_OK; });
    };
    kind.state_size = [](void *instance) -> uint64_t { return self(instance).state_size(); };
    kind.save = [](void *instance, uint8_t *bytes, uint64_t capacity) -> int64_t {
        if (capacity < self(instance).state_size()) {
            return -1;
        }
        self(instance).save(bytes);
        return int64_t(self(instance).state_size());
    };
    kind.restore = [](void *instance, const uint8_t *bytes, uint64_t len) -> int32_t {
        if (len != self(instance).state_size()) {
            return ASPERITY_FAILED;
        }
        self(instance).restore(bytes);
        return ASPERITY_OK;
    };
    kind.destroy = [](void *instance) { delete static_cast<MyPhaseNode *>(instance); };
    return kind;
}

// What a report says of the node.
void facts(const AsperityKind *, void *instance, const AsperityFactSink *sink) {
    sink->count(sink->context, "bad_magnitudes", self(instance).bad);
}

const void *extension(const char *name) {
    static const AsperityFacts told = {sizeof(AsperityFacts), 0, facts};
    return std::strcmp(name, ASPERITY_EXTENSION_FACTS) == 0 ? &told : nullptr;
}

const AsperityPlugin *open_plugin(const AsperityHost *host) {
    static const AsperityKind kind = make_kind();
    static const AsperityKind *const kinds[] = {&kind};
    static const AsperityPlugin plugin = {sizeof(AsperityPlugin), 1, kinds, "my_phase", "0.1.0", extension};
    host_random = static_cast<const AsperityRandom *>(host->extension(host, ASPERITY_EXTENSION_RANDOM));
    return &plugin;
}

} // namespace

ASPERITY_EXPORT const AsperityEntry asperity_entry = {
    ASPERITY_MAGIC, sizeof(AsperityEntry), ASPERITY_MAJOR, ASPERITY_MINOR, open_plugin,
};
