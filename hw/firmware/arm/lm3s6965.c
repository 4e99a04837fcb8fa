/* Clock, line and timer of the LM3S6965 (Texas Instruments, LM3S6965 data sheet, SPMS262). Runs under
   `qemu-system-arm -M lm3s6965evb`.

   Everything of the core happens in the two interrupts. They have one priority, so neither interrupts the other, and a
   tie goes to SysTick, the lower number: a flood of bytes delays no tick by more than one full receiver. */
#include "lm3s6965.h"

#include "board.h"
#include "plant.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))

#define SYSCTL_RIS REGISTER(0x400FE050u)
#define SYSCTL_RCC REGISTER(0x400FE060u)
#define SYSCTL_RCGC1 REGISTER(0x400FE104u)
#define SYSCTL_RCGC2 REGISTER(0x400FE108u)
#define RCC_SYSDIV_4 (3u << 23)
#define RCC_SYSDIV (0xFu << 23)
#define RCC_USESYSDIV (1u << 22)
#define RCC_PWRDN (1u << 13)
#define RCC_BYPASS (1u << 11)
#define RCC_XTAL (0xFu << 6)
#define RCC_XTAL_8_MHZ (0xEu << 6)
#define RCC_OSCSRC (3u << 4)
#define RCC_MOSCDIS (1u << 0)
#define RIS_PLL_LOCKED (1u << 6)

#define GPIOA_AFSEL REGISTER(0x40004420u)
#define GPIOA_DEN REGISTER(0x4000451Cu)

#define UART_DR REGISTER(0x4000C000u)
#define UART_FR REGISTER(0x4000C018u)
#define UART_IBRD REGISTER(0x4000C024u)
#define UART_FBRD REGISTER(0x4000C028u)
#define UART_LCRH REGISTER(0x4000C02Cu)
#define UART_CTL REGISTER(0x4000C030u)
#define UART_IM REGISTER(0x4000C038u)
#define UART_ICR REGISTER(0x4000C044u)
#define FR_RX_EMPTY (1u << 4)
#define FR_TX_FULL (1u << 5)
#define INTERRUPT_RX (1u << 4)
#define INTERRUPT_TX (1u << 5)
#define INTERRUPT_RX_TIMEOUT (1u << 6)
#define LCRH_8_BITS_FIFO 0x70u
#define CTL_ENABLE_TX_RX 0x301u
/* bytes that the receiver holds */
#define FIFO 16u

#define SYSTICK_CSR REGISTER(0xE000E010u)
#define SYSTICK_RVR REGISTER(0xE000E014u)
#define SYSTICK_CVR REGISTER(0xE000E018u)
#define SYSTICK_ON 0x5u
#define SYSTICK_INTERRUPT 0x2u
#define SYSTICK_LONGEST 0xFFFFFFu
#define NVIC_ISER0 REGISTER(0xE000E100u)
#define UART0 (1u << 5)

/* Hz: 200 MHz of the PLL by 4. */
#define CLOCK 50000000.0
/* 50 MHz / (16 * 921600) = 3 + 25/64, to 0.005 % */
#define BAUD_WHOLE 3u
#define BAUD_64THS 25u

/* Boots since power came; its bits are kept over a reset. */
__attribute__((section(".noinit"))) static uint32_t boots;

static void start_clock(void)
{
    uint32_t rcc = (SYSCTL_RCC | RCC_BYPASS) & ~RCC_USESYSDIV;
    SYSCTL_RCC = rcc;
    rcc &= ~(RCC_XTAL | RCC_OSCSRC | RCC_PWRDN | RCC_MOSCDIS);
    rcc |= RCC_XTAL_8_MHZ;
    SYSCTL_RCC = rcc;
    rcc = (rcc & ~RCC_SYSDIV) | RCC_SYSDIV_4 | RCC_USESYSDIV;
    SYSCTL_RCC = rcc;
    /* 0.5 ms by the data sheet; a PLL that never locks leaves the crystal, and a line at another rate: no answer. */
    for (uint32_t k = 0u; (k < 100000u) && ((SYSCTL_RIS & RIS_PLL_LOCKED) == 0u); k++) {
    }
    if ((SYSCTL_RIS & RIS_PLL_LOCKED) != 0u) {
        SYSCTL_RCC = rcc & ~RCC_BYPASS;
    }
}

static void start_line(void)
{
    SYSCTL_RCGC1 |= 1u;
    SYSCTL_RCGC2 |= 1u;
    GPIOA_AFSEL |= 3u;
    GPIOA_DEN |= 3u;
    UART_CTL = 0u;
    UART_IBRD = BAUD_WHOLE;
    UART_FBRD = BAUD_64THS;
    UART_LCRH = LCRH_8_BITS_FIFO;
    UART_IM = INTERRUPT_RX | INTERRUPT_RX_TIMEOUT;
    UART_CTL = CTL_ENABLE_TX_RX;
    NVIC_ISER0 = UART0;
}

static void start_timer(void)
{
    const bool free_running = !board_is_in_lock_step();
    SYSTICK_RVR = free_running ? ((uint32_t)((plant_period * CLOCK) + 0.5) - 1u) : SYSTICK_LONGEST;
    SYSTICK_CVR = 0u;
    SYSTICK_CSR = SYSTICK_ON | (free_running ? SYSTICK_INTERRUPT : 0u);
}

/* Fills the transmitter; its interrupt is asked for only while bytes are left. */
static void send(void)
{
    uint8_t byte;
    while (((UART_FR & FR_TX_FULL) == 0u) && (board_send(&byte, 1u) == 1u)) {
        UART_DR = byte;
    }
    const uint32_t always = INTERRUPT_RX | INTERRUPT_RX_TIMEOUT;
    UART_IM = ((UART_FR & FR_TX_FULL) != 0u) ? (always | INTERRUPT_TX) : always;
}

void lm3s6965_main(void)
{
    board_boot(BED_POWER); /* first of all: the safe state */
    boots++;
    start_clock();
    start_timer();
    start_line();
    for (;;) {
        __asm volatile("wfi");
    }
}

void lm3s6965_timer(void)
{
    board_tick();
}

void lm3s6965_line(void)
{
    /* Not INTERRUPT_RX, which goes when the receiver has been read: cleared with bytes left in it, it would not come
       back. */
    UART_ICR = INTERRUPT_RX_TIMEOUT | INTERRUPT_TX;
    for (uint32_t k = 0u; (k < FIFO) && ((UART_FR & FR_RX_EMPTY) == 0u); k++) {
        /* A byte with an error of the line is passed on as it is: its frame's CRC is wrong. */
        const uint8_t byte = (uint8_t)(UART_DR & 0xFFu);
        board_receive(&byte, 1u);
        send();
    }
    send();
}

void lm3s6965_halt(void)
{
    port_set_current(0);
    port_set_voltage(0);
    for (;;) {
    }
}

uint32_t port_session(void)
{
    /* The time of the first HELLO, to 20 ns, and the boots since power came; mixed so that near ones are far apart. */
    uint32_t x = SYSTICK_CVR ^ (board_ticks() << 16) ^ (boots << 28);
    x = (x ^ (x >> 16)) * 0x7FEB352Du;
    x = (x ^ (x >> 15)) * 0x846CA68Bu;
    return x ^ (x >> 16);
}

void port_kick(void)
{
    /* The emulated board has a watchdog, but does not tell a reset by it: not a capability of this port. */
}
