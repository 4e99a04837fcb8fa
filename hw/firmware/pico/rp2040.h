/* Registers of the RP2040 that the Pico's port uses, by the RP2040 datasheet (Raspberry Pi Ltd; section in brackets). */
#ifndef RP2040_H
#define RP2040_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))

/* The same register, where writing sets or clears the bits that are written [2.1.2]. */
#define SET_BITS(address) REGISTER((address) + 0x2000u)
#define CLEAR_BITS(address) REGISTER((address) + 0x3000u)

/* RAM: four banks of 64 KiB and two of 4 KiB [2.6.2]. */
#define RAM 0x20000000u

/* Subsystem resets [2.14]. */
#define RESETS_RESET 0x4000C000u
#define RESETS_DONE REGISTER(0x4000C008u)
#define RESET_ADC (1u << 0)
#define RESET_IO_BANK0 (1u << 5)
#define RESET_PADS_BANK0 (1u << 8)
#define RESET_PIO0 (1u << 10)
#define RESET_PLL_SYS (1u << 12)
#define RESET_PLL_USB (1u << 13)
#define RESET_PWM (1u << 14)
#define RESET_TIMER (1u << 21)
#define RESET_UART0 (1u << 22)

/* Crystal oscillator [2.16], PLL [2.18], clocks [2.15]. */
#define XOSC_CTRL REGISTER(0x40024000u)
#define XOSC_STATUS REGISTER(0x40024004u)
#define XOSC_STARTUP REGISTER(0x4002400Cu)
#define XOSC_ON_1_TO_15_MHZ 0x00FABAA0u
#define XOSC_STABLE (1u << 31)
#define PLL_SYS 0x40028000u
#define PLL_USB 0x4002C000u
#define PLL_CS 0x0u
#define PLL_PWR 0x4u
#define PLL_FBDIV 0x8u
#define PLL_PRIM 0xCu
#define PLL_LOCKED (1u << 31)
#define PLL_PWR_VCO_PD (1u << 5)
#define PLL_PWR_POSTDIV_PD (1u << 3)
#define PLL_PWR_PD (1u << 0)
#define CLK_REF_CTRL REGISTER(0x40008030u)
#define CLK_REF_SELECTED REGISTER(0x40008038u)
#define CLK_SYS_CTRL REGISTER(0x4000803Cu)
#define CLK_SYS_SELECTED REGISTER(0x40008044u)
#define CLK_PERI_CTRL REGISTER(0x40008048u)
#define CLK_ADC_CTRL REGISTER(0x40008060u)
#define CLK_REF_XOSC 2u
#define CLK_SYS_AUX 1u /* of PLL_SYS */
#define CLK_ENABLE (1u << 11)

/* Ring oscillator's random bit [2.17]. */
#define ROSC_RANDOMBIT REGISTER(0x4006001Cu)

/* Power-on state machine [2.13], watchdog [4.7], timer of 1 MHz [4.6]. */
#define PSM_WDSEL REGISTER(0x40010008u)
#define PSM_ALL_BUT_OSCILLATORS 0x0001FFFCu
#define WATCHDOG_CTRL REGISTER(0x40058000u)
#define WATCHDOG_LOAD REGISTER(0x40058004u)
#define WATCHDOG_REASON REGISTER(0x40058008u)
#define WATCHDOG_SCRATCH REGISTER(0x4005800Cu) /* kept over its reset; 0 after all others */
#define WATCHDOG_TICK REGISTER(0x4005802Cu)
#define WATCHDOG_ENABLE (1u << 30)
#define WATCHDOG_BY_TIMER (1u << 0)
#define WATCHDOG_TICK_ENABLE (1u << 9)
#define TIMER_RAW_LOW REGISTER(0x40054028u)

