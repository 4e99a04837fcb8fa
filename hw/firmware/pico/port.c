/* The port of the core to a bench wired as docs/pico.md says: two PWM outputs each for the drive's and the load's
   command, an encoder, a converter behind a multiplexer, inputs and lines of the interlock, a pulse, the watchdog. */
#include "pico.h"
#include "rp2040.h"

/* Pins (docs/pico.md, "Pin by pin"). */
#define PIN_ENCODER_A 2u
#define PIN_ENCODER_B 3u
#define PIN_STOP 4u
#define PIN_READY 5u
#define PIN_ENABLED 6u
#define PIN_KEY 7u
#define PIN_LOAD_ENABLE 8u
#define PIN_DRIVE_ENABLE 9u
#define PIN_BRAKE_RELEASE 10u
#define PIN_PULSE 11u
#define PIN_SELECT_0 12u
#define PIN_SELECT_1 13u
#define PIN_DRIVE_UP 16u
#define PIN_DRIVE_DOWN 17u
#define PIN_LOAD_UP 18u
#define PIN_LOAD_DOWN 19u
#define PIN_LED 25u
#define PIN_RATE 26u
#define PIN_DRIVE_CURRENT 27u
#define PIN_MULTIPLEXER 28u

#define BIT(pin) (1u << (pin))
#define LINES (BIT(PIN_LOAD_ENABLE) | BIT(PIN_DRIVE_ENABLE) | BIT(PIN_BRAKE_RELEASE))
#define SELECTS (BIT(PIN_SELECT_0) | BIT(PIN_SELECT_1))
#define DRIVEN (LINES | SELECTS | BIT(PIN_PULSE) | BIT(PIN_LED))

/* The slices of the PWM pins: up is output A, down is B. */
#define SLICE_DRIVE 0u
#define SLICE_LOAD 1u
/* Steps of a period, less one: 30.5 kHz. */
#define PWM_LAST 4095u

/* Channels of the converter, and the inputs of the multiplexer on the last. */
#define CHANNEL_RATE 0u
#define CHANNEL_DRIVE_CURRENT 1u
#define CHANNEL_MULTIPLEXER 2u
#define INPUT_LOAD_CURRENT 0u
#define INPUT_TEMPERATURE 1u
#define INPUT_BUS 2u
#define INPUT_REFERENCE 3u

/* Resistors pull an input to an end of the converter where its wire is off. */
#define LOWEST 16
#define HIGHEST 4079
#define NO_READING (-1)
/* A conversion takes 250 clocks of the processor; a round of waiting takes 5 or more. */
#define ADC_ROUNDS 200u

/* The encoder's program: samples both pins, jumps by what they were and are into a table, counts in Y and tells it.
   A change of both at once is none that a shaft can make: flag 0. X is what they were. Instructions by the datasheet,
   3.4. A leads B where it turns to the positive. */
#define TELL 19u
#define SAMPLE 21u
#define UP 16u
#define LOST 26u
#define DOWN 28u
static const uint16_t encoder_program[30] = {
    /* 00 -> */ TELL, UP,   DOWN, LOST,
    /* 01 -> */ DOWN, TELL, LOST, UP,
    /* 10 -> */ UP,   LOST, TELL, DOWN,
    /* 11 -> */ LOST, DOWN, UP,   TELL,
    /* 16 up */ 0xA04Au, /* mov y, ~y */
    0x0092u,             /* jmp y--, 18 */
    0xA04Au,             /* mov y, ~y */
    /* 19 tell */ 0xA0C2u, /* mov isr, y */
    0x8000u,               /* push noblock */
    /* 21 sample */ 0xA0C3u, /* mov isr, null */
    0x4022u,                 /* in x, 2 */
    0x4002u,                 /* in pins, 2 */
    0xA026u,                 /* mov x, isr */
    0xA0A6u,                 /* mov pc, isr */
    /* 26 lost */ 0xC000u, /* irq nowait 0 */
    TELL,                  /* jmp 19 */
    /* 28 down */ 0x0093u, /* jmp y--, 19 */
    TELL,                  /* jmp 19 */
};
#define ENCODER_AT_START 0xA020u /* mov x, pins */
#define ENCODER_ZERO 0xE040u     /* set y, 0 */
/* A sample every 110 clocks at most: 0.9 us. */
#define ENCODER_DIVIDER 10u
/* Values that its queue holds, and rounds in which a new one comes: 110 clocks. */
#define ENCODER_QUEUE 4u
#define ENCODER_ROUNDS 200u

