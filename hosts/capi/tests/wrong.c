// Calls the interface as no program should: in any order, from any thread, with NULL, NaN, freed handles and
// handles of another kind. Each call answers a status; nothing crashes.
//
//     wrong GRAPH.ron [SEED] [CALLS]
#include <asperity.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { THREADS = 4, KINDS = 3, HANDLES = 3, ROOM = 1024, FUNCTIONS = 24 };
enum { GRAPH, ENGINE, LIVE };

static const char *path;
static uint64_t calls;
// Handles of each kind: threads exchange them.
static _Atomic(void *) handles[KINDS][HANDLES];
static atomic_ullong answered[4];

struct chance {
    uint64_t state;
};

// xorshift64*.
static uint64_t draw(struct chance *chance)
{
    chance->state ^= chance->state >> 12;
    chance->state ^= chance->state << 25;
    chance->state ^= chance->state >> 27;
    return chance->state * 2685821657736338717u;
}

static int one_in(struct chance *chance, unsigned n)
{
    return (draw(chance) >> 33) % n == 0;
}

// A handle of a kind, more or less.
static void *any_handle(struct chance *chance, unsigned kind)
{
    if (one_in(chance, 30)) {
        return NULL;
    }
    if (one_in(chance, 30)) {
        return (void *)(uintptr_t)draw(chance);
    }
    if (one_in(chance, 8)) {
        kind = (draw(chance) >> 33) % KINDS;
    }
    return atomic_load(&handles[kind][(draw(chance) >> 33) % HANDLES]);
}

static double any_number(struct chance *chance)
{
    static const double odd[] = { NAN, INFINITY, -INFINITY, 0, -0.0, 1e308, -1e308, 5e-324 };
    if (one_in(chance, 8)) {
        return odd[(draw(chance) >> 33) % 8];
    }
    return (double)(draw(chance) >> 33) / 1e8 - 40;
}

static const char *any_text(struct chance *chance)
{
    static const char *const texts[] = {
        NULL, "", "\xff\xfe", ".", "=", "tone.amplitude", "tone", "strength.gain", "0.05", "oak", "nan", "1e999",
        "texture.material", "seed", "tick_hz", "7", "floor.force", "audio_hz", "44100", "none.csv", "a=b=c",
        "Graph(version: 1, nodes: {})", "Graph(", "\"", "graphs/texture.ron",
    };
    return texts[(draw(chance) >> 33) % (sizeof texts / sizeof *texts)];
}

static void keep(struct chance *chance, unsigned kind, void *handle)
{
    // The one before is freed, though other threads may be about to use it.
    void *old = atomic_exchange(&handles[kind][(draw(chance) >> 33) % HANDLES], handle);
    asperity_live_free(old);
    asperity_engine_free(old);
    asperity_graph_free(old);
}

static const char tone[] =
    "Graph(version: 1, nodes: {\"tone\": (kind: \"sine\", params: (unit: \"A\")),"
    " \"limiter\": (kind: \"limiter\", params: (profile: \"hapcoil_one\")), \"out\": (kind: \"audio_out\")},"
    " wires: [(\"tone\", \"limiter\"), (\"limiter\", \"out\")])";

