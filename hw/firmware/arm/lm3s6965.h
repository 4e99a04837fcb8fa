/* The firmware on a Luminary LM3S6965 evaluation board with a simulated plant: what start and interrupts call. */
#ifndef LM3S6965_H
#define LM3S6965_H

/* Boots the bed and sleeps between interrupts. Does not return. */
void lm3s6965_main(void);

/* SysTick: a tick of plant and bed, in free running. */
void lm3s6965_timer(void);

/* UART0: bytes have come, or there is room for more to go. */
void lm3s6965_line(void);

/* Safe outputs, and nothing more until a reset. */
void lm3s6965_halt(void);

#endif
