/* The first 256 bytes of the flash: what the chip's ROM copies into RAM and runs, if their CRC is right (hw/boards/pico.py
   writes it behind them). Makes the flash readable as memory, then starts the loader (start.c).

   By the plain command 03h, which every serial flash has (RP2040 datasheet 2.7.1, 2.8.1, 4.10): 8 bits of command, 24
   of address, a word back, on one line each. Slow, but the flash is read but once. */
#include <stdint.h>

void boot2(void);

__attribute__((naked, section(".boot2"))) void boot2(void)
{
    __asm volatile("ldr r3, =0x18000000\n\t" /* SSI */
                   "movs r0, #0\n\t"
                   "str r0, [r3, #0x08]\n\t" /* SSIENR: off while it is set up */
                   "movs r0, #8\n\t"
                   "str r0, [r3, #0x14]\n\t" /* BAUDR: an eighth of the system's clock */
                   "ldr r0, =0x001F0300\n\t"
                   "str r0, [r3, #0x00]\n\t" /* CTRLR0: frames of 32 bits, EEPROM read */
                   "movs r0, #0\n\t"
                   "str r0, [r3, #0x04]\n\t" /* CTRLR1: one frame a read */
                   "ldr r0, =0x03000218\n\t"
                   "ldr r1, =0x180000F4\n\t"
                   "str r0, [r1]\n\t" /* SPI_CTRLR0: command 03h of 8 bits, 24 bits of address */
                   "movs r0, #1\n\t"
                   "str r0, [r3, #0x08]\n\t"
                   "ldr r3, =0x10000100\n\t"
                   "ldr r0, [r3, #0]\n\t"
                   "msr msp, r0\n\t"
                   "ldr r0, [r3, #4]\n\t"
                   "bx r0\n\t"
                   ".ltorg");
}
