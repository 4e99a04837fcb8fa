#include "bed.h"

/* Kinds of frames (docs/protocol.md). */
#define HELLO 0x01u
#define LIMIT 0x02u
#define ARM 0x03u
#define DRIVE 0x04u
#define STEP 0x05u
#define STOP 0x06u
#define CLEAR 0x07u
#define READ 0x08u
#define PRESET 0x09u
#define TOLD_HELLO 0x81u
#define TOLD_LIMITS 0x82u
#define TOLD_SAMPLE 0x84u

/* Of a payload: kind u8, sequence u16, body. */
#define BODY 3u

/* 16 dropped frames of the last 64 are too many. */
#define NOISE 16u

/* The outputs. */

static void command_nothing(bed *self)
{
    /* The load first: a load motor that drives is what can run away, and the drive at 0 V brakes. */
    port_set_current(0);
    port_set_voltage(0);
    self->voltage = 0;
    self->current = 0;
}

static void make_safe(bed *self)
{
    command_nothing(self);
    if (self->config->interlock != NULL) {
        interlock_rest(&self->interlock, self->config->interlock, self->sensors.rate);
    }
}

static void stop_for(bed *self, uint32_t faults)
{
    make_safe(self);
    self->state = BED_STOPPED;
    self->faults |= faults;
    if (self->config->interlock != NULL) {
        interlock_withdraw(&self->interlock);
        self->live |= self->config->interlock->needs_key ? INTERLOCK_BY_KEY : 0u;
    }
}

/* Numbers in bytes, the low one first. */

static uint64_t bits_at(const uint8_t *bytes, uint32_t count)
{
    uint64_t value = 0u;
    for (uint32_t k = 0u; k < count; k++) {
        value |= (uint64_t)bytes[k] << (8u * k);
    }
    return value;
}

static int32_t counts_at(const uint8_t *bytes)
{
    const uint32_t bits = (uint32_t)bits_at(bytes, 4u);
    /* Without a cast that the compiler may define: two's complement by hand. */
    return (bits <= (uint32_t)INT32_MAX) ? (int32_t)bits : (-(int32_t)(UINT32_MAX - bits) - 1);
}

static size_t put(uint8_t *bytes, size_t at, uint64_t value, uint32_t count)
{
    for (uint32_t k = 0u; k < count; k++) {
        bytes[at + k] = (uint8_t)((value >> (8u * k)) & 0xFFu);
    }
    return at + count;
}

static size_t put_counts(uint8_t *bytes, size_t at, int32_t value)
{
    return put(bytes, at, (uint32_t)value, 4u);
}

/* Answers. */

static bool can(const bed *self, uint32_t capability)
{
    return (self->config->capabilities & capability) != 0u;
}

static void answer(bed *self, uint8_t kind, uint16_t number, uint8_t *payload, size_t count)
{
    uint8_t frame[FRAME_OUT];
    payload[0] = kind;
    (void)put(payload, 1u, number, 2u);
    const size_t length = frame_encode(frame, payload, count);
    if (length <= BED_WAITING - self->waiting) {
        for (size_t k = 0u; k < length; k++) {
            self->going[(self->head + self->waiting) % BED_WAITING] = frame[k];
            self->waiting++;
        }
    }
}

static void answer_sample(bed *self, uint16_t number, bool refused)
{
    uint8_t payload[FRAME_PAYLOAD];
    uint32_t status = (uint32_t)self->state | self->faults;
    status |= self->greeted ? BED_GREETED : 0u;
    status |= self->by_watchdog ? BED_RESET_BY_WATCHDOG : 0u;
    status |= refused ? BED_REFUSED : 0u;
    size_t at = put(payload, BODY, status, 2u);
    at = put(payload, at, self->tick, 4u);
    at = put_counts(payload, at, self->sensors.rate);
    if (can(self, BED_HAS_ENCODER)) {
        at = put_counts(payload, at, self->sensors.angle);
    }
    if (can(self, BED_HAS_DRIVE_CURRENT)) {
        at = put_counts(payload, at, self->sensors.drive_current);
    }
    if (can(self, BED_HAS_ACCELEROMETER)) {
        at = put_counts(payload, at, self->sensors.acceleration);
    }
    if (can(self, BED_HAS_INTERLOCK)) {
        at = put(payload, at, ((self->faults & BED_FAULT_INTERLOCK) != 0u) ? self->because : self->live, 4u);
    }
    answer(self, TOLD_SAMPLE, number, payload, at);
}

