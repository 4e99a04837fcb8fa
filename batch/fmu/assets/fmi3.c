/* FMI 3.0 for co-simulation (https://fmi-standard.org), over fmu.h. Written by MET. */

#include "model.h"
#include "fmu.h"

#ifdef FMI3_FUNCTION_PREFIX
#define PASTED(a, b) a##b
#define PASTE(a, b) PASTED(a, b)
#define FMI3(name) PASTE(FMI3_FUNCTION_PREFIX, name)
#else
#define FMI3(name) name
#endif

#define FUNCTION(name) EXPORTED fmi3Status FMI3(name)

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef void *fmi3Instance, *fmi3FMUState, *fmi3InstanceEnvironment;
typedef uint32_t fmi3ValueReference;
typedef const char *fmi3String;
typedef const uint8_t *fmi3Binary;
typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String category, fmi3String message);

/* `instance` comes first, so that its address is that of the whole. */
typedef struct {
    Instance instance;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback message;
} Whole;

static void log_message(void *instance, const char *message)
{
    Whole *const whole = instance;
    whole->message(whole->environment, fmi3Error, "logStatusError", message);
}

static fmi3Status status_of(Answer answer)
{
    return answer == OK ? fmi3OK : answer == DISCARD ? fmi3Discard : fmi3Error;
}

static fmi3Status refused(fmi3Instance instance, const char *message)
{
    return status_of(refuse(instance, message));
}

EXPORTED const char *FMI3(fmi3GetVersion)(void);
EXPORTED const char *FMI3(fmi3GetVersion)(void)
{
    return "3.0";
}

FUNCTION(fmi3SetDebugLogging)(fmi3Instance instance, bool on, size_t count, const fmi3String categories[]);
FUNCTION(fmi3SetDebugLogging)(fmi3Instance instance, bool on, size_t count, const fmi3String categories[])
{
    (void)on; /* only errors are told, and always */
    for (size_t i = 0; i < count; i++) {
        if (!categories || !categories[i] || strcmp(categories[i], "logStatusError")) {
            return refused(instance, "the only category of messages is logStatusError");
        }
    }
    return instance ? fmi3OK : fmi3Error;
}

EXPORTED fmi3Instance FMI3(fmi3InstantiateCoSimulation)(
    fmi3String name, fmi3String token, fmi3String resources, bool visible, bool log, bool event_mode,
    bool early_return, const fmi3ValueReference intermediate[], size_t count, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback message, void (*update)(void));
EXPORTED fmi3Instance FMI3(fmi3InstantiateCoSimulation)(
    fmi3String name, fmi3String token, fmi3String resources, bool visible, bool log, bool event_mode,
    bool early_return, const fmi3ValueReference intermediate[], size_t count, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback message, void (*update)(void))
{
    const char *why = 0;
    Whole *whole;
    (void)name, (void)resources, (void)visible, (void)log, (void)early_return, (void)intermediate, (void)update;
    if (!token || strcmp(token, MODEL_TOKEN)) why = "the instantiation token is not that of this FMU";
    if (event_mode) why = "this FMU has no event mode";
    if (count) why = "this FMU has no intermediate variables";
    whole = why ? 0 : malloc(sizeof *whole);
    if (!whole) {
        if (message) message(environment, fmi3Error, "logStatusError", why ? why : "there is no memory");
        return 0;
    }
    reset(&whole->instance);
    whole->instance.log = message ? log_message : 0;
    whole->environment = environment;
    whole->message = message;
    return whole;
}

EXPORTED void FMI3(fmi3FreeInstance)(fmi3Instance instance);
EXPORTED void FMI3(fmi3FreeInstance)(fmi3Instance instance)
{
    free(instance);
}

FUNCTION(fmi3EnterInitializationMode)(
    fmi3Instance instance, bool has_tolerance, double tolerance, double start, bool has_stop, double stop);
FUNCTION(fmi3EnterInitializationMode)(
    fmi3Instance instance, bool has_tolerance, double tolerance, double start, bool has_stop, double stop)
{
    (void)has_tolerance, (void)tolerance; /* the steps of the run are fixed */
    if (!instance || set_up(instance, start, has_stop, stop) != OK) return fmi3Error;
    return status_of(initialize(instance));
}

FUNCTION(fmi3ExitInitializationMode)(fmi3Instance instance);
FUNCTION(fmi3ExitInitializationMode)(fmi3Instance instance)
{
    return instance ? status_of(begin_stepping(instance)) : fmi3Error;
}

FUNCTION(fmi3Terminate)(fmi3Instance instance);
FUNCTION(fmi3Terminate)(fmi3Instance instance)
{
    return instance ? status_of(terminate(instance)) : fmi3Error;
}

FUNCTION(fmi3Reset)(fmi3Instance instance);
FUNCTION(fmi3Reset)(fmi3Instance instance)
{
    if (!instance) return fmi3Error;
    reset(instance);
    return fmi3OK;
}

FUNCTION(fmi3GetFloat64)(
    fmi3Instance instance, const fmi3ValueReference variables[], size_t count, double values[], size_t numbers);
