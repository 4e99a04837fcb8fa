/* A bed for tests, by hand: an inertia with viscous and dry friction, a drive motor behind a resistance, a filter of
   order 1. */
#include "plant.h"

#ifndef PERIOD
#define PERIOD 0.001
#endif

static const double inertia = 6.38e-5, kt = 0.061, resistance = 2.05, tau_max = 0.144, kt_load = 0.072, f_v = 2.58e-5,
                    f_c = 0.0205, lag = 0.003;
static double rate, angle, filtered, noise;

const double plant_period = PERIOD;

void plant_start(double at, double seed, double repeat)
{
    rate = at;
    filtered = at;
    angle = 0.0;
    noise = seed * 0.5 + repeat * 0.25; /* no noise, but both can be seen in the rate */
}

void plant_tick(double voltage, double current)
{
    double torque = kt / resistance * (voltage - kt * rate);
    torque = (torque > tau_max) ? tau_max : ((torque < -tau_max) ? -tau_max : torque);
    const double smooth = torque + kt_load * current - f_v * rate;
    const double way = (rate > 0.0) ? 1.0 : ((rate < 0.0) ? -1.0 : ((smooth > 0.0) ? 1.0 : -1.0));
    if (rate == 0.0 && way * smooth <= f_c) {
        return;
    }
    const double after = rate + (smooth - way * f_c) / inertia * PERIOD;
    angle += 0.5 * (rate + after) * PERIOD;
    rate = (way * after < 0.0) ? 0.0 : after;
    filtered += (rate - filtered) * (PERIOD / lag);
}

double plant_rate(void)
{
    return filtered + noise;
}

double plant_shaft_rate(void)
{
    return rate;
}

double plant_shaft_angle(void)
{
    return angle;
}
