#include "board.h"

#include "plant.h"

static bed the_bed;
static int32_t held_voltage, held_current;
static double seed, repeat;

void (*board_listener)(char output, int32_t counts);

/* The nearest whole number, halves to the even one, as `rint`: beyond 2^52 a double has no fraction. */
static double nearest(double value)
{
    const double one = 6755399441055744.0; /* 1.5 * 2^52 */
    return (value + one) - one;
}

/* Counts of a value; at their ends where it is beyond them, and where it is not a number. */
static int32_t counted(double value, double scale)
{
    const double counts = value / scale;
    int32_t answer = BED_RATE_UNKNOWN;
    if ((counts >= -2147483647.0) && (counts <= 2147483646.0)) {
        answer = (int32_t)nearest(counts);
    } else if (counts < 0.0) {
        answer = INT32_MIN;
    } else {
        /* BED_RATE_UNKNOWN */
    }
    return answer;
}

/* Counts of an angle, which goes round at their ends; 0 beyond 2^51 of them, where none are left. */
static int32_t counted_round(double value, double scale)
{
    const double counts = value / scale;
    uint32_t bits = 0u;
    if ((counts > -2251799813685248.0) && (counts < 2251799813685248.0)) {
        bits = (uint32_t)((uint64_t)(int64_t)nearest(counts) & 0xFFFFFFFFu);
    }
    return (bits <= (uint32_t)INT32_MAX) ? (int32_t)bits : (-(int32_t)(UINT32_MAX - bits) - 1);
}

static void advance(void)
{
    plant_tick((double)held_voltage * board_scale.voltage, (double)held_current * board_scale.current);
}

static bool preset(uint8_t which, uint64_t bits)
{
    union {
        uint64_t bits;
        double value;
    } const told = {.bits = bits};
    bool possible = (told.value - told.value) == 0.0; /* neither infinite nor not a number */
    if (possible) {
        switch (which) {
        case 0u:
            plant_start(told.value, seed, repeat);
            break;
        case 1u:
            seed = told.value;
            break;
        case 2u:
            repeat = told.value;
            break;
        default:
            possible = false;
            break;
        }
    }
    return possible;
}

const bed_plant board_plant = {advance, preset};

void port_set_current(int32_t counts)
{
    held_current = counts;
    if (board_listener != NULL) {
        board_listener('i', counts);
    }
}

void port_set_voltage(int32_t counts)
{
    held_voltage = counts;
    if (board_listener != NULL) {
        board_listener('v', counts);
    }
}

void port_read(port_sensors *sensors)
{
    sensors->rate = counted(plant_rate(), board_scale.rate);
    sensors->angle = counted_round(plant_shaft_angle(), board_scale.angle);
    sensors->drive_current = 0;
    sensors->load_current = held_current;
    sensors->acceleration = 0;
}

void board_boot(bed_cause cause)
{
    seed = 0.0;
    repeat = 0.0;
    plant_start(0.0, seed, repeat);
    bed_boot(&the_bed, &board_config, cause);
}

void board_tick(void)
{
    advance();
    bed_tick(&the_bed);
}

void board_receive(const uint8_t *bytes, size_t count)
{
    bed_receive(&the_bed, bytes, count);
}

size_t board_send(uint8_t *out, size_t room)
{
    return bed_send(&the_bed, out, room);
}

bool board_is_in_lock_step(void)
{
    return (board_config.capabilities & BED_IN_LOCK_STEP) != 0u;
}

uint32_t board_ticks(void)
{
    return the_bed.tick;
}