FUNCTION(fmi3GetFloat64)(
    fmi3Instance instance, const fmi3ValueReference variables[], size_t count, double values[], size_t numbers)
{
    if (!instance || count != numbers) return refused(instance, "there must be one value for each value reference");
    return status_of(get_values(instance, variables, count, values));
}

FUNCTION(fmi3SetFloat64)(
    fmi3Instance instance, const fmi3ValueReference variables[], size_t count, const double values[], size_t numbers);
FUNCTION(fmi3SetFloat64)(
    fmi3Instance instance, const fmi3ValueReference variables[], size_t count, const double values[], size_t numbers)
{
    if (!instance || count != numbers) return refused(instance, "there must be one value for each value reference");
    return status_of(set_values(instance, variables, count, values));
}

FUNCTION(fmi3DoStep)(
    fmi3Instance instance, double time, double size, bool never_before, bool *event, bool *end, bool *early,
    double *reached);
FUNCTION(fmi3DoStep)(
    fmi3Instance instance, double time, double size, bool never_before, bool *event, bool *end, bool *early,
    double *reached)
{
    Answer answer;
    (void)never_before;
    if (!instance || !event || !end || !early || !reached) return refused(instance, "fmi3DoStep has no room to answer");
    answer = advance(instance, time, size);
    *event = *end = *early = false;
    *reached = ((Instance *)instance)->data.time;
    return status_of(answer);
}

/* States */

FUNCTION(fmi3GetFMUState)(fmi3Instance instance, fmi3FMUState *state);
FUNCTION(fmi3GetFMUState)(fmi3Instance instance, fmi3FMUState *state)
{
    return status_of(get_state(instance, state));
}

FUNCTION(fmi3SetFMUState)(fmi3Instance instance, fmi3FMUState state);
FUNCTION(fmi3SetFMUState)(fmi3Instance instance, fmi3FMUState state)
{
    return status_of(set_state(instance, state));
}

FUNCTION(fmi3FreeFMUState)(fmi3Instance instance, fmi3FMUState *state);
FUNCTION(fmi3FreeFMUState)(fmi3Instance instance, fmi3FMUState *state)
{
    (void)instance;
    return status_of(free_state(state));
}

FUNCTION(fmi3SerializedFMUStateSize)(fmi3Instance instance, fmi3FMUState state, size_t *size);
FUNCTION(fmi3SerializedFMUStateSize)(fmi3Instance instance, fmi3FMUState state, size_t *size)
{
    return status_of(measure_state(instance, state, size));
}

FUNCTION(fmi3SerializeFMUState)(fmi3Instance instance, fmi3FMUState state, uint8_t bytes[], size_t size);
FUNCTION(fmi3SerializeFMUState)(fmi3Instance instance, fmi3FMUState state, uint8_t bytes[], size_t size)
{
    return status_of(write_state(instance, state, bytes, size));
}

FUNCTION(fmi3DeserializeFMUState)(fmi3Instance instance, const uint8_t bytes[], size_t size, fmi3FMUState *state);
FUNCTION(fmi3DeserializeFMUState)(fmi3Instance instance, const uint8_t bytes[], size_t size, fmi3FMUState *state)
{
    return status_of(read_state(instance, bytes, size, state));
}

/* What an FMU for co-simulation without event mode, clocks, derivatives and other types answers */

