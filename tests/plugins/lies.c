/* A plugin that lies in one way: LIE says in which. LIE 0 is the honest one. */

#include "asperity_plugin.h"

#include <stddef.h>

#ifndef LIE
#define LIE 0
#endif
#define IF_LIE(n, lie, truth) (LIE == (n) ? (lie) : (truth))

static void *create(const AsperityKind *kind) {
    static int instance;
    (void)kind;
    return IF_LIE(40, NULL, (void *)&instance);
}
static int32_t prepare(void *it, const AsperitySetup *setup, AsperityError *error) {
    (void)it, (void)setup, (void)error;
    return IF_LIE(41, ASPERITY_FAILED, ASPERITY_OK);
}
static int32_t process(void *it, AsperityTick *tick) {
    (void)it, (void)tick;
    return ASPERITY_QUIET;
}
static int32_t reset(void *it) {
    (void)it;
    return ASPERITY_OK;
}
static void destroy(void *it) {
    (void)it;
}
static void info(void *it, AsperityInfo *info) {
    (void)it;
    info->latency_num = 1;
    info->latency_den = IF_LIE(42, -1, 0);
}

static const AsperityPort ports[] = {
    {
        .size = IF_LIE(10, 7, IF_LIE(11, 1u << 20, sizeof(AsperityPort))),
        .carries = IF_LIE(12, 77, ASPERITY_CONTROL),
        .name = IF_LIE(13, NULL, IF_LIE(14, "Bad Name", "in")),
        .doc = "a value",
        .unit = IF_LIE(15, NULL, "N"),
        .count = IF_LIE(16, 0, IF_LIE(17, 1u << 31, 1)),
        .flags = IF_LIE(18, 1u << 30, 0),
        .default_value = IF_LIE(19, 1e308 * 10, 0),
    },
    {.size = sizeof(AsperityPort), .carries = ASPERITY_CONTROL, .name = "in", .doc = "again", .unit = "N", .count = 1},
    {.size = sizeof(AsperityPort),
     .carries = ASPERITY_MAGNITUDE,
     .name = "frames",
     .doc = "bins that no transform of that length has",
     .unit = "1",
     .rate_hz = 2500,
     .length = 250,
     .bins = 200,
     .frame_num = 500,
     .frame_den = 1},
};

static const AsperityPort out[] = {{
    .size = sizeof(AsperityPort),
    .carries = ASPERITY_AUDIO,
    .name = "out",
    .doc = "goes to a device past the limiter",
    .unit = "A",
    .flags = ASPERITY_LIMITED,
}};

static const char *const words[] = {"one", "two", NULL};

static const AsperityParam params[] = {{
    .size = IF_LIE(20, 3, sizeof(AsperityParam)),
    .holds = IF_LIE(21, 99, IF_LIE(29, ASPERITY_CHOICE, ASPERITY_NUMBER)),
    .name = IF_LIE(22, "", "gain"),
    .doc = "A number.",
    .min = IF_LIE(23, 2, IF_LIE(24, 0.0 / 0.0, 0)),
    .max = IF_LIE(25, 1e308 * 10, 1),
    .default_number = IF_LIE(26, 5, 0.5),
    .flags = IF_LIE(27, 1u << 20, IF_LIE(28, ASPERITY_LIVE, 0)),
    .words = words,
    .default_text = "three",
}};

#define KIND                                                                                                           \
    {                                                                                                                  \
        .size = IF_LIE(1, 8, sizeof(AsperityKind)), .flags = IF_LIE(2, 64, 0), .resume = IF_LIE(3, 9, 0),              \
        .input_count = IF_LIE(4, 2, IF_LIE(5, 4000000000u, IF_LIE(6, 3, 1))), .param_count = 1,                        \
        .kind = IF_LIE(7, NULL, IF_LIE(8, "spsi", IF_LIE(9, "No Good", "honest"))), .summary = "Does nothing.",       \
        .outputs = out, .output_count = IF_LIE(36, 1, 0),                                                              \
        .inputs = IF_LIE(30, NULL, ports), .params = params, .gate = IF_LIE(31, "nothing", NULL),                      \
        .feedback = IF_LIE(32, "nothing", NULL), .create = IF_LIE(33, NULL, create), .prepare = prepare,               \
        .info = info, .process = IF_LIE(34, NULL, process), .reset = reset, .destroy = destroy,                        \
        .save = IF_LIE(35, (int64_t(*)(void *, uint8_t *, uint64_t))1, NULL),                                          \
    }

static const AsperityKind kind = KIND;
static const AsperityKind twin = KIND;

static const AsperityPlugin *open_plugin(const AsperityHost *host) {
    static const AsperityKind *const kinds[] = {&kind, &twin, NULL};
    static const AsperityPlugin plugin = {
        .size = IF_LIE(50, 4, sizeof(AsperityPlugin)),
        .kind_count = IF_LIE(51, 0, IF_LIE(52, 4000000000u, IF_LIE(53, 2, IF_LIE(54, 3, 1)))),
        .kinds = IF_LIE(55, NULL, kinds),
        .name = IF_LIE(56, NULL, "lies"),
        .version = IF_LIE(57, "\xff\xfe", "1"),
    };
    (void)host;
    return IF_LIE(58, NULL, &plugin);
}

#if LIE == 60
ASPERITY_EXPORT const int not_an_entry = 1;
#elif LIE == 61
ASPERITY_EXPORT const char asperity_entry[64] = "this is a text and not an entry";
#else
ASPERITY_EXPORT const AsperityEntry asperity_entry = {
    .magic = ASPERITY_MAGIC,
    .size = IF_LIE(62, 4, sizeof(AsperityEntry)),
    .major = IF_LIE(63, 2, ASPERITY_MAJOR),
    .minor = ASPERITY_MINOR,
    .open = IF_LIE(64, NULL, open_plugin),
};
#endif