/* Values that the rate by the encoder looks back, a power of two. */
#define BACK 64u

extern const bed_config board_config;
extern const interlock_port board_interlock_port;

static bed the_bed;
static int32_t angle;
static int32_t angles[BACK];
static uint32_t angles_at;
static bool angle_known;
static int32_t temperature;
static int32_t bus;
static bool reference_sound;
static uint32_t input; /* that the multiplexer is asked for in this tick */

/* Pins. */

static void drive_pin(uint32_t pin)
{
    PIN_PAD(pin) = PAD_SCHMITT | PAD_PULL_DOWN | PAD_4_MA | PAD_INPUT;
    PIN_CTRL(pin) = PIN_SIO;
}

static void read_pin(uint32_t pin, uint32_t function)
{
    PIN_PAD(pin) = PAD_SCHMITT | PAD_PULL_DOWN | PAD_INPUT | PAD_NO_OUTPUT;
    PIN_CTRL(pin) = function;
}

static void convert_pin(uint32_t pin)
{
    PIN_PAD(pin) = PAD_NO_OUTPUT;
    PIN_CTRL(pin) = PIN_NONE;
}

static void pulse_width_pin(uint32_t pin)
{
    PIN_PAD(pin) = PAD_SCHMITT | PAD_PULL_DOWN | PAD_4_MA | PAD_INPUT;
    PIN_CTRL(pin) = PIN_PWM;
}

static void start_slice(uint32_t slice)
{
    PWM_CSR(slice) = 0u;
    PWM_CC(slice) = 0u;
    PWM_CTR(slice) = 0u;
    PWM_DIV(slice) = 1u << 4;
    PWM_TOP(slice) = PWM_LAST;
    PWM_CSR(slice) = 1u;
}

static void start_encoder(void)
{
    for (uint32_t k = 0u; k < (sizeof encoder_program / sizeof encoder_program[0]); k++) {
        PIO_MEMORY(k) = encoder_program[k];
    }
    PIO_CLKDIV = ENCODER_DIVIDER << 16;
    PIO_SHIFTCTRL = 0u; /* to the left: what came first ends up highest */
    PIO_PINCTRL = PIN_ENCODER_A << 15;
    PIO_INSTR = ENCODER_AT_START;
    PIO_INSTR = ENCODER_ZERO;
    PIO_INSTR = SAMPLE; /* jmp */
    PIO_CTRL = PIO_ON;
}

void board_start(void)
{
    SIO_OUT = 0u;
    SIO_OE_SET = DRIVEN;
    for (uint32_t pin = 0u; pin < 30u; pin++) {
        if ((DRIVEN & BIT(pin)) != 0u) {
            drive_pin(pin);
        }
    }
    const uint32_t both = RESET_PWM | RESET_PIO0;
    CLEAR_BITS(RESETS_RESET) = both;
    for (uint32_t k = 0u; (k < ADC_ROUNDS) && ((RESETS_DONE & both) != both); k++) {
    }
    start_slice(SLICE_DRIVE);
    start_slice(SLICE_LOAD);
    pulse_width_pin(PIN_DRIVE_UP);
    pulse_width_pin(PIN_DRIVE_DOWN);
    pulse_width_pin(PIN_LOAD_UP);
    pulse_width_pin(PIN_LOAD_DOWN);
    read_pin(PIN_STOP, PIN_SIO);
    read_pin(PIN_READY, PIN_SIO);
    read_pin(PIN_ENABLED, PIN_SIO);
    read_pin(PIN_KEY, PIN_SIO);
    read_pin(PIN_ENCODER_A, PIN_PIO0);
    read_pin(PIN_ENCODER_B, PIN_PIO0);
    convert_pin(PIN_RATE);
    convert_pin(PIN_DRIVE_CURRENT);
    convert_pin(PIN_MULTIPLEXER);
    start_encoder();
}

