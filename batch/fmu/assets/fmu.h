/* One instance of a co-simulation FMU: the part that does not depend on the version of FMI. Written by MET.

   model.h comes before: the program of a case (`met_case`, `met_start`, `met_tick`, `met_end`) and the table of
   variables. A variable's value reference is its place in the table.

   Ticks are numbered from the start of the simulation, MODEL_BASE_HZ of them a second. `now` is the memory before tick
   `next`. `seen` is the memory from which outputs are read: at a communication point on a tick, `now` after this tick
   with the inputs as they are; between ticks, `now` itself. So inputs that change at a communication point act from the
   tick there on, and the step that ends there is not computed again. */

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define EXPORTED __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORTED __attribute__((visibility("default")))
#else
#define EXPORTED
#endif

#define VARIABLES (sizeof met_variables / sizeof met_variables[0])

/* Times within this share of a tick of it are on it: those of a master are sums of its steps, each rounded. */
#define ON_TICK 1e-2

/* Whole numbers up to here are doubles. */
#define MOST_WHOLE 9007199254740992.0

typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED } Mode;

/* All that lasts of an instance, so that a copy of it is a state.

   token     of the FMU whose state it is
   on_tick   whether the communication point is on tick `next`
   changed   whether inputs have changed since `seen` was computed
   failed    whether the case has failed */
typedef struct {
    char token[sizeof MODEL_TOKEN];
    int32_t mode, on_tick, changed, failed, has_stop;
    int64_t next;
    double start, time, stop;
    met_case now, seen;
} Data;

typedef void (*Log)(void *instance, const char *message);

typedef struct {
    Data data;
    Log log;
} Instance;

typedef enum { OK, DISCARD, ERROR } Answer;

static double *place_of(met_case *memory, size_t variable)
{
    return (double *)(void *)((char *)memory + met_variables[variable].place);
}

static bool is_finite(double x)
{
    return x - x == 0.0;
}

/* Whether a sum of times as large as this is rounded to far less than a tick. */
static bool resolves_ticks(double time)
{
    return 4.0 * DBL_EPSILON * MODEL_BASE_HZ * met_abs(time) < ON_TICK;
}

static bool is_whole(double x)
{
    return x > -MOST_WHOLE && x < MOST_WHOLE && x == (double)(int64_t)x;
}

static Answer refuse(Instance *instance, const char *message)
{
    if (instance && instance->log) instance->log(instance, message);
    return ERROR;
}

/* A new or former instance as it is after instantiation: its variables have their start values. */
static void reset(Instance *instance)
{
    Data *const data = &instance->data;
    memset(data, 0, sizeof *data);
    memcpy(data->token, MODEL_TOKEN, sizeof MODEL_TOKEN);
    for (size_t i = 1; i < VARIABLES; i++) {
        if (met_variables[i].kind != OUTPUT) *place_of(&data->now, i) = met_variables[i].start;
    }
}

/* The outputs of the case in `seen`. */
static Answer finish(Instance *instance)
{
    Data *const data = &instance->data;
    met_end(&data->seen);
    for (size_t i = 0; i < sizeof met_alarms / sizeof met_alarms[0]; i++) {
        if (*(double *)(void *)((char *)&data->seen + met_alarms[i]) != 0.0) data->failed = 1;
    }
    if (data->failed) {
        char message[160];
        snprintf(message, sizeof message, "the case has failed by %.15g s: `met run` of its values says why",
                 data->start + data->seen.tick / MODEL_BASE_HZ);
        return refuse(instance, message);
    }
    return OK;
}

/* Compute `seen` as of the inputs. */
static Answer look(Instance *instance)
{
    Data *const data = &instance->data;
    if (!data->on_tick || !data->changed) return OK;
    if (data->mode == INITIALIZING) {
        data->failed = 0;
        met_start(&data->now);
    }
    if (data->failed) return refuse(instance, "the case has failed: reset it, or set an earlier state");
    data->seen = data->now;
    data->changed = 0;
    met_tick(&data->seen, data->next);
    return finish(instance);
}