static void answer_hello(bed *self, uint16_t number)
{
    const bed_config *config = self->config;
    uint8_t payload[FRAME_PAYLOAD];
    size_t at = put(payload, BODY, BED_VERSION, 1u);
    at = put(payload, at, config->capabilities, 2u);
    at = put(payload, at, self->session, 4u);
    for (size_t k = 0u; k < sizeof config->firmware; k++) {
        at = put(payload, at, config->firmware[k], 1u);
    }
    for (size_t k = 0u; k < sizeof config->name; k++) {
        at = put(payload, at, config->name[k], 1u);
    }
    for (size_t k = 0u; k < (sizeof config->announced / sizeof config->announced[0]); k++) {
        at = put(payload, at, config->announced[k], 8u);
    }
    answer(self, TOLD_HELLO, number, payload, at);
}

static void answer_limits(bed *self, uint16_t number)
{
    uint8_t payload[FRAME_PAYLOAD];
    size_t at = BODY;
    for (size_t k = 0u; k < BED_LIMITS; k++) {
        at = put_counts(payload, at, self->limits[k]);
    }
    answer(self, TOLD_LIMITS, number, payload, at);
}

/* Limits. */

static bool beyond(int32_t value, int32_t limit)
{
    return (value > limit) || (value < -limit);
}

static void take_limits_back(bed *self)
{
    for (size_t k = 0u; k < BED_LIMITS; k++) {
        self->limits[k] = self->config->limits[k];
    }
}

static bool slow(const bed *self)
{
    return !beyond(self->sensors.rate, self->config->arming_rate);
}

/* Half of what it may be: so that a load which is cleared and driven again and again is not driven more than it bears. */
static bool cooled(const bed *self)
{
    return self->heat <= self->config->heat.most / 2;
}

static bool too_steep(int32_t from, int32_t to, int32_t slew, uint32_t ticks)
{
    const int64_t change = (int64_t)to - from;
    const int64_t most = (int64_t)slew * (int64_t)ticks;
    return (change > most) || (change < -most);
}

/* Why a command stops the bed; 0 where it does not. */
static uint32_t wrong_with(const bed *self, int32_t voltage, int32_t current)
{
    const uint32_t ticks = (self->since > 0u) ? self->since : 1u;
    uint32_t faults = 0u;
    if (beyond(voltage, self->limits[BED_VOLTAGE]) || beyond(current, self->limits[BED_CURRENT])) {
        faults |= BED_FAULT_RANGE;
    }
    if (too_steep(self->voltage, voltage, self->limits[BED_VOLTAGE_SLEW], ticks) ||
        too_steep(self->current, current, self->limits[BED_CURRENT_SLEW], ticks)) {
        faults |= BED_FAULT_SLEW;
    }
    if (self->since == 0u) { /* not the first since the last tick: together they are one change */
        const uint32_t together = self->from_ticks + 1u;
        if (too_steep(self->from_voltage, voltage, self->limits[BED_VOLTAGE_SLEW], together) ||
            too_steep(self->from_current, current, self->limits[BED_CURRENT_SLEW], together)) {
            faults |= BED_FAULT_SLEW;
        }
    }
    return faults;
}

/* What is asked. Each answers whether it was possible. */

static void greet(bed *self)
{
    if (self->state == BED_ARMED) {
        make_safe(self);
        self->state = BED_DISARMED;
    }
    if (!self->greeted) {
        self->session = port_session();
        self->greeted = true;
    }
    take_limits_back(self);
}

static void tighten(bed *self, uint8_t which, int32_t value)
{
    if ((self->state == BED_DISARMED) && (which < BED_LIMITS) && (value >= 0)) {
        const int32_t own = self->config->limits[which];
        self->limits[which] = (value < own) ? value : own;
    }
}

static bool arm(bed *self, uint32_t session)
{
    const bool possible = (self->state == BED_DISARMED) && self->greeted && (session == self->session) && slow(self) &&
                          (self->heat <= self->config->heat.most) && (self->live == 0u);
    if (possible) {
        make_safe(self);
        if (self->config->interlock != NULL) {
            interlock_arm(&self->interlock, self->config->interlock);
        }
        self->since = 0u;
        self->from_voltage = 0;
        self->from_current = 0;
        self->from_ticks = 1u;
        self->dropped = 0u;
        self->drops = 0u;
        guard_tachometer_start(&self->tachometer);
        self->state = BED_ARMED;
    }
    return possible;
}

static bool command(bed *self, int32_t voltage, int32_t current)
{
    const bool possible = self->state == BED_ARMED;
    if (possible) {
        const uint32_t faults = wrong_with(self, voltage, current);
        if (faults != 0u) {
            stop_for(self, faults);
        } else {
            if (self->since > 0u) {
                self->from_voltage = self->voltage;
                self->from_current = self->current;
                self->from_ticks = self->since;
            }
            self->since = 0u;
            self->largest = beyond(current, self->largest) ? ((current < 0) ? -current : current) : self->largest;
            self->current = current;
            self->voltage = voltage;
            port_set_current(current);
            port_set_voltage(voltage);
        }
    }
    return possible;
}