void board_halt(void)
{
    PWM_CC(SLICE_LOAD) = 0u;
    PWM_CC(SLICE_DRIVE) = 0u;
    SIO_OUT_CLEAR = DRIVEN;
}

/* Commands: one output of a slice has the pulse width, the other none. */

static void command(uint32_t slice, int32_t counts)
{
    PWM_CC(slice) = (counts >= 0) ? (uint32_t)counts : ((uint32_t)(-counts) << 16);
}

void port_set_current(int32_t counts)
{
    command(SLICE_LOAD, counts);
}

void port_set_voltage(int32_t counts)
{
    command(SLICE_DRIVE, counts);
}

/* Sensors. */

static int32_t converted(uint32_t channel)
{
    ADC_CS = ADC_ON | ADC_CHANNEL(channel);
    ADC_CS = ADC_ON | ADC_CHANNEL(channel) | ADC_START;
    for (uint32_t k = 0u; k < ADC_ROUNDS; k++) {
        const uint32_t found = ADC_CS;
        if ((found & ADC_READY) != 0u) {
            return ((found & ADC_ERROR) != 0u) ? NO_READING : (int32_t)(ADC_RESULT & 0xFFFu);
        }
    }
    return NO_READING;
}

static bool is_reading(int32_t steps)
{
    return (steps >= LOWEST) && (steps <= HIGHEST);
}

static void select(uint32_t which)
{
    SIO_OUT_CLEAR = SELECTS;
    SIO_OUT_SET = which << PIN_SELECT_0;
}

/* The newest count of the encoder: what waits in its queue is old. */
static void read_encoder(void)
{
    for (uint32_t k = 0u; (k < ENCODER_QUEUE) && ((PIO_FSTAT & PIO_RX_EMPTY) == 0u); k++) {
        (void)PIO_RXF0;
    }
    angle_known = false;
    for (uint32_t k = 0u; (k < ENCODER_ROUNDS) && !angle_known; k++) {
        if ((PIO_FSTAT & PIO_RX_EMPTY) == 0u) {
            angle = (int32_t)PIO_RXF0;
            angle_known = true;
        }
    }
    angles_at = (angles_at + 1u) % BACK;
    angles[angles_at] = angle;
}

static int32_t rate_by_encoder(void)
{
    const uint32_t before = (uint32_t)angles[(angles_at + BACK - board_wiring.rate_ticks) % BACK];
    return angle_known ? (int32_t)((uint32_t)angle - before) : BED_RATE_UNKNOWN;
}

static int32_t rate_by_tachometer(int32_t steps)
{
    return is_reading(steps) ? ((steps - board_wiring.rate_zero) * board_wiring.rate_sign) : BED_RATE_UNKNOWN;
}

/* One of the slow readings a tick, each in its turn. */
static void keep(int32_t steps)
{
    if (input == INPUT_TEMPERATURE) {
        /* A thermistor whose resistance falls with heat, to ground. */
        temperature = is_reading(steps) ? (HIGHEST - steps) : INT32_MAX;
    } else if (input == INPUT_BUS) {
        bus = steps;
    } else {
        const int32_t off = steps - board_wiring.reference;
        reference_sound = (off <= board_wiring.reference_off) && (off >= -board_wiring.reference_off);
    }
    input = (input < INPUT_REFERENCE) ? (input + 1u) : INPUT_TEMPERATURE;
}

