#include "interlock.h"

#include <stddef.h>

/* What the read-back follows: either amplifier enabled. */
#define ENABLES (INTERLOCK_LOAD_ENABLE | INTERLOCK_DRIVE_ENABLE)

static void set_lines(interlock *self, const interlock_config *config, uint32_t lines)
{
    if (((self->lines & ENABLES) == 0u) != ((lines & ENABLES) == 0u)) {
        self->since_lines = 0u;
    }
    self->lines = lines;
    config->port->set(lines);
}

static void compare_anew(interlock *self)
{
    self->compared = 0u;
    self->path = 0;
    self->load_off = 0u;
}

void interlock_boot(interlock *self, const interlock_config *config)
{
    self->lines = 0u;
    self->since_lines = 0u;
    self->since_armed = config->hold;
    self->had_open = false;
    self->permitted = false;
    self->drive_heat = config->drive_heat.most;
    self->angle = 0;
    self->rate = 0;
    self->clock = 0u;
    self->beats = 0u;
    self->stood = 0u;
    self->begun = false;
    compare_anew(self);
    config->port->set(0u);
}

static int64_t size(int64_t value)
{
    return (value < 0) ? -value : value;
}

/* The key lets the bed arm once it has been opened and closed. */
static bool is_permitted(interlock *self, const interlock_config *config, uint32_t closed)
{
    if ((closed & INTERLOCK_KEY) == 0u) {
        self->had_open = true;
        self->permitted = false;
    } else if (self->had_open) {
        self->had_open = false;
        self->permitted = true;
    } else {
        /* as it was */
    }
    return self->permitted || !config->needs_key;
}

static bool is_read_back(interlock *self, const interlock_config *config, uint32_t closed)
{
    const bool told = (self->lines & ENABLES) != 0u;
    const bool found = (closed & INTERLOCK_ENABLED) != 0u;
    if (self->since_lines < config->settle) {
        self->since_lines++;
        return true;
    }
    return (config->settle == 0u) || (told == found);
}

/* Over `span` ticks the encoder has gone as far as the tachometer's rates add up to: within an eighth, twice what the
   filter holds back while the rate changes, and the floor. */
static bool encoder_agrees(interlock *self, const interlock_config *config, const port_sensors *sensors)
{
    if (config->span == 0u) {
        return true;
    }
    if (self->compared == 0u) {
        self->angle = sensors->angle;
        self->rate = sensors->rate;
        self->path = 0;
        self->compared = 1u;
        return true;
    }
    self->path += (int64_t)config->path * sensors->rate;
    self->compared++;
    if (self->compared <= config->span) {
        return true;
    }
    self->compared = 0u;
    /* the way round that is the shorter one */
    const uint32_t turned = (uint32_t)sensors->angle - (uint32_t)self->angle;
    const int64_t went = (turned <= (uint32_t)INT32_MAX) ? (int64_t)turned : ((int64_t)turned - 4294967296);
    const int64_t told = self->path / 65536;
    const int64_t further = (size(went) > size(told)) ? size(went) : size(told);
    const int64_t change = size((int64_t)sensors->rate - self->rate);
    const int64_t held = (change * config->path * (int64_t)config->lag) / 32768;
    return size(went - told) <= (further / 8) + held + config->floor;
}

static bool load_follows(interlock *self, const interlock_config *config, int32_t measured, int32_t command)
{
    const bool off = size((int64_t)measured - command) > config->load_off;
    self->load_off = off ? (self->load_off + 1u) : 0u;
    return (config->load_ticks == 0u) || (self->load_off < config->load_ticks);
}

/* Whether tick and main program keep time, by the port's other clock. */
static uint32_t late(interlock *self, const interlock_config *config, const interlock_inputs *inputs)
{
    uint32_t reasons = 0u;
    if (self->begun) {
        const uint32_t passed = inputs->clock - self->clock;
        if ((config->longest != 0u) && ((passed < config->shortest) || (passed > config->longest))) {
            reasons |= INTERLOCK_BY_TICK;
        }
        self->stood = (inputs->beats == self->beats) ? (self->stood + 1u) : 0u;
        if ((config->stand != 0u) && (self->stood >= config->stand)) {
            reasons |= INTERLOCK_BY_MAIN;
            self->stood = config->stand;
        }
    }
    self->begun = true;
    self->clock = inputs->clock;
    self->beats = inputs->beats;
    return reasons;
}

