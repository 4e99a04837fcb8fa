/* The interlock of a bed with motors: inputs that latch, lines that enable amplifiers and release a brake, and what is
   watched besides commands, rate and the load (guard.h). It needs no host.

   Whole numbers alone. Nothing here reaches an output: bed.c asks it at each tick what is wrong and which lines are to
   be on, and tells the port. A bed without one (`bed_config.interlock` is NULL) is as if this file were not there. */
#ifndef INTERLOCK_H
#define INTERLOCK_H

#include <stdbool.h>
#include <stdint.h>

#include "guard.h"
#include "port.h"

/* Inputs. A circuit that is closed is sound, so that a wire that breaks is not. */
#define INTERLOCK_STOP (1u << 0)      /* the emergency stop's second contact is closed */
#define INTERLOCK_READY (1u << 1)     /* both amplifiers say that they are ready */
#define INTERLOCK_ENABLED (1u << 2)   /* read back: the amplifiers are enabled */
#define INTERLOCK_KEY (1u << 3)       /* the key of the person who lets the bed arm */
#define INTERLOCK_CONVERTER (1u << 4) /* the port's converter reads its reference as what it is */

/* Lines. All off is what a processor without power does. */
#define INTERLOCK_LOAD_ENABLE (1u << 0)
#define INTERLOCK_DRIVE_ENABLE (1u << 1)
#define INTERLOCK_BRAKE_RELEASE (1u << 2)

/* Reasons, as SAMPLE tells them (docs/protocol.md). */
#define INTERLOCK_BY_STOP (1u << 0)
#define INTERLOCK_BY_READY (1u << 1)
#define INTERLOCK_BY_READ_BACK (1u << 2)   /* enabled and not told so, or the reverse */
#define INTERLOCK_BY_KEY (1u << 3)         /* nobody lets it arm, or no longer */
#define INTERLOCK_BY_CONVERTER (1u << 4)
#define INTERLOCK_BY_DRIVE_HEAT (1u << 5)  /* I2t of the drive motor */
#define INTERLOCK_BY_TEMPERATURE (1u << 6) /* of the drive motor's winding */
#define INTERLOCK_BY_BUS (1u << 7)         /* the supply's voltage is too high or too low */
#define INTERLOCK_BY_ANGLE (1u << 8)
#define INTERLOCK_BY_ENCODER (1u << 9)     /* encoder and tachometer do not agree, or the encoder lost a step */
#define INTERLOCK_BY_LOAD (1u << 10)       /* the load's measured current is not what is commanded */
#define INTERLOCK_BY_TICK (1u << 11)       /* a tick came too early or too late by another clock */
#define INTERLOCK_BY_MAIN (1u << 12)       /* the main program has stood still */

/* What a port reads of it once a tick. */
typedef struct {
    uint32_t lines;      /* inputs that are closed */
    int32_t temperature; /* of the drive motor, in steps that grow with it; INT32_MAX where it cannot be read */
    int32_t bus;         /* of the supply, in steps that grow with it */
    uint32_t clock;      /* us of a clock that is not the tick's, going round */
    uint32_t beats;      /* how often the main program has gone round, going round */
    bool lost_step;      /* the encoder saw a change that cannot be, since the last reading */
} interlock_inputs;

/* What a port does for it. */
typedef struct {
    void (*read)(interlock_inputs *inputs);
    void (*set)(uint32_t lines); /* all lines, at each tick and at each change; those not named are off */
} interlock_port;

/* One bed's numbers; hw/boards/pico.py writes them. A span of 0 ticks, and a limit that cannot be passed, watch nothing. */
typedef struct {
    const interlock_port *port;
    bool needs_key;
    uint32_t settle;              /* ticks within which the read-back follows the lines */
    uint32_t hold;                /* ticks for which the drive is held at 0 V, the brake off, unless the shaft is slow before */
    int32_t slow;                 /* counts of rate at which the brake may close */
    guard_heat_config drive_heat; /* in counts of the drive's current */
    int32_t warmest;              /* of temperature */
    int32_t bus_least;
    int32_t bus_most;
    int32_t angle_least;          /* counts; least above most: not watched */
    int32_t angle_most;
    uint32_t span;                /* ticks over which encoder and tachometer are compared */
    int32_t path;                 /* encoder's counts that a count of rate is in a tick, times 2^16 */
    uint32_t lag;                 /* ticks by which the tachometer's filter is late */
    int32_t floor;                /* encoder's counts by which both may differ always */
    int32_t load_off;             /* counts by which the load's current may be off for `load_ticks` */
    uint32_t load_ticks;
    uint32_t shortest;            /* us between two ticks */
    uint32_t longest;
    uint32_t stand;               /* ticks for which the main program may stand still */
} interlock_config;

typedef struct {
    uint32_t lines;         /* that are on */
    uint32_t since_lines;   /* ticks since the lines that the read-back follows changed, up to `settle` */
    uint32_t since_armed;   /* ticks since it was armed, up to `hold` */
    bool had_open;          /* the key was seen open since it was last withdrawn */
    bool permitted;         /* by the key */
    int64_t drive_heat;
    uint32_t compared;      /* ticks of the present comparison */
    int64_t path;           /* sum of the tachometer's rates in it, times `path` */
    int32_t angle;          /* at its beginning */
    int32_t rate;
    uint32_t load_off;      /* ticks for which the load has been off */
    uint32_t clock;
    uint32_t beats;
    uint32_t stood;         /* ticks for which the main program has stood still */
    bool begun;             /* whether clock, beats and angle are of a tick before */
} interlock;

/* From the beginning, with all lines off. Motors count as hot as they may be: what they were before, nobody knows. */
void interlock_boot(interlock *self, const interlock_config *config);

/* What is wrong at this tick, as bits of reasons. armed: whether it was, until now.
   load_command: counts of the current that is held. */
uint32_t interlock_tick(interlock *self, const interlock_config *config, bool armed, const port_sensors *sensors,
                        int32_t load_command);

/* Of the reasons, those that stop a bed and are latched in every state; the others stop an armed one alone. */
uint32_t interlock_latching(uint32_t reasons);

/* Whether a bed that is stopped may forget the reasons that it has latched: none is there any more, but for the key's,
   and a drive motor that was too hot has cooled to half of what it bears. */
bool interlock_may_clear(const interlock *self, const interlock_config *config, uint32_t reasons, uint32_t latched);

/* Told at arming: lines on, comparisons from their beginning. */
void interlock_arm(interlock *self, const interlock_config *config);

/* Told with each safe state and at each tick that is not armed: the load's amplifier off at once, the drive's once the
   shaft is slow or `hold` is over, and with it the brake. */
void interlock_rest(interlock *self, const interlock_config *config, int32_t rate);

/* A fault has come: the key must be opened and closed again. */
void interlock_withdraw(interlock *self);

#endif