void port_read(port_sensors *sensors)
{
    /* The multiplexer settles while the other channels are converted. */
    const int32_t load = converted(CHANNEL_MULTIPLEXER);
    select(input);
    const int32_t rate = converted(CHANNEL_RATE);
    const int32_t drive = converted(CHANNEL_DRIVE_CURRENT);
    keep(converted(CHANNEL_MULTIPLEXER));
    select(INPUT_LOAD_CURRENT);
    read_encoder();
    sensors->rate = (board_wiring.rate_ticks != 0u) ? rate_by_encoder() : rate_by_tachometer(rate);
    sensors->angle = angle;
    sensors->drive_current =
        is_reading(drive) ? ((drive - board_wiring.drive_zero) * board_wiring.drive_sign) : INT32_MAX;
    sensors->load_current =
        is_reading(load) ? (((load - board_wiring.load_zero) * board_wiring.load_counts) / board_wiring.load_steps)
                         : INT32_MAX;
    sensors->acceleration = 0;
}

/* Interlock. */

static uint32_t input_of(uint32_t pins, uint32_t pin, uint32_t line)
{
    return ((pins & BIT(pin)) != 0u) ? line : 0u;
}

static void read_inputs(interlock_inputs *inputs)
{
    const uint32_t pins = SIO_IN;
    inputs->lines = input_of(pins, PIN_STOP, INTERLOCK_STOP) | input_of(pins, PIN_READY, INTERLOCK_READY) |
                    input_of(pins, PIN_ENABLED, INTERLOCK_ENABLED) | input_of(pins, PIN_KEY, INTERLOCK_KEY) |
                    (reference_sound ? INTERLOCK_CONVERTER : 0u);
    inputs->temperature = board_wiring.has_temperature ? temperature : 0;
    inputs->bus = board_wiring.has_bus ? bus : 0;
    inputs->clock = TIMER_RAW_LOW;
    inputs->beats = pico_beats;
    inputs->lost_step = ((PIO_IRQ & 1u) != 0u) || !angle_known;
    PIO_IRQ = 1u;
}

static void set_lines(uint32_t lines)
{
    uint32_t pins = 0u;
    pins |= ((lines & INTERLOCK_LOAD_ENABLE) != 0u) ? BIT(PIN_LOAD_ENABLE) : 0u;
    pins |= ((lines & INTERLOCK_DRIVE_ENABLE) != 0u) ? BIT(PIN_DRIVE_ENABLE) : 0u;
    pins |= ((lines & INTERLOCK_BRAKE_RELEASE) != 0u) ? BIT(PIN_BRAKE_RELEASE) : 0u;
    SIO_OUT_CLEAR = LINES & ~pins;
    SIO_OUT_SET = pins;
}

const interlock_port board_interlock_port = {read_inputs, set_lines};

void port_kick(void)
{
    WATCHDOG_LOAD = 2u * board_wiring.watchdog; /* it counts two a us (erratum RP2040-E1) */
    SIO_OUT_XOR = BIT(PIN_PULSE);               /* what holds the enable relay is these edges, not a level */
}

/* The one bed. */

void board_boot(bed_cause cause)
{
    CLEAR_BITS(RESETS_RESET) = RESET_ADC;
    for (uint32_t k = 0u; (k < ADC_ROUNDS) && ((RESETS_DONE & RESET_ADC) == 0u); k++) {
    }
    ADC_CS = ADC_ON;
    select(INPUT_LOAD_CURRENT);
    input = INPUT_TEMPERATURE;
    /* Before the first tick all slow readings are there. */
    for (uint32_t k = 0u; k < 3u; k++) {
        port_sensors sensors;
        port_read(&sensors);
    }
    for (uint32_t k = 0u; k < BACK; k++) {
        angles[k] = angle;
    }
    bed_boot(&the_bed, &board_config, cause);
    SIO_OUT_SET = BIT(PIN_LED); /* all that is tested at boot is sound */
}

void board_tick(void)
{
    bed_tick(&the_bed);
}

void board_receive(const uint8_t *bytes, size_t count)
{
    bed_receive(&the_bed, bytes, count);
}

size_t board_send(uint8_t *out, size_t room)
{
    return bed_send(&the_bed, out, room);
}

bool board_is_in_lock_step(void)
{
    return false;
}