/* The times of the simulation, before its initialization. */
static Answer set_up(Instance *instance, double start, bool has_stop, double stop)
{
    Data *const data = &instance->data;
    if (data->mode != INSTANTIATED) return refuse(instance, "only a new or reset instance can be initialized");
    if (!is_finite(start) || (has_stop && !(stop >= start))) {
        return refuse(instance, "the start must be a finite time, and the stop not before it");
    }
    if (!resolves_ticks(start)) return refuse(instance, "the start is so large that ticks are lost in rounding");
    data->start = data->time = start;
    data->has_stop = has_stop;
    data->stop = stop;
    return OK;
}

static Answer initialize(Instance *instance)
{
    Data *const data = &instance->data;
    if (data->mode != INSTANTIATED) return refuse(instance, "only a new or reset instance can be initialized");
    data->mode = INITIALIZING;
    data->on_tick = data->changed = 1;
    return OK;
}

static Answer begin_stepping(Instance *instance)
{
    if (instance->data.mode != INITIALIZING) return refuse(instance, "the instance is not being initialized");
    if (look(instance) != OK) return ERROR;
    if (instance->data.failed) return refuse(instance, "the case fails at the start: set other values, or reset it");
    instance->data.mode = STEPPING;
    return OK;
}

static Answer terminate(Instance *instance)
{
    if (instance->data.mode != STEPPING) return refuse(instance, "only an instance that steps can be terminated");
    instance->data.mode = TERMINATED;
    return OK;
}

static Answer refuse_reference(Instance *instance, uint32_t reference)
{
    char message[80];
    snprintf(message, sizeof message, "value reference %u: there is no such variable", (unsigned)reference);
    return refuse(instance, message);
}

static Answer set_values(Instance *instance, const uint32_t *variables, size_t count, const double *values)
{
    Data *const data = &instance->data;
    char message[500];
    if (count && (!variables || !values)) return refuse(instance, "no variables or values are given");
    if (data->mode == TERMINATED) return refuse(instance, "the simulation is terminated");
    for (size_t i = 0; i < count; i++) { /* all are checked before the first is set */
        const met_variable *variable;
        const char *why = 0;
        if (variables[i] >= VARIABLES) return refuse_reference(instance, variables[i]);
        variable = &met_variables[variables[i]];
        if (variable->kind == OUTPUT) why = "is computed and cannot be set";
        if (variable->kind == PARAMETER && data->mode == STEPPING) why = "is fixed once the simulation runs";
        if (why) {
            snprintf(message, sizeof message, "%.300s %s", variable->name, why);
            return refuse(instance, message);
        }
        if (!is_finite(values[i]) || values[i] < variable->min || values[i] > variable->max ||
            (variable->whole && !is_whole(values[i]))) {
            snprintf(message, sizeof message, "%.300s cannot be %.15g, only %s from %.15g to %.15g", variable->name,
                     values[i], variable->whole ? "a whole number" : "a number", variable->min, variable->max);
            refuse(instance, message);
            return DISCARD;
        }
    }
    for (size_t i = 0; i < count; i++) *place_of(&data->now, variables[i]) = values[i];
    if (count) data->changed = 1;
    return OK;
}

static Answer get_values(Instance *instance, const uint32_t *variables, size_t count, double *values)
{
    Data *const data = &instance->data;
    if (count && (!variables || !values)) return refuse(instance, "no variables or values are given");
    for (size_t i = 0; i < count; i++) {
        if (variables[i] >= VARIABLES) return refuse_reference(instance, variables[i]);
        if (variables[i] == 0) {
            values[i] = data->time;
        } else if (met_variables[variables[i]].kind == OUTPUT) {
            if (data->mode == INSTANTIATED) return refuse(instance, "outputs are known from the initialization on");
            if (data->mode != TERMINATED && look(instance) != OK) return ERROR;
            values[i] = *place_of(&data->seen, variables[i]);
        } else {
            values[i] = *place_of(&data->now, variables[i]);
        }
    }
    return OK;
}

/* Advance from the communication point `time` by `size`: all ticks before the new point are computed with the inputs as
   they are, and outputs are those of the tick at the new point; where there is none, of the last tick before it. */
