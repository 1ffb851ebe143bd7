// For Octave and MATLAB: samples = asperity_render (graph, positions, name, value, ...)
//
// `positions` has a row [x y z] in mm for each tick. `samples` has a row for each channel. Further arguments are
// settings of the graph, such as "texture.material", "oak".
//
// Build: mkoctfile --mex asperity_render.c -lasperity; in MATLAB: mex asperity_render.c -lasperity
#include <asperity.h>
#include <mex.h>

static AsperityGraph *graph;
static AsperityEngine *engine;

static void clean(void)
{
    asperity_engine_free(engine);
    asperity_graph_free(graph);
    engine = NULL;
    graph = NULL;
}

static void ok(AsperityStatus status)
{
    if (status != ASPERITY_OK) {
        clean();
        mexErrMsgIdAndTxt("asperity:error", "%s", asperity_last_error());
    }
}

void mexFunction(int results, mxArray *result[], int count, const mxArray *arg[])
{
    (void)results;
    if (count < 2 || count % 2 || !mxIsChar(arg[0]) || !mxIsDouble(arg[1]) || mxGetN(arg[1]) != 3) {
        mexErrMsgIdAndTxt("asperity:usage", "asperity_render (graph, positions [n x 3], name, value, ...)");
    }
    ok(asperity_check_version(ASPERITY_VERSION_MAJOR, ASPERITY_VERSION_MINOR));
    char *path = mxArrayToString(arg[0]);
    ok(asperity_graph_open(path, &graph));
    for (int i = 2; i < count; i += 2) {
        char *name = mxArrayToString(arg[i]), *value = mxArrayToString(arg[i + 1]);
        ok(asperity_graph_set(graph, name, value));
        mxFree(name);
        mxFree(value);
    }
    mxFree(path);
    AsperityGraphInfo info;
    ok(asperity_graph_info(graph, &info));
    ok(asperity_engine_new(graph, ASPERITY_HAND, &engine));

    size_t ticks = mxGetM(arg[1]), room = (size_t)info.tick_frames * info.channels, done = 0;
    const double *positions = mxGetPr(arg[1]);
    mxArray *samples = mxCreateNumericMatrix(info.channels, ticks * info.tick_frames, mxSINGLE_CLASS, mxREAL);
    float *out = mxGetData(samples);
    for (size_t i = 0; i < ticks; i++) {
        AsperityHand hand = { .position_mm = { positions[i], positions[ticks + i], positions[2 * ticks + i] } };
        size_t frames;
        ok(asperity_engine_tick(engine, &hand, out + done * info.channels, room, &frames));
        done += frames;
    }
    mxSetN(samples, done);
    result[0] = samples;
    clean();
}