#define NONE(name, parameters)                                                  \
    FUNCTION(name) parameters;                                                  \
    FUNCTION(name) parameters                                                   \
    {                                                                           \
        return refused(instance, #name " is not for this FMU");                 \
    }

/* Variables of no other type: only none of them can be asked for. The compilers see no use of the arguments. */
#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#define OTHER_TYPE(type, name)                                                                                         \
    FUNCTION(fmi3Get##name)(fmi3Instance instance, const fmi3ValueReference v[], size_t n, type values[], size_t m);   \
    FUNCTION(fmi3Get##name)(fmi3Instance instance, const fmi3ValueReference v[], size_t n, type values[], size_t m)    \
    {                                                                                                                  \
        return instance && !n ? fmi3OK : refused(instance, "all variables are of the type Float64");                   \
    }                                                                                                                  \
    FUNCTION(fmi3Set##name)(                                                                                           \
        fmi3Instance instance, const fmi3ValueReference v[], size_t n, const type values[], size_t m);                 \
    FUNCTION(fmi3Set##name)(                                                                                           \
        fmi3Instance instance, const fmi3ValueReference v[], size_t n, const type values[], size_t m)                  \
    {                                                                                                                  \
        return instance && !n ? fmi3OK : refused(instance, "all variables are of the type Float64");                   \
    }

OTHER_TYPE(float, Float32)
OTHER_TYPE(int8_t, Int8)
OTHER_TYPE(uint8_t, UInt8)
OTHER_TYPE(int16_t, Int16)
OTHER_TYPE(uint16_t, UInt16)
OTHER_TYPE(int32_t, Int32)
OTHER_TYPE(uint32_t, UInt32)
OTHER_TYPE(int64_t, Int64)
OTHER_TYPE(uint64_t, UInt64)
OTHER_TYPE(bool, Boolean)
OTHER_TYPE(fmi3String, String)

#define VARIABLE_LIST fmi3Instance instance, const fmi3ValueReference v[], size_t n

NONE(fmi3GetBinary, (VARIABLE_LIST, size_t sizes[], fmi3Binary values[], size_t m))
NONE(fmi3SetBinary, (VARIABLE_LIST, const size_t sizes[], const fmi3Binary values[], size_t m))
NONE(fmi3GetClock, (VARIABLE_LIST, bool values[]))
NONE(fmi3SetClock, (VARIABLE_LIST, const bool values[]))
NONE(fmi3GetIntervalDecimal, (VARIABLE_LIST, double intervals[], int qualifiers[]))
NONE(fmi3GetIntervalFraction, (VARIABLE_LIST, uint64_t counters[], uint64_t resolutions[], int qualifiers[]))
NONE(fmi3GetShiftDecimal, (VARIABLE_LIST, double shifts[]))
NONE(fmi3GetShiftFraction, (VARIABLE_LIST, uint64_t counters[], uint64_t resolutions[]))
NONE(fmi3SetIntervalDecimal, (VARIABLE_LIST, const double intervals[]))
NONE(fmi3SetIntervalFraction, (VARIABLE_LIST, const uint64_t counters[], const uint64_t resolutions[]))
NONE(fmi3SetShiftDecimal, (VARIABLE_LIST, const double shifts[]))
NONE(fmi3SetShiftFraction, (VARIABLE_LIST, const uint64_t counters[], const uint64_t resolutions[]))
NONE(fmi3GetOutputDerivatives, (VARIABLE_LIST, const int32_t orders[], double values[], size_t m))
NONE(fmi3GetNumberOfVariableDependencies, (fmi3Instance instance, fmi3ValueReference v, size_t *n))
NONE(fmi3GetVariableDependencies, (fmi3Instance instance, fmi3ValueReference v, size_t places[],
                                   fmi3ValueReference others[], size_t other_places[], int kinds[], size_t n))
NONE(fmi3GetDirectionalDerivative, (VARIABLE_LIST, const fmi3ValueReference knowns[], size_t m, const double seed[],
                                    size_t seeds, double values[], size_t k))
NONE(fmi3GetAdjointDerivative, (VARIABLE_LIST, const fmi3ValueReference knowns[], size_t m, const double seed[],
                                size_t seeds, double values[], size_t k))
NONE(fmi3EnterConfigurationMode, (fmi3Instance instance))
NONE(fmi3ExitConfigurationMode, (fmi3Instance instance))
NONE(fmi3EnterEventMode, (fmi3Instance instance))
NONE(fmi3EnterStepMode, (fmi3Instance instance))
NONE(fmi3EvaluateDiscreteStates, (fmi3Instance instance))
NONE(fmi3UpdateDiscreteStates,
     (fmi3Instance instance, bool *again, bool *end, bool *nominals, bool *values, bool *has_next, double *next))
NONE(fmi3EnterContinuousTimeMode, (fmi3Instance instance))
NONE(fmi3CompletedIntegratorStep, (fmi3Instance instance, bool never_before, bool *event, bool *end))
NONE(fmi3SetTime, (fmi3Instance instance, double time))
NONE(fmi3SetContinuousStates, (fmi3Instance instance, const double states[], size_t n))
NONE(fmi3GetContinuousStateDerivatives, (fmi3Instance instance, double derivatives[], size_t n))
NONE(fmi3GetEventIndicators, (fmi3Instance instance, double indicators[], size_t n))
NONE(fmi3GetContinuousStates, (fmi3Instance instance, double states[], size_t n))
NONE(fmi3GetNominalsOfContinuousStates, (fmi3Instance instance, double nominals[], size_t n))
NONE(fmi3GetNumberOfEventIndicators, (fmi3Instance instance, size_t *n))
NONE(fmi3GetNumberOfContinuousStates, (fmi3Instance instance, size_t *n))
NONE(fmi3ActivateModelPartition, (fmi3Instance instance, fmi3ValueReference clock, double time))

EXPORTED fmi3Instance FMI3(fmi3InstantiateModelExchange)(
    fmi3String name, fmi3String token, fmi3String resources, bool visible, bool log,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback message);
EXPORTED fmi3Instance FMI3(fmi3InstantiateModelExchange)(
    fmi3String name, fmi3String token, fmi3String resources, bool visible, bool log,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback message)
{
    if (message) message(environment, fmi3Error, "logStatusError", "this FMU is for co-simulation alone");
    return 0;
}

EXPORTED fmi3Instance FMI3(fmi3InstantiateScheduledExecution)(
    fmi3String name, fmi3String token, fmi3String resources, bool visible, bool log,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback message, void (*update)(void), void (*lock)(void),
    void (*unlock)(void));
EXPORTED fmi3Instance FMI3(fmi3InstantiateScheduledExecution)(
    fmi3String name, fmi3String token, fmi3String resources, bool visible, bool log,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback message, void (*update)(void), void (*lock)(void),
    void (*unlock)(void))
{
    if (message) message(environment, fmi3Error, "logStatusError", "this FMU is for co-simulation alone");
    return 0;
}
