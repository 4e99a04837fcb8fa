#include "guard.h"

int64_t guard_heat(const guard_heat_config *config, int64_t heat, int32_t current)
{
    const int64_t gained = ((int64_t)current * current) - config->continuous;
    int64_t after;
    if (gained > config->most - heat) {
        after = config->most + 1; /* as hot as can be told, so that no sum overflows */
    } else if (gained < -heat) {
        after = 0;
    } else {
        after = heat + gained;
    }
    return after;
}

void guard_tachometer_start(guard_tachometer *guard)
{
    guard->sum = 0;
    guard->way_sum = 0;
    guard->start = 0;
    guard->way = 0;
    guard->ticks = 0u;
    guard->suspicious = 0u;
}

static int64_t size(int64_t value)
{
    return (value < 0) ? -value : value;
}

guard_verdict guard_tachometer_tick(guard_tachometer *guard, const guard_tachometer_config *config, int32_t voltage,
                                    int32_t current, int32_t rate)
{
    int64_t drive = (config->voltage * voltage) - (config->back_emf * rate);
    if (drive > config->most) {
        drive = config->most;
    } else if (drive < -config->most) {
        drive = -config->most;
    } else {
        /* within what the drive can */
    }
    const int64_t load = config->current * current;
    const int64_t net = drive + load - (config->viscous * rate);
    const int64_t unsure = config->friction + ((config->tolerance * (size(drive) + size(load))) / 256);
    const int64_t one = (int64_t)1 << config->bits;
    const int64_t wanted = config->change * one;
    const int64_t sure = (net * guard->way) - unsure; /* below 0: so much of the change may have gone again */
    const int64_t after = guard->way_sum + sure;

    if ((config->change <= 0) || (guard->way == 0) || (after <= 0)) {
        guard_tachometer_start(guard);
        guard->way = (size(net) <= unsure) ? 0 : ((net > 0) ? 1 : -1);
        guard->way_sum = size(net) - unsure;
        return GUARD_SOUND;
    }
    guard->way_sum = (after < wanted) ? after : wanted;
    if (guard->ticks < config->lag) {
        guard->ticks++;
        guard->start = rate;
        return GUARD_SOUND;
    }
    guard->sum += sure;
    if (guard->sum < wanted) {
        guard->suspicious = 0u;
        return GUARD_SOUND;
    }
    const int64_t read = ((int64_t)rate - guard->start) * guard->way * one;
    if (read >= guard->sum / 4) {
        guard->sum = 0;
        guard->start = rate;
        guard->suspicious = 0u;
        return GUARD_SOUND;
    }
    guard->suspicious++;
    if (guard->suspicious < config->lag) {
        return GUARD_SOUND;
    }
    return (read > -(wanted / 4)) ? GUARD_DEAD : GUARD_REVERSED;
}
