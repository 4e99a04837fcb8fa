/* From the flash to main: the loader, which tests the RAM and has the whole program there, and what a processor calls.

   Nothing is read from the flash once the loader is through: no word of it can change under the program, and a tick
   takes as long each time. Until the program drives its first pin all pins are inputs that are pulled down, which is
   the safe state (docs/pico.md). So whatever the loader finds wrong, it stands still. */
#include <stdbool.h>
#include <stdint.h>

#include "pico.h"
#include "rp2040.h"

/* Of rp2040.ld: where the program lies in flash and RAM, and the RAM that it uses. */
extern uint32_t stack_top, ram_end, image_load, image_start, image_end, bss_start, bss_end;

void reset(void);
void load(void);

/* What boot2 and the loader go by, at 0x10000100. `crc` is that of all that follows, which hw/boards/pico.py writes, as it
   does how many words these are; so what the compiler sees here is not what is read. */
typedef struct {
    uint32_t stack; /* in a bank of RAM that the program does not use */
    void (*entry)(void);
    uint32_t words;
    uint32_t crc;
} image_head;

/* bytes */
#define WORD 4u
#define ADDRESS(of) ((uint32_t)&(of))

#define LOADER __attribute__((section(".loader"), noinline))

__attribute__((section(".head"), used)) const volatile image_head head = {0x20042000u, load, 0u, 0u};

/* March C-: each word of RAM from the first address to before the last holds each bit both ways, whatever its neighbours
   do. False where one does not. */
LOADER static bool is_ram_sound(uint32_t from, uint32_t to)
{
    uint32_t wrong = 0u;
    for (uint32_t way = 0u; way < 2u; way++) {
        const uint32_t one = (way == 0u) ? 0xFFFFFFFFu : 0xAAAAAAAAu;
        for (uint32_t at = from; at < to; at += WORD) {
            REGISTER(at) = ~one;
        }
        for (uint32_t at = from; at < to; at += WORD) {
            wrong |= REGISTER(at) ^ ~one;
            REGISTER(at) = one;
        }
        for (uint32_t at = from; at < to; at += WORD) {
            wrong |= REGISTER(at) ^ one;
            REGISTER(at) = ~one;
        }
        for (uint32_t at = to; at > from;) {
            at -= WORD;
            wrong |= REGISTER(at) ^ ~one;
            REGISTER(at) = one;
        }
        for (uint32_t at = to; at > from;) {
            at -= WORD;
            wrong |= REGISTER(at) ^ one;
            REGISTER(at) = ~one;
        }
        for (uint32_t at = from; at < to; at += WORD) {
            wrong |= REGISTER(at) ^ ~one;
        }
    }
    return wrong == 0u;
}

/* CRC-32 of words, the low byte first: polynomial 0xEDB88320, reflected, from all ones, inverted at the end (zlib's). */
LOADER static uint32_t crc_of(uint32_t from, uint32_t words)
{
    uint32_t crc = 0xFFFFFFFFu;
    for (uint32_t k = 0u; k < words; k++) {
        crc ^= REGISTER(from + (WORD * k));
        for (uint32_t bit = 0u; bit < 32u; bit++) {
            crc = (crc >> 1) ^ (((crc & 1u) != 0u) ? 0xEDB88320u : 0u);
        }
    }
    return ~crc;
}

LOADER void load(void)
{
    const uint32_t start = ADDRESS(image_start);
    const uint32_t size = ADDRESS(image_end) - start;
    const uint32_t from = ADDRESS(image_load);
    bool sound = crc_of(ADDRESS(head) + sizeof head, head.words) == head.crc;
    sound = is_ram_sound(RAM, ADDRESS(ram_end)) && sound;
    for (uint32_t at = 0u; at < size; at += WORD) {
        REGISTER(start + at) = REGISTER(from + at);
        sound = (REGISTER(start + at) == REGISTER(from + at)) && sound;
    }
    if (!sound) {
        for (;;) { /* for ever, by a constant: of any other condition a compiler may believe that it ends */
        }
    }
    VTOR = start;
    __asm volatile("ldr r0, =image_start\n\t"
                   "ldr r1, [r0, #0]\n\t"
                   "msr msp, r1\n\t"
                   "ldr r1, [r0, #4]\n\t"
                   "bx r1\n\t"
                   ".ltorg");
    __builtin_unreachable();
}

/* A fault of the processor, or an interrupt that nobody asked for: all lines off and all commands 0, until the watchdog
   resets the chip. It takes the stack from its beginning, since a stack that was too deep is what it may have come
   from. */
__attribute__((naked)) static void halt(void)
{
    __asm volatile("ldr r0, =stack_top\n\t"
                   "msr msp, r0\n\t"
                   "ldr r0, =pico_halt\n\t"
                   "bx r0\n\t"
                   ".ltorg");
}

void reset(void)
{
    for (uint32_t at = ADDRESS(bss_start); at < ADDRESS(bss_end); at += WORD) {
        REGISTER(at) = 0u;
    }
    pico_main();
    halt();
}

#define INTERRUPTS 26

typedef struct {
    uint32_t *stack;
    void (*exceptions[15])(void);
    void (*interrupts[INTERRUPTS])(void);
} vector_table;

/* Reset, NMI, HardFault, SVCall, PendSV, SysTick; UART0 is interrupt 20. */
__attribute__((section(".vectors"), used)) static const vector_table vectors = {
    .stack = &stack_top,
    .exceptions = {reset, halt, halt, halt, halt, halt, halt, halt, halt, halt, halt, halt, halt, halt, pico_timer},
    .interrupts = {halt, halt, halt, halt, halt, halt,      halt, halt, halt, halt, halt, halt, halt,
                   halt, halt, halt, halt, halt, halt,      halt, pico_line, halt, halt, halt, halt, halt},
};
