/* From reset to main on a Cortex-M3. */
#include <stdint.h>

#include "lm3s6965.h"

extern uint32_t stack_top, data_start, data_end, data_load, bss_start, bss_end;

void reset(void);

/* A fault of the processor, or an interrupt that nobody asked for: nothing more goes out to an amplifier but zeros. It
   takes the stack from its beginning, since a stack that was too deep is what it may have come from. */
__attribute__((naked)) static void halt(void)
{
    __asm volatile("ldr r0, =stack_top\n\t"
                   "msr msp, r0\n\t"
                   "b lm3s6965_halt\n\t"
                   ".ltorg");
}

void reset(void)
{
    /* A port with amplifiers has its pins in the safe state here by hardware alone (core/port.h). */
    const uint32_t *from = &data_load;
    for (uint32_t *to = &data_start; to < &data_end; to++) {
        *to = *from;
        from++;
    }
    for (uint32_t *to = &bss_start; to < &bss_end; to++) {
        *to = 0u;
    }
    lm3s6965_main();
    halt();
}

typedef struct {
    uint32_t *stack;
    void (*handlers[21])(void);
} vector_table;

/* Reset, NMI, faults and system calls; SysTick is exception 15, UART0 interrupt 5. */
__attribute__((section(".vectors"), used)) static const vector_table vectors = {
    .stack = &stack_top,
    .handlers = {reset, halt, halt, halt, halt, halt, halt, halt, halt, halt, halt, halt, halt, halt, lm3s6965_timer,
                 halt, halt, halt, halt, halt, lm3s6965_line},
};
