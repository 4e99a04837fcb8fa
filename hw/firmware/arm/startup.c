/* From reset to main on a Cortex-M3, and the three functions that a compiler may call unasked. No library behind it. */
#include <stddef.h>
#include <stdint.h>

#include "lm3s6965.h"

extern uint32_t stack_top, data_start, data_end, data_load, bss_start, bss_end;

void reset(void);
void *memcpy(void *to, const void *from, size_t count);
void *memmove(void *to, const void *from, size_t count);
void *memset(void *to, int value, size_t count);

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

/* Byte by byte: gcc turns some loops and assignments of structures into calls of these. */

void *memcpy(void *to, const void *from, size_t count)
{
    uint8_t *target = to;
    const uint8_t *source = from;
    for (size_t k = 0u; k < count; k++) {
        target[k] = source[k];
    }
    return to;
}

void *memmove(void *to, const void *from, size_t count)
{
    uint8_t *target = to;
    const uint8_t *source = from;
    if ((uintptr_t)to <= (uintptr_t)from) {
        return memcpy(to, from, count);
    }
    for (size_t k = count; k > 0u; k--) {
        target[k - 1u] = source[k - 1u];
    }
    return to;
}

void *memset(void *to, int value, size_t count)
{
    uint8_t *target = to;
    for (size_t k = 0u; k < count; k++) {
        target[k] = (uint8_t)value;
    }
    return to;
}
