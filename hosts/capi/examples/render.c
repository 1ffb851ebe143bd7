// Renders a graph as fast as possible, tick by tick: the same samples as `asperity render`.
//
//     render GRAPH.ron STROKE.csv OUT.f32     a recorded stroke; "-" for the graph's own
//     render GRAPH.ron hand OUT.f32           two seconds of a stroke that this program makes
//
// OUT.f32 gets raw 32-bit floats, interleaved.
#include <asperity.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void ok(AsperityStatus status)
{
    if (status != ASPERITY_OK) {
        fprintf(stderr, "%s\n", asperity_last_error());
        exit(1);
    }
}

int main(int argc, char **argv)
{
    if (argc != 4) {
        fprintf(stderr, "render GRAPH.ron STROKE.csv|-|hand OUT.f32\n");
        return 2;
    }
    ok(asperity_check_version(ASPERITY_VERSION_MAJOR, ASPERITY_VERSION_MINOR));
    AsperityGraph *graph;
    ok(asperity_graph_open(argv[1], &graph));
    int by_hand = strcmp(argv[2], "hand") == 0;
    if (!by_hand && strcmp(argv[2], "-") != 0) {
        ok(asperity_graph_stroke(graph, argv[2]));
    }
    AsperityGraphInfo info;
    ok(asperity_graph_info(graph, &info));
    AsperityEngine *engine;
    ok(asperity_engine_new(graph, by_hand ? ASPERITY_HAND : ASPERITY_STROKE, &engine));

    size_t room = (size_t)info.tick_frames * info.channels;
    float *samples = malloc(room * sizeof *samples);
    FILE *file = fopen(argv[3], "wb");
    if (!samples || !file) {
        perror(argv[3]);
        return 1;
    }
    uint64_t ticks = by_hand ? 2 * (uint64_t)info.tick_hz : info.stroke_ticks;
    for (uint64_t i = 0; i < ticks; i++) {
        double t = (double)i / info.tick_hz;
        // 2 mm deep in the surface, to and fro.
        AsperityHand hand = { .position_mm = { 40 * sin(3 * t), 0, -2 } };
        size_t frames;
        ok(asperity_engine_tick(engine, by_hand ? &hand : NULL, samples, room, &frames));
        if (fwrite(samples, sizeof *samples, frames * info.channels, file) != frames * info.channels) {
            perror(argv[3]);
            return 1;
        }
    }
    if (*asperity_engine_faults(engine)) {
        fprintf(stderr, "warning: %s\n", asperity_engine_faults(engine));
    }
    free(samples);
    ok(asperity_engine_free(engine));
    ok(asperity_graph_free(graph));
    return fclose(file) == 0 ? 0 : 1;
}