static bool step(bed *self, int32_t voltage, int32_t current, uint8_t ticks)
{
    const bool possible = command(self, voltage, current);
    /* Time passes whatever came of the command: under the safe outputs where it was not taken. */
    for (uint32_t k = 0u; k < ticks; k++) {
        self->config->plant->advance();
        bed_tick(self);
    }
    return possible;
}

static void disarm(bed *self)
{
    make_safe(self);
    if (self->state == BED_ARMED) {
        self->state = BED_DISARMED;
    }
}

static bool clear(bed *self)
{
    const bool hot = ((self->faults & BED_FAULT_HEAT) != 0u) && !cooled(self);
    const interlock_config *config = self->config->interlock;
    const bool locked = (config != NULL) &&
                        !interlock_may_clear(&self->interlock, config, self->live, self->because);
    const bool possible =
        (self->state == BED_DISARMED) || ((self->state == BED_STOPPED) && slow(self) && !hot && !locked);
    if (possible) {
        make_safe(self);
        self->faults = 0u;
        self->because = 0u;
        self->state = BED_DISARMED;
    }
    return possible;
}

static bool preset(bed *self, uint8_t which, uint64_t bits)
{
    const bool possible = (self->state == BED_DISARMED) && self->config->plant->preset(which, bits);
    if (possible) {
        port_read(&self->sensors); /* a plant that starts anew */
    }
    return possible;
}

/* Frames. */

/* Whether the table of the page has this payload, for a device of these capabilities. */
static bool is_known(const bed *self, const uint8_t *payload, size_t count)
{
    const uint8_t last = payload[count - 1u];
    bool known;
    switch (payload[0]) {
    case HELLO:
        known = count == BODY + 1u;
        break;
    case LIMIT:
        known = count == BODY + 5u;
        break;
    case ARM:
        known = count == BODY + 4u;
        break;
    case DRIVE:
        known = !can(self, BED_IN_LOCK_STEP) && (count == BODY + 9u) && (last == 0u);
        break;
    case STEP:
        known = can(self, BED_IN_LOCK_STEP) && (count == BODY + 9u) && (last != 0u);
        break;
    case STOP:
    case CLEAR:
    case READ:
        known = count == BODY;
        break;
    case PRESET:
        known = can(self, BED_IS_SIMULATED) && (count == BODY + 9u);
        break;
    default:
        known = false;
        break;
    }
    return known;
}

/* Whether a frame of this number is new; it is the last new one then. */
static bool is_new(bed *self, uint8_t kind, uint16_t number)
{
    const uint32_t ahead = ((uint32_t)number - self->number) & 0xFFFFu;
    const bool found = (kind == HELLO) || !self->numbered || ((ahead >= 1u) && (ahead <= 32767u));
    if (found) {
        self->numbered = true;
        self->number = number;
    }
    return found;
}

/* Keeps count of the frames while armed. */
static void count_frame(bed *self, bool was_dropped)
{
    if (self->state == BED_ARMED) {
        self->drops -= (uint32_t)(self->dropped >> 63);
        self->dropped <<= 1;
        if (was_dropped) {
            self->dropped |= 1u;
            self->drops++;
        }
        if (self->drops >= NOISE) {
            stop_for(self, BED_FAULT_NOISE);
        }
    }
}

static void take(bed *self, const uint8_t *payload)
{
    const uint8_t kind = payload[0];
    const uint16_t number = (uint16_t)bits_at(&payload[1], 2u);
    const uint8_t *body = &payload[BODY];
    bool possible = true;
    if (!is_new(self, kind, number)) {
        answer_sample(self, number, false);
        return;
    }
    switch (kind) {
    case HELLO:
        greet(self);
        answer_hello(self, number);
        return;
    case LIMIT:
        tighten(self, body[0], counts_at(&body[1]));
        answer_limits(self, number);
        return;
    case ARM:
        possible = arm(self, (uint32_t)bits_at(body, 4u));
        break;
    case DRIVE:
        possible = command(self, counts_at(body), counts_at(&body[4]));
        break;
    case STEP:
        possible = step(self, counts_at(body), counts_at(&body[4]), body[8]);
        break;
    case STOP:
        disarm(self);
        break;
    case CLEAR:
        possible = clear(self);
        break;
    case PRESET:
        possible = preset(self, body[0], bits_at(&body[1], 8u));
        break;
    default: /* READ */
        break;
    }
    answer_sample(self, number, !possible);
}