static AsperityStatus call(struct chance *chance, float *room)
{
    unsigned function = (draw(chance) >> 33) % FUNCTIONS;
    unsigned kind = function < 9 ? GRAPH : function < 15 ? ENGINE : LIVE;
    void *it = any_handle(chance, kind);
    union {
        AsperityGraph *graph;
        AsperityEngine *engine;
        AsperityLive *live;
        void *any;
    } made = { 0 };
    AsperityHand hand = {
        .position_mm = { any_number(chance), any_number(chance), any_number(chance) },
        .force_n = any_number(chance),
        .stroke = (uint32_t)draw(chance) % 3,
    };
    const AsperityHand *maybe = one_in(chance, 4) ? NULL : &hand;
    double three[3] = { any_number(chance), any_number(chance), any_number(chance) };
    size_t count = 0;
    union {
        AsperityGraphInfo info;
        AsperityFigures figures;
        AsperityForce force;
    } to;
    int none = one_in(chance, 10);
    AsperityStatus status = ASPERITY_OK;
    switch (function) {
    case 0:
        // Rarely: it compiles a whole texture.
        if (!one_in(chance, 8)) {
            return asperity_graph_parse(any_text(chance), any_text(chance), none ? NULL : &made.graph);
        }
        status = asperity_graph_open(one_in(chance, 3) ? any_text(chance) : path, &made.graph);
        break;
    case 1:
        status = asperity_graph_parse(tone, NULL, &made.graph);
        break;
    case 2:
        status = asperity_engine_new(it, (uint32_t)draw(chance) % 3, none ? NULL : &made.engine);
        break;
    case 3:
        status = asperity_live_new(it, (uint32_t)draw(chance) % 3, none ? NULL : &made.live);
        break;
    case 4:
        return asperity_graph_set(it, any_text(chance), any_text(chance));
    case 5:
        return asperity_graph_stroke(it, any_text(chance));
    case 6:
        return asperity_graph_probe(it, any_text(chance));
    case 7:
        return asperity_graph_info(it, none ? NULL : &to.info);
    case 8:
        return asperity_graph_warnings(it) ? ASPERITY_OK : ASPERITY_INVALID;
    case 9:
    case 10:
        return asperity_engine_tick(it, maybe, none ? NULL : room, draw(chance) % ROOM, none ? NULL : &count);
    case 11:
        return asperity_engine_force(it, none ? NULL : &to.force);
    case 12:
        return asperity_engine_read(it, any_text(chance), none ? NULL : room, draw(chance) % ROOM, &count);
    case 13:
        return one_in(chance, 10) ? asperity_engine_reset(it) : ASPERITY_OK;
    case 14:
        return asperity_engine_faults(it) ? ASPERITY_OK : ASPERITY_INVALID;
    case 15:
    case 16:
        return asperity_live_pull(it, none ? NULL : room, draw(chance) % (ROOM / 2), 1 + one_in(chance, 9));
    case 17:
        return asperity_live_push(it, maybe, one_in(chance, 4) ? draw(chance) : 0);
    case 18:
        return asperity_live_force(it, none ? NULL : &to.force);
    case 19:
        return asperity_live_servo(it, none ? NULL : three, three);
    case 20:
        return asperity_live_set(it, any_text(chance), any_text(chance));
    case 21:
        return asperity_live_swap(it, any_handle(chance, GRAPH));
    case 22:
        asperity_live_mute(it, (uint32_t)draw(chance) % 2);
        return asperity_live_strength(it, any_number(chance) / 40);
    default:
        if (!asperity_live_faults(it)) {
            return ASPERITY_INVALID;
        }
        return asperity_live_figures(it, none ? NULL : &to.figures);
    }
    if (made.any) {
        keep(chance, function == 2 ? ENGINE : function == 3 ? LIVE : GRAPH, made.any);
    }
    return status;
}

static void *caller(void *seed)
{
    struct chance chance = { .state = (uint64_t)(uintptr_t)seed * 0x9e3779b97f4a7c15u + 1 };
    float *room = calloc(ROOM, sizeof *room);
    for (uint64_t i = 0; i < calls; i++) {
        AsperityStatus status = call(&chance, room);
        if (status < ASPERITY_OK || status > ASPERITY_FAILED) {
            fprintf(stderr, "call %llu answered %d\n", (unsigned long long)i, status);
            abort();
        }
        atomic_fetch_add(&answered[status], 1);
        if (status == ASPERITY_FAILED || (status != ASPERITY_OK && !*asperity_last_error())) {
            // Nothing here makes the machine fail.
            fprintf(stderr, "call %llu failed: %s\n", (unsigned long long)i, asperity_last_error());
            abort();
        }
    }
    free(room);
    return NULL;
}

int main(int argc, char **argv)
{
    if (argc < 2) {
        fprintf(stderr, "wrong GRAPH.ron [SEED] [CALLS]\n");
        return 2;
    }
    path = argv[1];
    uint64_t seed = argc > 2 ? strtoull(argv[2], NULL, 10) : 1;
    calls = argc > 3 ? strtoull(argv[3], NULL, 10) : 3000;
    if (asperity_check_version(ASPERITY_VERSION_MAJOR, ASPERITY_VERSION_MINOR) != ASPERITY_OK) {
        return 1;
    }
    pthread_t threads[THREADS];
    for (uint64_t i = 0; i < THREADS; i++) {
        if (pthread_create(&threads[i], NULL, caller, (void *)(uintptr_t)(seed * THREADS + i)) != 0) {
            return 1;
        }
    }
    for (int i = 0; i < THREADS; i++) {
        pthread_join(threads[i], NULL);
    }
    struct chance last = { .state = 1 };
    for (unsigned i = 0; i < 20 * KINDS * HANDLES; i++) {
        keep(&last, i % KINDS, NULL);
    }
    printf("seed %llu: %llu calls done, %llu invalid, %llu busy\n", (unsigned long long)seed,
        (unsigned long long)atomic_load(&answered[ASPERITY_OK]),
        (unsigned long long)atomic_load(&answered[ASPERITY_INVALID]),
        (unsigned long long)atomic_load(&answered[ASPERITY_BUSY]));
    return atomic_load(&answered[ASPERITY_OK]) > 0 ? 0 : 1;
}
