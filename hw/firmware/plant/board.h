/* A board whose motors are simulated by plant.h: the port of the core, and one bed on it.

   Lock-step (BED_IN_LOCK_STEP): the plant moves with STEP alone. Free-running: call board_tick every plant_period.
   Left to whoever runs it, by the clock and memory that there are: port_session and port_kick. */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "bed.h"

/* Values of a count, in SI: V, A, rad/s, rad. */
typedef struct {
    double voltage;
    double current;
    double rate;
    double angle;
} board_scales;

/* Of the bed that was built; hw/boards/build.py writes them. */
extern const bed_config board_config;
extern const board_scales board_scale;

/* The core's way to the plant. */
extern const bed_plant board_plant;

/* Starts plant and bed anew, as a board that gets power or is reset by its watchdog. */
void board_boot(bed_cause cause);

/* Free-running: a tick of the plant under what is held, then one of the bed. */
void board_tick(void);

/* bed_receive and bed_send of the one bed. */
void board_receive(const uint8_t *bytes, size_t count);
size_t board_send(uint8_t *out, size_t room);

/* Whether the bed advances with STEP alone. */
bool board_is_in_lock_step(void);

/* Ticks since it booted. */
uint32_t board_ticks(void);

/* Is told every output that the core sets, in order: 'i' for the load's current or 'v' for the drive's voltage, and the
   counts. NULL for nobody. */
extern void (*board_listener)(char output, int32_t counts);

#endif
