/* Runs the plant that was included before: of each run the number of ticks, rate, seed, repeat, then V and A of each tick;
   answers after the start and after each tick: filtered rate, rate and angle of the shaft. */

#include "bare.h"

static int answer(void)
{
    double now[3];
    now[0] = plant_rate();
    now[1] = plant_shaft_rate();
    now[2] = plant_shaft_angle();
    return give(now, sizeof now);
}

static int run(void)
{
    double given[4], held[2];
    while (take(given, sizeof given)) {
        plant_start(given[1], given[2], given[3]);
        if (!answer()) return 1;
        for (double k = 0.0; k < given[0]; k += 1.0) {
            if (!take(held, sizeof held)) return 2;
            plant_tick(held[0], held[1]);
            if (!answer()) return 1;
        }
    }
    return 0;
}
