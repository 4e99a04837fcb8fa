/* What a bed watches besides its commands: the load's heat, and whether the tachometer tells the truth.

   Whole numbers alone. Nothing here reaches an output; bed.c does. */
#ifndef GUARD_H
#define GUARD_H

#include <stdbool.h>
#include <stdint.h>

/* I2t of the load: the integral of i^2 - i_continuous^2, which does not fall below zero. In squares of a current's
   count, times ticks; below 2^62. */
typedef struct {
    int64_t most;       /* beyond it the load is too hot */
    int64_t continuous; /* what leaves in a tick: the square of the current that it bears for ever */
} guard_heat_config;

/* The heat a tick on, after `current` counts: 0 to config->most + 1. */
int64_t guard_heat(const guard_heat_config *config, int64_t heat, int32_t current);

/* The shaft as its data sheet has it: by how many counts of rate each thing changes the shaft's rate in a tick, times
   2^bits, so that a tick is a few products of whole numbers. hw/boards/build.py makes these from SI, and sees to it that no sum
   of them leaves 62 bits. */
typedef struct {
    uint32_t bits;     /* of a fraction: 24, or as many as leave room where a tick of a light shaft is many counts */
    int64_t voltage;   /* a count of voltage, through the armature's resistance */
    int64_t back_emf;  /* a count of rate, through back-EMF and resistance: it brakes */
    int64_t most;      /* the drive's largest torque */
    int64_t current;   /* a count of the load's current */
    int64_t viscous;   /* a count of rate, through viscous friction: it brakes */
    int64_t friction;  /* the largest dry friction there can be, breaking away included */
    int64_t tolerance; /* 256ths by which the drive's and the load's torque may be off */
    int32_t change;    /* counts of rate that must come about before anything is said; 0: not watched */
    uint32_t lag;      /* ticks after which the tachometer's filter has forgotten what was before */
} guard_tachometer_config;

typedef struct {
    int64_t sum;         /* change of rate that is sure since `start`, times 2^bits */
    int64_t way_sum;     /* the same since `way`, no more than is wanted: while above 0 the shaft was pushed that way */
    int32_t start;       /* rate at which the sum began, counts */
    int32_t way;         /* direction of the torque, +1 or -1; 0: none that is sure */
    uint32_t ticks;      /* for which it has been so, up to `lag`; a tick without torque is no end of it */
    uint32_t suspicious; /* ticks for which the rate has not followed */
} guard_tachometer;

typedef enum {
    GUARD_SOUND,
    GUARD_DEAD,    /* torque, and no change of the rate */
    GUARD_REVERSED /* the rate changes against the torque */
} guard_verdict;

/* Nothing known yet. */
void guard_tachometer_start(guard_tachometer *guard);

/* One tick: what the amplifiers held during it, and the rate that was read at its end, all in counts.

   Friction and an error of the constants may take all of a torque; what is beyond both must change the rate. So a shaft
   at rest, one that the load motor holds, and one whose arm takes most of the torque say nothing. A torque that is sure
   is left alone for `lag` ticks, until the filter shows only what it does. From there on the change of rate that is
   sure is summed; a tick whose torque is not takes as much from the sum as it may have undone, so that a torque with
   gaps is watched like one without. Once that is `change`, a quarter of it must have been read: the other three
   quarters are for a shaft of up to three times the inertia, and for noise. Not having been read for `lag` ticks more,
   it is a verdict: the filter is late where a torque grows. */
guard_verdict guard_tachometer_tick(guard_tachometer *guard, const guard_tachometer_config *config, int32_t voltage,
                                    int32_t current, int32_t rate);

#endif
