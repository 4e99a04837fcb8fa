/* The Pico's firmware with a simulated plant (plant/board.c), as an emulator of the chip runs it: no pin but the
   line's, no watchdog. */
#include "pico.h"

void board_start(void)
{
    /* no motor, no pin */
}

void board_halt(void)
{
    /* no motor */
}

void port_kick(void)
{
    /* no watchdog */
}
