// Plays a graph through JACK: JACK's thread pulls the audio, the main thread moves the stylus.
//
//     pull_jack GRAPH.ron [SECONDS]
//
// Build: cc pull_jack.c $(pkg-config --cflags --libs asperity jack) -lm
#define _POSIX_C_SOURCE 200809L
#include <asperity.h>
#include <jack/jack.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MOST = 8 };

static AsperityLive *live;
static jack_port_t *ports[MOST];
static uint32_t channels;
static float *block;
static jack_nframes_t most;

static void ok(AsperityStatus status)
{
    if (status != ASPERITY_OK) {
        fprintf(stderr, "%s\n", asperity_last_error());
        exit(1);
    }
}

// JACK's thread. JACK has a buffer for each channel, Asperity one for all.
static int process(jack_nframes_t frames, void *arg)
{
    (void)arg;
    if (frames > most) {
        return 1;
    }
    asperity_live_pull(live, block, frames, channels);
    for (uint32_t channel = 0; channel < channels; channel++) {
        float *out = jack_port_get_buffer(ports[channel], frames);
        for (jack_nframes_t i = 0; i < frames; i++) {
            out[i] = block[i * channels + channel];
        }
    }
    return 0;
}

int main(int argc, char **argv)
{
    if (argc < 2) {
        fprintf(stderr, "pull_jack GRAPH.ron [SECONDS]\n");
        return 2;
    }
    double seconds = argc > 2 ? atof(argv[2]) : 10;
    ok(asperity_check_version(ASPERITY_VERSION_MAJOR, ASPERITY_VERSION_MINOR));
    jack_client_t *client = jack_client_open("asperity", JackNoStartServer, NULL);
    if (!client) {
        fprintf(stderr, "there is no JACK server: start one, for example `jackd -d alsa`\n");
        return 1;
    }

    // The graph takes the rate of the device.
    char rate[16];
    snprintf(rate, sizeof rate, "%u", jack_get_sample_rate(client));
    AsperityGraph *graph;
    ok(asperity_graph_open(argv[1], &graph));
    ok(asperity_graph_set(graph, "audio_hz", rate));
    AsperityGraphInfo info;
    ok(asperity_graph_info(graph, &info));
    channels = info.channels;
    most = 8192;
    block = malloc(sizeof *block * most * channels);
    if (channels > MOST || !block) {
        fprintf(stderr, "%u channels are too many\n", channels);
        return 1;
    }
    ok(asperity_live_new(graph, ASPERITY_HAND, &live));

    for (uint32_t channel = 0; channel < channels; channel++) {
        char name[16];
        snprintf(name, sizeof name, "out_%u", channel + 1);
        ports[channel] = jack_port_register(client, name, JACK_DEFAULT_AUDIO_TYPE, JackPortIsOutput, 0);
    }
    jack_set_process_callback(client, process, NULL);
    if (jack_activate(client) != 0) {
        fprintf(stderr, "JACK does not run this client\n");
        return 1;
    }
    const char **device = jack_get_ports(client, NULL, JACK_DEFAULT_AUDIO_TYPE, JackPortIsInput | JackPortIsPhysical);
    for (uint32_t channel = 0; device && channel < channels && device[channel]; channel++) {
        jack_connect(client, jack_port_name(ports[channel]), device[channel]);
    }
    jack_free(device);

    // Four samples of the stylus in a hundredth of a second: to and fro, 2 mm deep.
    double loudest = 0;
    AsperityFigures figures = { 0 };
    uint64_t began = asperity_now_ns();
    for (int i = 1;; i++) {
        double t = (double)(asperity_now_ns() - began) * 1e-9;
        if (t > seconds) {
            break;
        }
        AsperityHand hand = { .position_mm = { 40 * sin(3 * t), 0, -2 } };
        asperity_live_push(live, &hand, 0);
        if (i % 40 == 0) {
            ok(asperity_live_figures(live, &figures));
            loudest = fmax(loudest, figures.peak);
        }
        nanosleep(&(struct timespec){ .tv_nsec = 2500000 }, NULL);
    }
    ok(asperity_live_figures(live, &figures));
    printf("%llu ticks, %llu deadline misses, %llu gaps, loudest %.4f of full scale, tick p99 %.0f us\n",
        (unsigned long long)figures.ticks, (unsigned long long)figures.deadline_misses,
        (unsigned long long)figures.gaps, loudest, figures.tick_p99_us);
    printf("%s", asperity_live_faults(live));

    // JACK goes on pulling, so that the ramp down is heard.
    ok(asperity_live_free(live));
    jack_client_close(client);
    ok(asperity_graph_free(graph));
    free(block);
    return figures.ticks > 0 && loudest > 0 ? 0 : 1;
}