static Answer advance(Instance *instance, double time, double size)
{
    Data *const data = &instance->data;
    Answer answer;
    double ticks, least;
    int64_t last;
    bool on_tick;
    if (data->mode != STEPPING) return refuse(instance, "only an initialized instance can step");
    if (data->failed) return refuse(instance, "the case has failed: reset it, or set an earlier state");
    least = ON_TICK / MODEL_BASE_HZ;
    if (!(time - data->time <= least && data->time - time <= least)) {
        return refuse(instance, "the step does not begin where the last one ended");
    }
    if (!(size > 0.0) || !is_finite(size)) return refuse(instance, "a step must be a finite time above 0");
    if (!resolves_ticks(time + size)) return refuse(instance, "the step leads to where ticks are lost in rounding");
    ticks = (time + size - data->start) * MODEL_BASE_HZ;
    if (data->has_stop && time + size > data->stop + least) return refuse(instance, "the step ends after the stop");
    last = (int64_t)(ticks + 0.5);
    on_tick = ticks - (double)last < ON_TICK && (double)last - ticks < ON_TICK;
    if (!on_tick) last = (int64_t)ticks + 1; /* the first tick after the new point */
    if (last > data->next) {
        if (look(instance) != OK) return ERROR;
        if (data->on_tick) {
            data->now = data->seen;
            data->next++;
        }
        for (; data->next < last; data->next++) met_tick(&data->now, data->next);
        data->seen = data->now;
        if (on_tick) met_tick(&data->seen, data->next);
        data->changed = 0;
        data->on_tick = on_tick;
    } else if (on_tick && !data->on_tick) { /* from between ticks to the next one */
        data->seen = data->now;
        met_tick(&data->seen, data->next);
        data->changed = 0;
        data->on_tick = on_tick;
    }
    answer = finish(instance);
    if (answer == OK) data->time = time + size;
    return answer;
}

/* States: copies of the data. A state as bytes ends with a checksum of the others. */
#define STATE_BYTES (sizeof(Data) + sizeof(uint64_t))

/* False also for a state of another FMU of MET. A state begins with its token. */
static bool is_state(const void *state)
{
    return state && !memcmp(state, MODEL_TOKEN, sizeof MODEL_TOKEN);
}

/* FNV-1a of the data's bytes (Fowler, Noll and Vo): another number where one byte differs. */
static uint64_t checksum_of(const unsigned char *bytes)
{
    uint64_t sum = UINT64_C(14695981039346656037);
    for (size_t i = 0; i < sizeof(Data); i++) sum = (sum ^ bytes[i]) * UINT64_C(1099511628211);
    return sum;
}

/* Write the state into `*state`, which is made if it is null. */
static Answer get_state(Instance *instance, void **state)
{
    if (!instance || !state) return refuse(instance, "there is no room for the state");
    if (*state && !is_state(*state)) return refuse(instance, "the room is no state of this FMU");
    if (!*state) *state = malloc(sizeof(Data));
    if (!*state) return refuse(instance, "there is no memory");
    *(Data *)*state = instance->data;
    return OK;
}

static Answer set_state(Instance *instance, const void *state)
{
    if (!instance || !is_state(state)) return refuse(instance, "this is no state of this FMU");
    instance->data = *(const Data *)state;
    return OK;
}

static Answer free_state(void **state)
{
    if (state) {
        free(*state);
        *state = 0;
    }
    return OK;
}

static Answer measure_state(Instance *instance, const void *state, size_t *size)
{
    if (!is_state(state) || !size) return refuse(instance, "this is no state of this FMU, or its size has no place");
    *size = STATE_BYTES;
    return OK;
}

static Answer write_state(Instance *instance, const void *state, void *bytes, size_t size)
{
    uint64_t sum;
    if (!is_state(state) || !bytes || size < STATE_BYTES) {
        return refuse(instance, "this is no state of this FMU, or there is too little room for it");
    }
    memcpy(bytes, state, sizeof(Data));
    sum = checksum_of(bytes);
    memcpy((char *)bytes + sizeof(Data), &sum, sizeof sum);
    return OK;
}

static Answer read_state(Instance *instance, const void *bytes, size_t size, void **state)
{
    uint64_t sum;
    if (!state || !bytes || size != STATE_BYTES || !is_state(bytes)) {
        return refuse(instance, "these bytes are not a state of this FMU");
    }
    memcpy(&sum, (const char *)bytes + sizeof(Data), sizeof sum);
    if (sum != checksum_of(bytes)) return refuse(instance, "the bytes of the state are damaged");
    *state = malloc(sizeof(Data));
    if (!*state) return refuse(instance, "there is no memory");
    memcpy(*state, bytes, sizeof(Data));
    return OK;
}
