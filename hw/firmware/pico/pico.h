/* The firmware on a Raspberry Pi Pico: what start and interrupts call, and what the port of the core is asked for.

   There are two ports: port.c drives motors, simulated.c has a plant in their place, for an emulator. */
#ifndef PICO_H
#define PICO_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "bed.h"

/* Hz of the processor: 12 MHz of the crystal * 125 / 6 / 2. */
#define PICO_CLOCK 125000000u

/* Boots the bed and goes round between interrupts. Does not return. */
void pico_main(void);

/* SysTick: a tick. */
void pico_timer(void);

/* UART0: bytes have come, or there is room for more to go. */
void pico_line(void);

/* Safe outputs, and nothing more until a reset. */
void pico_halt(void);

/* How often the main program has gone round. */
extern volatile uint32_t pico_beats;

/* One bed's numbers beside `board_config`; hw/boards/pico.py writes them. */
typedef struct {
    uint32_t reload;       /* SysTick's: clocks of the processor in a tick, less one */
    uint32_t watchdog;     /* us without a tick after which the chip is reset; 0: no watchdog */
    uint32_t rate_ticks;   /* 0: the rate is the tachometer's; else the encoder's change over so many ticks, at most 32 */
    int32_t rate_zero;     /* what the converter reads of a shaft at rest */
    int32_t rate_sign;     /* 1 or -1 */
    int32_t drive_zero;    /* of the drive's current */
    int32_t drive_sign;
    int32_t load_zero;     /* of the load's current */
    int32_t load_counts;   /* so many counts of the command are so many steps: its sign is the sensor's */
    int32_t load_steps;
    int32_t reference;     /* what the converter reads of half its reference, within `reference_off` */
    int32_t reference_off;
    bool has_temperature;
    bool has_bus;
} pico_wiring;

extern const pico_wiring board_wiring;

/* Of either port. Pins and peripherals into the safe state, once, before all else. */
void board_start(void);

/* As of plant/board.h. */
void board_boot(bed_cause cause);
void board_tick(void);
void board_receive(const uint8_t *bytes, size_t count);
size_t board_send(uint8_t *out, size_t room);
bool board_is_in_lock_step(void);

/* All commands 0, all lines off: from a fault, so by registers alone. */
void board_halt(void);

#endif
