// A device that pushes back, with a loop of its own at 1 kHz: it reads its position, gives it to the graph, and
// renders the force of the surface. The stylus is a simulated mass that falls on the surface and is dragged
// over it; another thread pulls the audio, as a sound card does.
//
//     servo GRAPH.ron [SECONDS]      a graph that pushes back, such as graphs/haply.ron
#include <asperity.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <thread>
#include <vector>

namespace {

void ok(AsperityStatus status)
{
    if (status != ASPERITY_OK) {
        throw std::runtime_error(asperity_last_error());
    }
}

using Vector = std::array<double, 3>;

// A mass of 100 g that a hand presses down with 1 N, and leads to and fro.
struct Stylus {
    Vector position_mm{0, 0, 5};
    double speed_mm_s = 0;

    void step(double t, double dt, const Vector &force_n)
    {
        double newtons = force_n[2] - 1.0 - 2e-3 * speed_mm_s;
        speed_mm_s += newtons / 0.1 * 1e3 * dt;
        position_mm[2] += speed_mm_s * dt;
        position_mm[0] = 40 * std::sin(3 * t);
    }
};

int run(const char *path, double seconds)
{
    ok(asperity_check_version(ASPERITY_VERSION_MAJOR, ASPERITY_VERSION_MINOR));
    AsperityGraph *graph = nullptr;
    ok(asperity_graph_open(path, &graph));
    AsperityGraphInfo info{};
    ok(asperity_graph_info(graph, &info));
    AsperityLive *live = nullptr;
    ok(asperity_live_new(graph, ASPERITY_HAND, &live));

    std::atomic<bool> over{false};
    std::thread audio([&] {
        const std::size_t frames = info.audio_hz / 1000;
        std::vector<float> block(frames * info.channels);
        auto next = std::chrono::steady_clock::now();
        while (!over.load(std::memory_order_relaxed)) {
            // A sound card would play the block. After an error it is silent.
            asperity_live_pull(live, block.data(), frames, info.channels);
            std::this_thread::sleep_until(next += std::chrono::milliseconds(1));
        }
    });

    Stylus stylus;
    Vector force_n{};
    AsperityForce surface{};
    double most_n = 0;
    const double dt = 1e-3;
    auto next = std::chrono::steady_clock::now();
    for (double t = 0; t < seconds; t += dt) {
        stylus.step(t, dt, force_n);
        AsperityHand hand{};
        std::copy(stylus.position_mm.begin(), stylus.position_mm.end(), hand.position_mm);
        hand.force_n = force_n[2];
        asperity_live_push(live, &hand, 0);
        // The force on the stylus now; a device with a law of its own takes the surface instead.
        asperity_live_servo(live, stylus.position_mm.data(), force_n.data());
        asperity_live_force(live, &surface);
        most_n = std::max(most_n, force_n[2]);
        std::this_thread::sleep_until(next += std::chrono::milliseconds(1));
    }

    AsperityFigures figures{};
    ok(asperity_live_figures(live, &figures));
    std::printf("at rest %.2f mm deep in a surface of %.2f N/mm with %.2f N (most %.2f N); %llu ticks, %s\n",
        -stylus.position_mm[2], surface.stiffness_n_per_mm, force_n[2], most_n,
        static_cast<unsigned long long>(figures.ticks), figures.faults ? asperity_live_faults(live) : "no fault");
    ok(asperity_live_free(live));
    over = true;
    audio.join();
    ok(asperity_graph_free(graph));
    return figures.ticks > 0 && most_n > 0 ? 0 : 1;
}

} // namespace

int main(int argc, char **argv)
{
    if (argc < 2) {
        std::fprintf(stderr, "servo GRAPH.ron [SECONDS]\n");
        return 2;
    }
    try {
        return run(argv[1], argc > 2 ? std::atof(argv[2]) : 3);
    } catch (const std::exception &e) {
        std::fprintf(stderr, "%s\n", e.what());
        return 1;
    }
}
