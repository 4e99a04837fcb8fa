/* A port without a board: sensors are what the test says, every output is written down. One bed on it. */
#include <stddef.h>

#include "bed.h"

#define ROOM 65536u

extern const bed_config board_config;
extern const bed_plant board_plant;

typedef struct {
    int32_t output; /* 'i', 'v'; 'k' for a kick of the watchdog, 'a' for an advance of the plant, 'p' for a preset, 'l'
                       for the interlock's lines */
    int32_t counts;
} event;

port_sensors fake_sensors;
int fake_measures_load; /* 0: the load's current is what it was told */
uint32_t fake_session;
event fake_events[ROOM];
uint32_t fake_count;

interlock_inputs fake_inputs;
int fake_reads_back; /* 0: what is read back of the lines is the test's */
int32_t fake_pace;   /* us that the other clock goes on in a tick */
int32_t fake_beat;   /* rounds of the main program in a tick */

static bed the_bed;

void fake_boot(int by_watchdog);
void fake_receive(const uint8_t *bytes, uint32_t count);
uint32_t fake_send(uint8_t *out, uint32_t room);
void fake_tick(uint32_t count);

static void note(int32_t output, int32_t counts)
{
    fake_events[fake_count % ROOM].output = output;
    fake_events[fake_count % ROOM].counts = counts;
    fake_count++;
}

void port_set_current(int32_t counts)
{
    note('i', counts);
    if (fake_measures_load == 0) {
        fake_sensors.load_current = counts;
    }
}

void port_set_voltage(int32_t counts)
{
    note('v', counts);
}

void port_read(port_sensors *sensors)
{
    *sensors = fake_sensors;
}

void port_kick(void)
{
    note('k', 0);
}

uint32_t port_session(void)
{
    return fake_session;
}

static void advance(void)
{
    note('a', 0);
}

static bool preset(uint8_t which, uint64_t bits)
{
    note('p', which);
    return which < 3u && bits != UINT64_MAX;
}

const bed_plant board_plant = {advance, preset};

static void read_inputs(interlock_inputs *inputs)
{
    fake_inputs.clock += (uint32_t)fake_pace;
    fake_inputs.beats += (uint32_t)fake_beat;
    *inputs = fake_inputs;
    fake_inputs.lost_step = false;
}

static void set_lines(uint32_t lines)
{
    note('l', (int32_t)lines);
    if (fake_reads_back != 0) {
        fake_inputs.lines &= ~INTERLOCK_ENABLED;
        fake_inputs.lines |= ((lines & (INTERLOCK_LOAD_ENABLE | INTERLOCK_DRIVE_ENABLE)) != 0u) ? INTERLOCK_ENABLED : 0u;
    }
}

extern const interlock_port board_interlock_port;
const interlock_port board_interlock_port = {read_inputs, set_lines};

void fake_boot(int by_watchdog)
{
    bed_boot(&the_bed, &board_config, (by_watchdog != 0) ? BED_WATCHDOG : BED_POWER);
}

void fake_receive(const uint8_t *bytes, uint32_t count)
{
    bed_receive(&the_bed, bytes, count);
}

uint32_t fake_send(uint8_t *out, uint32_t room)
{
    return (uint32_t)bed_send(&the_bed, out, room);
}

void fake_tick(uint32_t count)
{
    for (uint32_t k = 0u; k < count; k++) {
        bed_tick(&the_bed);
    }
}
