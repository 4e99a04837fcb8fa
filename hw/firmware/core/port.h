/* What a board must do for the core: all that a port to real hardware fills in, and all that the core knows of it.

   Who calls what. The port calls bed_boot once, then bed_receive with what the line brings, bed_send for what goes
   back, and bed_tick at the tick rate of the config, by a timer. The functions here are called from inside those, and
   nowhere else.

   One at a time. None of bed_receive, bed_send and bed_tick may interrupt another. The plain way is to call all three
   from interrupts of one priority, where the timer wins a tie; the longest of them is then the most by which a tick is
   late: 2,500 instructions of a Cortex-M3 for a command and its answer, 9,000 for HELLO. A tick that a main program
   calls can be kept waiting by it, and with it the deadman.

   At reset, before main and before any of this code has run, the hardware itself must hold the safe state: the load's
   amplifier commanded to no current or disabled by a resistor that pulls its enable line, the drive's amplifier holding
   0 V at low impedance, so that it brakes the shaft. The same must hold while the processor is halted, is being
   programmed, has browned out or is reset by its watchdog. Pins are inputs then: what pulls them decides.

   Nothing here may wait for longer than a tenth of a tick, or fail: a converter that does not answer is for the port to
   find out, and to tell as a rate beyond every limit (BED_RATE_UNKNOWN), which stops the bed. */
#ifndef PORT_H
#define PORT_H

#include <stdint.h>

/* What port_read gives for a rate that could not be read. */
#define BED_RATE_UNKNOWN INT32_MAX

/* The sensors at one instant, in counts of the scales that HELLO tells. */
typedef struct {
    int32_t rate;          /* of the shaft, behind the tachometer's filter; positive as a positive voltage turns it */
    int32_t angle;         /* of the shaft, going round at the ends; 0 without an encoder */
    int32_t drive_current; /* measured; 0 where it is not */
    int32_t load_current;  /* measured, counted as commands are; where it is not, what port_set_current was last told */
    int32_t acceleration;  /* measured; 0 where it is not */
} port_sensors;

/* Has the load's amplifier hold a current, `counts` of the current's scale; positive as it speeds the shaft up in its
   positive sense. Takes hold within a tenth of a tick, and stays until the next call. Called with 0 first of all, by
   bed_boot, and again at every tick that is not armed. The core never asks for more than the limit that HELLO tells. */
void port_set_current(int32_t counts);

/* Has the drive's amplifier hold a voltage, `counts` of the voltage's scale, at low impedance; likewise. 0 must short
   the motor through the amplifier, not let it coast: a shaft that is braked so stops in a seventh of the time. */
void port_set_voltage(int32_t counts);

/* Reads all sensors, once a tick and at boot. They need not be of the same instant, but each no older than a tick. */
void port_read(port_sensors *sensors);

/* Restarts the watchdog, which resets the processor 2 to 10 ticks later unless it is called again. Called at the end of
   a tick that has done all its work, and nowhere else. The watchdog is started by the port just before bed_boot, so
   that nothing can hang unseen; where the board has none, this does nothing and the capability is not told. */
void port_kick(void);

/* A number that differs from that of every boot before it, as far as can be: a true random source, or a counter in
   memory that lasts. Called when the first HELLO after a boot is heard, so that where there is neither, a fast timer
   serves. */
uint32_t port_session(void);

#endif
