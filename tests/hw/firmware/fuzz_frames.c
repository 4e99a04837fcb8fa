/* A libFuzzer target: any bytes as what happens to a bed. What must hold of its outputs and answers is held at each
   step.

   The input is read as a script. A byte below 128 opens a frame of up to 12 bytes of payload: with bit 6 the bytes are
   given a CRC and stuffed, so that the fuzzer gets past them, with bit 5 also the next number and, on ARM, the session;
   else they go in as they are. From 128 on it is a tick, or several, or sets a sensor or an input. */
#include <stdlib.h>
#include <string.h>

#include "bed.h"

extern const bed_config board_config;
extern const bed_plant board_plant;
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define SESSION 0x12345678u

static bed the_bed;
static port_sensors sensors;
static interlock_inputs inputs;
static int32_t held_current, held_voltage, pace;
static uint32_t held_lines;
static uint32_t kicks;

static void require(int holds)
{
    if (!holds) {
        abort();
    }
}

void port_set_current(int32_t counts)
{
    require((counts <= board_config.limits[BED_CURRENT]) && (counts >= -board_config.limits[BED_CURRENT]));
    require((counts == 0) || (the_bed.state == BED_ARMED));
    held_current = counts;
}

void port_set_voltage(int32_t counts)
{
    require((counts <= board_config.limits[BED_VOLTAGE]) && (counts >= -board_config.limits[BED_VOLTAGE]));
    require((counts == 0) || (the_bed.state == BED_ARMED));
    held_voltage = counts;
}

void port_read(port_sensors *into)
{
    *into = sensors;
}

void port_kick(void)
{
    kicks++;
}

uint32_t port_session(void)
{
    return SESSION;
}

static void read_inputs(interlock_inputs *into)
{
    inputs.clock += (uint32_t)pace;
    inputs.beats++;
    *into = inputs;
}

static void set_lines(uint32_t lines)
{
    held_lines = lines;
}

extern const interlock_port board_interlock_port;
const interlock_port board_interlock_port = {read_inputs, set_lines};

static void advance(void)
{
}

static bool preset(uint8_t which, uint64_t bits)
{
    return (which < 3u) && (bits != 0u);
}

const bed_plant board_plant = {advance, preset};

/* Whatever is waiting is whole frames with a CRC, of a kind that a device sends. */
static void check_answers(size_t expected_most)
{
    uint8_t out[BED_WAITING];
    const size_t count = bed_send(&the_bed, out, sizeof out);
    require((count == 0u) || (out[count - 1u] == 0u));
    size_t frames = 0u;
    for (size_t at = 0u; at < count;) {
        uint8_t payload[FRAME_OUT];
        size_t length = 0u;
        while (out[at] != 0u) {
            const size_t code = out[at];
            for (size_t k = 1u; k < code; k++) {
                payload[length++] = out[at + k];
                require(out[at + k] != 0u);
            }
            at += code;
            if (out[at] != 0u) {
                payload[length++] = 0u;
            }
        }
        at++;
        frames++;
        require(length >= 5u);
        require(frame_crc(payload, length - 2u) == (uint16_t)(payload[length - 2u] | (payload[length - 1u] << 8)));
        require((payload[0] == 0x81u) || (payload[0] == 0x82u) || (payload[0] == 0x84u));
        if (payload[0] == 0x84u) {
            require((payload[3] & 3u) <= 2u);
            require(((payload[3] & 3u) == 2u) == (((payload[3] & 0xF8u) | (payload[4] & 0x4Fu)) != 0u));
        }
    }
    require(frames <= expected_most);
}

static void check_outputs(void)
{
    require((the_bed.state == BED_ARMED) || ((held_current == 0) && (held_voltage == 0)));
    require((the_bed.state == BED_STOPPED) == (the_bed.faults != 0u));
    require((the_bed.state != BED_ARMED) || (the_bed.greeted && (the_bed.since < board_config.deadman)));
    require((the_bed.state == BED_ARMED) || ((held_lines & INTERLOCK_LOAD_ENABLE) == 0u));
    require((the_bed.state != BED_ARMED) || (board_config.interlock == NULL) || (held_lines == 7u));
    require((the_bed.state != BED_ARMED) || (the_bed.live == 0u));
    for (size_t k = 0u; k < BED_LIMITS; k++) {
        require((the_bed.limits[k] >= 0) && (the_bed.limits[k] <= board_config.limits[k]));
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    memset(&sensors, 0, sizeof sensors);
    memset(&the_bed, 0xA5, sizeof the_bed);
    memset(&inputs, 0, sizeof inputs);
    inputs.lines = 0x17u; /* all is sound, the key turned off */
    held_current = held_voltage = 1;
    held_lines = 0u;
    pace = 1000;
    the_bed.state = BED_DISARMED;
    bed_boot(&the_bed, &board_config, BED_POWER);
    uint16_t number = 0u;
    for (size_t at = 0u; at < size;) {
        const uint8_t head = data[at++];
        if (head >= 0xC0u) {
            int32_t value = 0;
            for (int k = 0; (k < 4) && (at < size); k++) {
                value = (int32_t)(((uint32_t)value << 8) | data[at++]);
            }
            int32_t *const each[] = {&sensors.rate,         &sensors.angle,      &sensors.drive_current,
                                     &sensors.load_current, &inputs.temperature, &pace};
            if ((head & 7u) < 6u) {
                *each[head & 7u] = value;
            } else {
                inputs.lines = (uint32_t)value;
                inputs.lost_step = (value < 0);
            }
        } else if (head >= 0x80u) {
            const uint32_t before = kicks;
            for (uint32_t k = 0u; k <= (head & 0x1Fu); k++) {
                bed_tick(&the_bed);
                check_outputs();
            }
            require(kicks == before + (head & 0x1Fu) + 1u);
            check_answers(0u);
        } else {
            uint8_t bytes[16];
            size_t count = head & 0x0Fu;
            count = (count > size - at) ? (size - at) : count;
            memcpy(bytes, &data[at], count);
            at += count;
            if (((head & 0x40u) != 0u) && (count >= 3u)) {
                uint8_t frame[FRAME_OUT];
                if ((head & 0x20u) != 0u) {
                    number++;
                    bytes[1] = (uint8_t)(number & 0xFFu);
                    bytes[2] = (uint8_t)(number >> 8);
                    if ((bytes[0] == 3u) && (count == 7u)) {
                        bytes[3] = 0x78u, bytes[4] = 0x56u, bytes[5] = 0x34u, bytes[6] = 0x12u;
                    }
                }
                count = frame_encode(frame, bytes, count);
                bed_receive(&the_bed, frame, count);
                check_outputs();
                check_answers(2u);
            } else {
                bed_receive(&the_bed, bytes, count);
                check_outputs();
                check_answers(4u);
            }
        }
    }
    return 0;
}
