/* A motor bed's firmware, without its board: frames, states, limits, deadman (docs/protocol.md).

   No heap, no library, no floating point, no recursion; every loop has an end that is known beforehand. What a board
   does for it is in port.h.

       bed_boot(&bed, &config, cause)          the outputs are in the safe state from here on
       at each tick of a timer:  bed_tick(&bed)
       when bytes have come:     bed_receive(&bed, bytes, count)
       when bytes can go:        count = bed_send(&bed, out, room)
*/
#ifndef BED_H
#define BED_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "frame.h"
#include "guard.h"
#include "interlock.h"
#include "port.h"

#define BED_VERSION 1u

typedef enum { BED_DISARMED = 0, BED_ARMED = 1, BED_STOPPED = 2 } bed_state;

/* Why the processor started. */
typedef enum { BED_POWER, BED_WATCHDOG } bed_cause;

/* Bits of a SAMPLE's status. */
#define BED_GREETED (1u << 2)
#define BED_FAULT_DEADMAN (1u << 3)
#define BED_FAULT_RANGE (1u << 4)
#define BED_FAULT_SLEW (1u << 5)
#define BED_FAULT_RATE (1u << 6)
#define BED_FAULT_CURRENT (1u << 7)
#define BED_FAULT_HEAT (1u << 8)
#define BED_FAULT_TACHOMETER_DEAD (1u << 9)
#define BED_FAULT_TACHOMETER_REVERSED (1u << 10)
#define BED_FAULT_NOISE (1u << 11)
#define BED_RESET_BY_WATCHDOG (1u << 12)
#define BED_REFUSED (1u << 13)
#define BED_FAULT_INTERLOCK (1u << 14)

/* Capabilities. */
#define BED_HAS_ENCODER (1u << 0)
#define BED_HAS_DRIVE_CURRENT (1u << 1)
#define BED_HAS_ACCELEROMETER (1u << 2)
#define BED_HAS_WATCHDOG (1u << 3)
#define BED_IN_LOCK_STEP (1u << 4)
#define BED_IS_SIMULATED (1u << 5)
#define BED_HAS_INTERLOCK (1u << 6)

/* Of commands, and of what LIMIT can make tighter; counts, slews in counts a tick; none negative. */
#define BED_LIMITS 5u
typedef enum { BED_VOLTAGE = 0, BED_CURRENT = 1, BED_RATE = 2, BED_VOLTAGE_SLEW = 3, BED_CURRENT_SLEW = 4 } bed_limit;

/* What a simulated plant does for the core. */
typedef struct {
    /* One tick under what port_set_voltage and port_set_current were last told. Used in lock-step alone. */
    void (*advance)(void);
    /* PRESET: `bits` are those of an IEEE 754 double. False where it is not taken. */
    bool (*preset)(uint8_t which, uint64_t bits);
} bed_plant;

/* One bed, as it is built: hw/boards/build.py writes it from values in SI. */
typedef struct {
    uint16_t capabilities;
    uint8_t firmware[8];    /* beginning of the SHA-256 of what was built */
    uint8_t name[16];       /* ASCII, filled up with zeros */
    uint64_t announced[15]; /* bits of HELLO's doubles, in its order; told and not used */
    int32_t limits[BED_LIMITS];
    int32_t arming_rate;    /* counts of rate */
    int32_t load_trip;      /* measured load current beyond which it is a fault, counts of current */
    int32_t drive_trip;     /* measured drive current, counts of its own scale */
    uint32_t deadman;       /* ticks, at least 1 */
    guard_heat_config heat;
    guard_tachometer_config tachometer;
    const bed_plant *plant; /* NULL on a board with motors */
    const interlock_config *interlock; /* NULL: none, and BED_HAS_INTERLOCK is not told */
} bed_config;

/* Replies that wait for the line: two of the longest frames. */
#define BED_WAITING (2u * FRAME_OUT)

/* All that a bed remembers. Nothing in it is for a port to touch. */
typedef struct {
    const bed_config *config;
    bed_state state;
    uint32_t faults; /* latched, bits of the status */
    bool greeted;
    bool by_watchdog;
    uint32_t session;
    uint32_t tick;
    int32_t limits[BED_LIMITS]; /* in force */
    int32_t voltage;            /* command in force, counts; 0 unless armed */
    int32_t current;
    uint32_t since; /* ticks since the last command or arming */
    int32_t from_voltage; /* command in force before the first one since the last tick */
    int32_t from_current;
    uint32_t from_ticks; /* ticks for which it had been, at least 1 */
    int32_t largest;     /* size of the largest current that was in force since the last tick */
    port_sensors sensors;
    int64_t heat;
    guard_tachometer tachometer;
    interlock interlock;
    uint32_t live;    /* the interlock's reasons at the last tick */
    uint32_t because; /* those that are latched */
    uint64_t dropped; /* the last 64 frames since arming, 1 for one that was dropped; the newest in bit 0 */
    uint32_t drops;   /* how many of these are 1 */
    bool numbered;    /* whether a new frame has been heard since boot */
    uint16_t number;  /* its number */
    uint8_t coming[FRAME_IN];
    size_t came; /* bytes of the frame that is coming; FRAME_IN where it is too long */
    uint8_t going[BED_WAITING];
    size_t head; /* where the next byte goes out */
    size_t waiting;
} bed;

/* The outputs into the safe state first, then all from its beginning: disarmed. Called once, before the others. */
void bed_boot(bed *self, const bed_config *config, bed_cause cause);

/* Takes bytes from the line, in any pieces. A frame has its effect, outputs included, when its 0x00 is taken; its
   answer then waits for bed_send. In lock-step a STEP's ticks pass in here. An answer for which there is no room is
   lost, as on any line. */
void bed_receive(bed *self, const uint8_t *bytes, size_t count);

/* Up to `room` bytes for the line. Answers how many. */
size_t bed_send(bed *self, uint8_t *out, size_t room);

/* One tick: reads the sensors, stops on a fault within it, writes the safe state anew unless armed, kicks the watchdog.
   A timer's; in lock-step nobody's but the core's. */
void bed_tick(bed *self);

#endif
