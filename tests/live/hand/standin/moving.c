/* The stand-in with a hand on it that goes round in the wall by itself: 16 mm around at 100 mm/s, 3 mm deep (the device's y is up). */
#include "hd.c"
#include <math.h>

static void *go_round(void *unused) {
    (void)unused;
    struct timespec now, pause = { 0, 1000000 };
    for (;;) {
        clock_gettime(CLOCK_MONOTONIC, &now);
        double turn = fmod((double)now.tv_sec + (double)now.tv_nsec * 1e-9, 1000.0) * 100.0 / 16.0;
        standin_move(16.0 * cos(turn), -3.0, 16.0 * sin(turn));
        nanosleep(&pause, NULL);
    }
    return NULL;
}

__attribute__((constructor)) static void begin(void) {
    pthread_t hand;
    if (pthread_create(&hand, NULL, go_round, NULL) == 0) pthread_detach(hand);
}