/* Pins: functions [2.19.2], pads [2.19.6], and as the processor drives them [2.3.1.7]. */
#define PIN_CTRL(pin) REGISTER(0x40014004u + (8u * (pin)))
#define PIN_PAD(pin) REGISTER(0x4001C004u + (4u * (pin)))
#define PIN_UART 2u
#define PIN_PWM 4u
#define PIN_SIO 5u
#define PIN_PIO0 6u
#define PIN_NONE 31u
#define PAD_SCHMITT (1u << 1)
#define PAD_PULL_DOWN (1u << 2)
#define PAD_PULL_UP (1u << 3)
#define PAD_4_MA (1u << 4)
#define PAD_INPUT (1u << 6)
#define PAD_NO_OUTPUT (1u << 7)
#define SIO_IN REGISTER(0xD0000004u)
#define SIO_OUT REGISTER(0xD0000010u)
#define SIO_OUT_SET REGISTER(0xD0000014u)
#define SIO_OUT_CLEAR REGISTER(0xD0000018u)
#define SIO_OUT_XOR REGISTER(0xD000001Cu)
#define SIO_OE_SET REGISTER(0xD0000024u)

/* UART0, an ARM PL011 [4.2]. */
#define UART_DR REGISTER(0x40034000u)
#define UART_FR REGISTER(0x40034018u)
#define UART_IBRD REGISTER(0x40034024u)
#define UART_FBRD REGISTER(0x40034028u)
#define UART_LCRH REGISTER(0x4003402Cu)
#define UART_CTL REGISTER(0x40034030u)
#define UART_IFLS REGISTER(0x40034034u)
#define UART_IM REGISTER(0x40034038u)
#define UART_ICR REGISTER(0x40034044u)
#define UART_FR_RX_EMPTY (1u << 4)
#define UART_FR_TX_FULL (1u << 5)
#define UART_RX (1u << 4)
#define UART_TX (1u << 5)
#define UART_RX_TIMEOUT (1u << 6)
#define UART_8_BITS_FIFO 0x70u
#define UART_ON_TX_RX 0x301u
/* bytes that its receiver holds */
#define UART_FIFO 32u

/* Converter [4.9]. */
#define ADC_CS REGISTER(0x4004C000u)
#define ADC_RESULT REGISTER(0x4004C004u)
#define ADC_ON (1u << 0)
#define ADC_START (1u << 2)
#define ADC_READY (1u << 8)
#define ADC_ERROR (1u << 9)
#define ADC_CHANNEL(n) ((uint32_t)(n) << 12)

/* PWM [4.5]: slice n has outputs A and B. */
#define PWM_CSR(n) REGISTER(0x40050000u + (0x14u * (n)))
#define PWM_DIV(n) REGISTER(0x40050004u + (0x14u * (n)))
#define PWM_CTR(n) REGISTER(0x40050008u + (0x14u * (n)))
#define PWM_CC(n) REGISTER(0x4005000Cu + (0x14u * (n)))
#define PWM_TOP(n) REGISTER(0x40050010u + (0x14u * (n)))

/* PIO0, state machine 0 [3.7]. */
#define PIO_CTRL REGISTER(0x50200000u)
#define PIO_FSTAT REGISTER(0x50200004u)
#define PIO_RXF0 REGISTER(0x50200020u)
#define PIO_IRQ REGISTER(0x50200030u)
#define PIO_MEMORY(n) REGISTER(0x50200048u + (4u * (n)))
#define PIO_CLKDIV REGISTER(0x502000C8u)
#define PIO_EXECCTRL REGISTER(0x502000CCu)
#define PIO_SHIFTCTRL REGISTER(0x502000D0u)
#define PIO_INSTR REGISTER(0x502000D8u)
#define PIO_PINCTRL REGISTER(0x502000DCu)
#define PIO_RX_EMPTY (1u << 8)
#define PIO_ON (1u << 0)

/* Cortex-M0+ [2.4]. */
#define SYSTICK_CSR REGISTER(0xE000E010u)
#define SYSTICK_RVR REGISTER(0xE000E014u)
#define SYSTICK_CVR REGISTER(0xE000E018u)
#define SYSTICK_ON 0x5u
#define SYSTICK_INTERRUPT 0x2u
#define SYSTICK_LONGEST 0xFFFFFFu
#define NVIC_ISER REGISTER(0xE000E100u)
#define NVIC_UART0 (1u << 20)
#define VTOR REGISTER(0xE000ED08u)

#endif
