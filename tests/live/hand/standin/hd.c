/* A stand-in for the maker's libHD: a scheduler thread at about 1 kHz, a hand that the test moves, and errors on demand.
   Written from the published interface. Built by the tests; -DWITHOUT_UNSCHEDULE leaves one function out. */
#include <pthread.h>
#include <stdatomic.h>
#include <stddef.h>
#include <time.h>

typedef struct { unsigned code; int internal; unsigned device; } ErrorInfo;
typedef unsigned (*Callback)(void *);

static _Atomic unsigned pending, always;
static _Atomic int unplugged, opened, output, frames, hung;
static _Atomic unsigned long rate, begun;
static _Atomic double position[3], made[3], worst_step;
static atomic_int untold;
static _Atomic(Callback) scheduled;
static void *_Atomic user;
static void (*_Atomic wrap)(Callback, void *, unsigned *);
static atomic_int run;
static pthread_t thread;

/* What a test does. */
void standin_plug(int there) { unplugged = !there; }
void standin_error_once(unsigned code) { pending = code; }
void standin_error_always(unsigned code) { always = code; }
void standin_hang(int on) { hung = on; }
void standin_untold(int on) { untold = on; }
void standin_move(double x, double y, double z) { position[0] = x; position[1] = y; position[2] = z; }
void standin_force(double *out) { for (int i = 0; i < 3; i++) out[i] = made[i]; }
double standin_worst_step(void) { return worst_step; }
void standin_forget(void) { worst_step = 0; }
double standin_open(void) { return opened; }
double standin_output(void) { return output; }
double standin_scheduled(void) { return scheduled != NULL; }
double standin_frames(void) { return frames; }
double standin_rate(void) { return rate; }
void standin_wrap(void (*with)(Callback, void *, unsigned *)) { wrap = with; }

/* The interface. */
unsigned hdInitDevice(const char *name) {
    if (unplugged || (name && name[0] != 'T')) { pending = 0x302; return 0xFFFFFFFFu; }
    opened++;
    begun = 0;
    return 7;
}
void hdDisableDevice(unsigned d) { if (d == 7 && opened) opened--; output = 0; }
void hdMakeCurrentDevice(unsigned d) { (void)d; }
void hdBeginFrame(unsigned d) { if (d != 7 || begun) pending = 0x400; begun = 1; }
void hdEndFrame(unsigned d) {
    if (d != 7 || !begun) pending = 0x401;
    begun = 0;
    frames++;
    if (unplugged) pending = 0x302;
    if (always) pending = always;
}
void hdGetDoublev(unsigned what, double *out) {
    if (what == 0x2050 && begun) for (int i = 0; i < 3; i++) out[i] = position[i];
    else if (what == 0x2603 && untold == 0) out[0] = 3.3;
    else if (what == 0x2602 && untold == 0) out[0] = 0.5;
    else pending = 0x100;
}
void hdSetDoublev(unsigned what, const double *in) {
    if (what != 0x2700 || !begun || !output) { pending = 0x102; return; }
    double step = 0;
    for (int i = 0; i < 3; i++) { double d = in[i] - made[i]; step += d * d; made[i] = in[i]; }
    if (step > worst_step * worst_step) worst_step = __builtin_sqrt(step);
}
void hdEnable(unsigned what) { if (what == 0x4000) output = 1; }
ErrorInfo hdGetError(void) { ErrorInfo e = { atomic_exchange(&pending, 0u), -1, 7 }; return e; }
const char *hdGetErrorString(unsigned code) { return code == 0x302 ? "communication error between host and device" : NULL; }
void hdSetSchedulerRate(unsigned long hz) { rate = hz; }

static void *loop(void *unused) {
    (void)unused;
    struct timespec next;
    clock_gettime(CLOCK_MONOTONIC, &next);
    while (run) {
        Callback callback = scheduled;
        if (callback && !hung) {
            unsigned answer = 0;
            void (*with)(Callback, void *, unsigned *) = wrap;
            if (with) with(callback, user, &answer); else answer = callback(user);
            if (answer == 0) scheduled = NULL;
        }
        next.tv_nsec += 1000000;
        if (next.tv_nsec >= 1000000000) { next.tv_nsec -= 1000000000; next.tv_sec++; }
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, NULL);
    }
    return NULL;
}
void hdStartScheduler(void) { if (!atomic_exchange(&run, 1)) pthread_create(&thread, NULL, loop, NULL); }
void hdStopScheduler(void) { if (atomic_exchange(&run, 0)) pthread_join(thread, NULL); }
unsigned long hdScheduleAsynchronous(Callback callback, void *with, unsigned short priority) {
    if (priority != 32767) pending = 0x500;
    user = with;
    scheduled = callback;
    return 42;
}
#ifndef WITHOUT_UNSCHEDULE
void hdUnschedule(unsigned long handle) { if (handle != 42 || !scheduled) pending = 0x101; scheduled = NULL; }
#endif