static void end_frame(bed *self)
{
    uint8_t payload[FRAME_IN];
    const size_t count = (self->came < FRAME_IN) ? frame_decode(payload, self->coming, self->came) : 0u;
    const bool known = (count > 0u) && is_known(self, payload, count);
    self->came = 0u;
    count_frame(self, !known);
    if (known) {
        take(self, payload);
    }
}

/* What a port calls. */

void bed_boot(bed *self, const bed_config *config, bed_cause cause)
{
    command_nothing(self);
    self->config = config;
    self->live = 0u;
    self->because = 0u;
    if (config->interlock != NULL) {
        interlock_boot(&self->interlock, config->interlock);
        self->live = INTERLOCK_BY_TICK; /* until the first one */
    }
    self->state = BED_DISARMED;
    self->faults = 0u;
    self->greeted = false;
    self->by_watchdog = cause == BED_WATCHDOG;
    self->session = 0u;
    self->tick = 0u;
    take_limits_back(self);
    self->since = 0u;
    self->from_voltage = 0;
    self->from_current = 0;
    self->from_ticks = 1u;
    self->largest = 0;
    /* What the load was before, nobody knows. A bed with an interlock takes it for as hot as it may be. */
    self->heat = (config->interlock != NULL) ? config->heat.most : 0;
    guard_tachometer_start(&self->tachometer);
    self->dropped = 0u;
    self->drops = 0u;
    self->numbered = false;
    self->number = 0u;
    self->came = 0u;
    self->head = 0u;
    self->waiting = 0u;
    port_read(&self->sensors);
}

void bed_receive(bed *self, const uint8_t *bytes, size_t count)
{
    for (size_t k = 0u; k < count; k++) {
        if (bytes[k] != 0u) {
            if (self->came < FRAME_IN - 1u) {
                self->coming[self->came] = bytes[k];
                self->came++;
            } else {
                self->came = FRAME_IN; /* too long: to be dropped at its end */
            }
        } else if (self->came > 0u) {
            end_frame(self);
        } else {
            /* an empty frame means nothing */
        }
    }
}

size_t bed_send(bed *self, uint8_t *out, size_t room)
{
    size_t count = 0u;
    while ((count < room) && (self->waiting > 0u)) {
        out[count] = self->going[self->head];
        self->head = (self->head + 1u) % BED_WAITING;
        self->waiting--;
        count++;
    }
    return count;
}

/* What the interlock stops the bed for. */
static uint32_t interlocked(bed *self)
{
    const interlock_config *config = self->config->interlock;
    uint32_t stops = 0u;
    if (config != NULL) {
        const bool armed = self->state == BED_ARMED;
        self->live = interlock_tick(&self->interlock, config, armed, &self->sensors, self->current);
        stops = armed ? self->live : interlock_latching(self->live);
        self->because |= stops;
    }
    return (stops != 0u) ? BED_FAULT_INTERLOCK : 0u;
}

void bed_tick(bed *self)
{
    const bed_config *config = self->config;
    self->tick++;
    port_read(&self->sensors);
    const uint32_t lock = interlocked(self);
    /* A current that came and went between two readings is heat, too. */
    const bool seen = beyond(self->sensors.load_current, self->largest);
    self->heat = guard_heat(&config->heat, self->heat, seen ? self->sensors.load_current : self->largest);
    if (self->state == BED_ARMED) {
        uint32_t faults = lock;
        self->since++;
        if (self->since >= config->deadman) {
            faults |= BED_FAULT_DEADMAN;
        }
        if (beyond(self->sensors.load_current, config->load_trip) ||
            (can(self, BED_HAS_DRIVE_CURRENT) && beyond(self->sensors.drive_current, config->drive_trip))) {
            faults |= BED_FAULT_CURRENT;
        }
        if (self->heat > config->heat.most) {
            faults |= BED_FAULT_HEAT;
        }
        if (beyond(self->sensors.rate, self->limits[BED_RATE])) {
            faults |= BED_FAULT_RATE; /* a rate that is no good for the guard either */
        } else {
            const guard_verdict verdict = guard_tachometer_tick(&self->tachometer, &config->tachometer, self->voltage,
                                                                self->current, self->sensors.rate);
            if (verdict == GUARD_DEAD) {
                faults |= BED_FAULT_TACHOMETER_DEAD;
            } else if (verdict == GUARD_REVERSED) {
                faults |= BED_FAULT_TACHOMETER_REVERSED;
            } else {
                /* as the torque has it */
            }
        }
        if (faults != 0u) {
            stop_for(self, faults);
        }
    } else if (lock != 0u) {
        stop_for(self, lock);
    } else {
        make_safe(self); /* again, whatever has become of the amplifiers' inputs */
    }
    self->largest = (self->current < 0) ? -self->current : self->current;
    port_kick();
}
