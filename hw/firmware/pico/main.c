/* Clocks, line, timer and watchdog of the RP2040, and the main program, which only shows that it goes round.

   Everything of the core happens in the two interrupts. They have one priority, so neither interrupts the other, and a
   tie goes to SysTick, the lower number: a flood of bytes delays no tick by more than one full receiver. */
#include "pico.h"
#include "rp2040.h"

/* Pins of the line. */
#define PIN_TX 0u
#define PIN_RX 1u

/* 125 MHz / (16 * 921600) = 8 + 31/64, to 0.1 % */
#define BAUD_WHOLE 8u
#define BAUD_64THS 31u

/* Rounds in which a crystal or PLL starts, with room: ms at the ring oscillator's 6.5 MHz. */
#define ROUNDS 1000000u

/* In the watchdog's scratch register while it is ours: the ROM resets by the watchdog, too, once it has flashed. */
#define WATCHED 0x4D455421u

volatile uint32_t pico_beats;

static void wait_for(const volatile uint32_t *from, uint32_t bits)
{
    /* What does not come is not there: no clock, no line, no answer, and all outputs still safe. */
    for (uint32_t k = 0u; (k < ROUNDS) && ((*from & bits) != bits); k++) {
    }
}

static void out_of_reset(uint32_t subsystems)
{
    CLEAR_BITS(RESETS_RESET) = subsystems;
    wait_for(&RESETS_DONE, subsystems);
}

/* 12 MHz * feedback / first / second. */
static void start_pll(uint32_t pll, uint32_t feedback, uint32_t first, uint32_t second)
{
    REGISTER(pll + PLL_CS) = 1u;
    REGISTER(pll + PLL_FBDIV) = feedback;
    CLEAR_BITS(pll + PLL_PWR) = PLL_PWR_PD | PLL_PWR_VCO_PD;
    wait_for(&REGISTER(pll + PLL_CS), PLL_LOCKED);
    REGISTER(pll + PLL_PRIM) = (first << 16) | (second << 12);
    CLEAR_BITS(pll + PLL_PWR) = PLL_PWR_POSTDIV_PD;
}

static void start_clocks(void)
{
    XOSC_STARTUP = 47u; /* 1 ms at 12 MHz, in 256 periods */
    XOSC_CTRL = XOSC_ON_1_TO_15_MHZ;
    wait_for(&XOSC_STATUS, XOSC_STABLE);
    CLK_REF_CTRL = CLK_REF_XOSC;
    wait_for(&CLK_REF_SELECTED, 1u << CLK_REF_XOSC);
    out_of_reset(RESET_PLL_SYS | RESET_PLL_USB);
    start_pll(PLL_SYS, 125u, 6u, 2u); /* 125 MHz */
    start_pll(PLL_USB, 100u, 5u, 5u); /* 48 MHz */
    CLK_SYS_CTRL = CLK_SYS_AUX;
    wait_for(&CLK_SYS_SELECTED, 1u << CLK_SYS_AUX);
    CLK_PERI_CTRL = CLK_ENABLE;
    CLK_ADC_CTRL = CLK_ENABLE;
    WATCHDOG_TICK = WATCHDOG_TICK_ENABLE | 12u; /* 1 us, of the crystal: for the timer and the watchdog */
    out_of_reset(RESET_TIMER);
}

static void start_line(void)
{
    out_of_reset(RESET_UART0);
    UART_IBRD = BAUD_WHOLE;
    UART_FBRD = BAUD_64THS;
    UART_LCRH = UART_8_BITS_FIFO;
    UART_IFLS = 0u; /* asks to be read from 4 bytes on, or after a pause */
    UART_IM = UART_RX | UART_RX_TIMEOUT;
    UART_CTL = UART_ON_TX_RX;
    PIN_PAD(PIN_RX) = PAD_SCHMITT | PAD_PULL_UP | PAD_INPUT;
    PIN_CTRL(PIN_TX) = PIN_UART;
    PIN_CTRL(PIN_RX) = PIN_UART;
    NVIC_ISER = NVIC_UART0;
}

static void start_timer(void)
{
    const bool free_running = !board_is_in_lock_step();
    SYSTICK_RVR = free_running ? board_wiring.reload : SYSTICK_LONGEST;
    SYSTICK_CVR = 0u;
    SYSTICK_CSR = SYSTICK_ON | (free_running ? SYSTICK_INTERRUPT : 0u);
}

static void start_watchdog(void)
{
    if (board_wiring.watchdog != 0u) {
        PSM_WDSEL = PSM_ALL_BUT_OSCILLATORS;
        port_kick();
        WATCHDOG_SCRATCH = WATCHED;
        WATCHDOG_CTRL = WATCHDOG_ENABLE;
    }
}

/* Fills the transmitter; its interrupt is asked for only while bytes are left. */
static void send(void)
{
    uint8_t byte = 0u;
    while (((UART_FR & UART_FR_TX_FULL) == 0u) && (board_send(&byte, 1u) == 1u)) {
        UART_DR = byte;
    }
    const uint32_t always = UART_RX | UART_RX_TIMEOUT;
    UART_IM = ((UART_FR & UART_FR_TX_FULL) != 0u) ? (always | UART_TX) : always;
}

void pico_main(void)
{
    const bool by_timer = (WATCHDOG_REASON & WATCHDOG_BY_TIMER) != 0u;
    const bed_cause cause = (by_timer && (WATCHDOG_SCRATCH == WATCHED)) ? BED_WATCHDOG : BED_POWER;
    out_of_reset(RESET_IO_BANK0 | RESET_PADS_BANK0);
    board_start(); /* the safe state, by pins that are driven now */
    start_clocks();
    start_watchdog();
    board_boot(cause);
    start_timer();
    start_line();
    __asm volatile("cpsie i");
    for (;;) {
        pico_beats++;
        __asm volatile("wfi");
    }
}

void pico_timer(void)
{
    board_tick();
}

void pico_line(void)
{
    /* Not UART_RX, which goes when the receiver has been read: cleared with bytes left in it, it would not come back. */
    UART_ICR = UART_RX_TIMEOUT | UART_TX;
    for (uint32_t k = 0u; (k < UART_FIFO) && ((UART_FR & UART_FR_RX_EMPTY) == 0u); k++) {
        /* A byte with an error of the line is passed on as it is: its frame's CRC is wrong. */
        const uint8_t byte = (uint8_t)(UART_DR & 0xFFu);
        board_receive(&byte, 1u);
        send();
    }
    send();
}

void pico_halt(void)
{
    board_halt();
    for (;;) {
    }
}

uint32_t port_session(void)
{
    /* 32 of the ring oscillator's random bits and the us of the first HELLO, mixed so that near ones are far apart. */
    uint32_t x = TIMER_RAW_LOW;
    for (uint32_t k = 0u; k < 32u; k++) {
        x = ((x << 1) | (x >> 31)) ^ (ROSC_RANDOMBIT & 1u);
    }
    x = (x ^ (x >> 16)) * 0x7FEB352Du;
    x = (x ^ (x >> 15)) * 0x846CA68Bu;
    return x ^ (x >> 16);
}