static uint32_t when(bool wrong, uint32_t reason)
{
    return wrong ? reason : 0u;
}

uint32_t interlock_tick(interlock *self, const interlock_config *config, bool armed, const port_sensors *sensors,
                        int32_t load_command)
{
    interlock_inputs inputs = {0u, 0, 0, 0u, 0u, false};
    config->port->read(&inputs);
    const uint32_t closed = inputs.lines;
    uint32_t reasons = late(self, config, &inputs);
    reasons |= when((closed & INTERLOCK_STOP) == 0u, INTERLOCK_BY_STOP);
    reasons |= when((closed & INTERLOCK_READY) == 0u, INTERLOCK_BY_READY);
    reasons |= when(!is_read_back(self, config, closed), INTERLOCK_BY_READ_BACK);
    reasons |= when(!is_permitted(self, config, closed), INTERLOCK_BY_KEY);
    reasons |= when((closed & INTERLOCK_CONVERTER) == 0u, INTERLOCK_BY_CONVERTER);
    self->drive_heat = guard_heat(&config->drive_heat, self->drive_heat, sensors->drive_current);
    reasons |= when(self->drive_heat > config->drive_heat.most, INTERLOCK_BY_DRIVE_HEAT);
    reasons |= when(inputs.temperature > config->warmest, INTERLOCK_BY_TEMPERATURE);
    reasons |= when((inputs.bus < config->bus_least) || (inputs.bus > config->bus_most), INTERLOCK_BY_BUS);
    if (config->angle_least <= config->angle_most) {
        reasons |= when((sensors->angle < config->angle_least) || (sensors->angle > config->angle_most),
                        INTERLOCK_BY_ANGLE);
    }
    reasons |= when(inputs.lost_step || !encoder_agrees(self, config, sensors), INTERLOCK_BY_ENCODER);
    if (armed) {
        self->since_armed = 0u;
        reasons |= when(!load_follows(self, config, sensors->load_current, load_command), INTERLOCK_BY_LOAD);
    } else if (self->since_armed < config->hold) {
        self->since_armed++;
    } else {
        /* held for long enough */
    }
    return reasons;
}

uint32_t interlock_latching(uint32_t reasons)
{
    return reasons & (INTERLOCK_BY_STOP | INTERLOCK_BY_READY | INTERLOCK_BY_READ_BACK | INTERLOCK_BY_CONVERTER |
                      INTERLOCK_BY_TICK | INTERLOCK_BY_MAIN);
}

bool interlock_may_clear(const interlock *self, const interlock_config *config, uint32_t reasons, uint32_t latched)
{
    const bool cooled = self->drive_heat <= config->drive_heat.most / 2;
    return ((reasons & ~INTERLOCK_BY_KEY) == 0u) && (cooled || ((latched & INTERLOCK_BY_DRIVE_HEAT) == 0u));
}

void interlock_arm(interlock *self, const interlock_config *config)
{
    compare_anew(self);
    self->since_armed = 0u;
    set_lines(self, config, ENABLES | INTERLOCK_BRAKE_RELEASE);
}

void interlock_rest(interlock *self, const interlock_config *config, int32_t rate)
{
    const bool slow = (rate <= config->slow) && (rate >= -config->slow);
    if (slow || (self->since_armed >= config->hold) || ((self->lines & INTERLOCK_DRIVE_ENABLE) == 0u)) {
        set_lines(self, config, 0u);
    } else {
        set_lines(self, config, INTERLOCK_DRIVE_ENABLE | INTERLOCK_BRAKE_RELEASE);
    }
}

void interlock_withdraw(interlock *self)
{
    self->permitted = false;
    self->had_open = false;
}
