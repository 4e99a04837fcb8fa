/* FMI 2.0 for co-simulation (https://fmi-standard.org), over fmu.h. Written by MET. */

#include "model.h"
#include "fmu.h"

#ifdef FMI2_FUNCTION_PREFIX
#define PASTED(a, b) a##b
#define PASTE(a, b) PASTED(a, b)
#define FMI2(name) PASTE(FMI2_FUNCTION_PREFIX, name)
#else
#define FMI2(name) name
#endif

#define FUNCTION(name) EXPORTED fmi2Status FMI2(name)

typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef void *fmi2Component, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef int fmi2Boolean;
typedef const char *fmi2String;

typedef struct {
    void (*logger)(void *environment, fmi2String name, fmi2Status, fmi2String category, fmi2String message, ...);
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *memory);
    void (*step_finished)(void *environment, fmi2Status);
    void *environment;
} fmi2CallbackFunctions;

/* `instance` comes first, so that its address is that of the whole. */
typedef struct {
    Instance instance;
    fmi2CallbackFunctions callbacks;
    char name[64];
} Whole;

static void log_message(void *instance, const char *message)
{
    Whole *const whole = instance;
    whole->callbacks.logger(whole->callbacks.environment, whole->name, fmi2Error, "logStatusError", message);
}

static fmi2Status status_of(Answer answer)
{
    return answer == OK ? fmi2OK : answer == DISCARD ? fmi2Discard : fmi2Error;
}

static fmi2Status refused(fmi2Component instance, const char *message)
{
    return status_of(refuse(instance, message));
}

EXPORTED const char *FMI2(fmi2GetTypesPlatform)(void);
EXPORTED const char *FMI2(fmi2GetTypesPlatform)(void)
{
    return "default";
}

EXPORTED const char *FMI2(fmi2GetVersion)(void);
EXPORTED const char *FMI2(fmi2GetVersion)(void)
{
    return "2.0";
}

FUNCTION(fmi2SetDebugLogging)(fmi2Component instance, fmi2Boolean on, size_t count, const fmi2String categories[]);
FUNCTION(fmi2SetDebugLogging)(fmi2Component instance, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    (void)on; /* only errors are told, and always */
    for (size_t i = 0; i < count; i++) {
        if (!categories || !categories[i] || strcmp(categories[i], "logStatusError")) {
            return refused(instance, "the only category of messages is logStatusError");
        }
    }
    return instance ? fmi2OK : fmi2Error;
}

EXPORTED fmi2Component FMI2(fmi2Instantiate)(
    fmi2String name, fmi2Type type, fmi2String token, fmi2String resources, const fmi2CallbackFunctions *callbacks,
    fmi2Boolean visible, fmi2Boolean log);
EXPORTED fmi2Component FMI2(fmi2Instantiate)(
    fmi2String name, fmi2Type type, fmi2String token, fmi2String resources, const fmi2CallbackFunctions *callbacks,
    fmi2Boolean visible, fmi2Boolean log)
{
    const char *why = 0;
    Whole *whole;
    (void)resources, (void)visible, (void)log;
    if (!token || strcmp(token, MODEL_TOKEN)) why = "the GUID is not that of this FMU";
    if (type != fmi2CoSimulation) why = "this FMU is for co-simulation alone";
    whole = why ? 0 : calloc(1, sizeof *whole);
    if (!whole) {
        if (callbacks && callbacks->logger) {
            callbacks->logger(callbacks->environment, name ? name : "", fmi2Error, "logStatusError",
                              why ? why : "there is no memory");
        }
        return 0;
    }
    if (callbacks) whole->callbacks = *callbacks;
    snprintf(whole->name, sizeof whole->name, "%s", name ? name : "");
    whole->instance.log = whole->callbacks.logger ? log_message : 0;
    reset(&whole->instance);
    return whole;
}

EXPORTED void FMI2(fmi2FreeInstance)(fmi2Component instance);
EXPORTED void FMI2(fmi2FreeInstance)(fmi2Component instance)
{
    free(instance);
}

FUNCTION(fmi2SetupExperiment)(
    fmi2Component instance, fmi2Boolean has_tolerance, double tolerance, double start, fmi2Boolean has_stop,
    double stop);
FUNCTION(fmi2SetupExperiment)(
    fmi2Component instance, fmi2Boolean has_tolerance, double tolerance, double start, fmi2Boolean has_stop,
    double stop)
{
    (void)has_tolerance, (void)tolerance; /* the steps of the run are fixed */
    return instance ? status_of(set_up(instance, start, has_stop, stop)) : fmi2Error;
}

FUNCTION(fmi2EnterInitializationMode)(fmi2Component instance);
FUNCTION(fmi2EnterInitializationMode)(fmi2Component instance)
{
    return instance ? status_of(initialize(instance)) : fmi2Error;
}

FUNCTION(fmi2ExitInitializationMode)(fmi2Component instance);
FUNCTION(fmi2ExitInitializationMode)(fmi2Component instance)
{
    return instance ? status_of(begin_stepping(instance)) : fmi2Error;
}

FUNCTION(fmi2Terminate)(fmi2Component instance);
FUNCTION(fmi2Terminate)(fmi2Component instance)
{
    return instance ? status_of(terminate(instance)) : fmi2Error;
}

FUNCTION(fmi2Reset)(fmi2Component instance);
FUNCTION(fmi2Reset)(fmi2Component instance)
{
    if (!instance) return fmi2Error;
    reset(instance);
    return fmi2OK;
}

FUNCTION(fmi2GetReal)(fmi2Component instance, const fmi2ValueReference variables[], size_t count, double values[]);
FUNCTION(fmi2GetReal)(fmi2Component instance, const fmi2ValueReference variables[], size_t count, double values[])
{
    return instance ? status_of(get_values(instance, variables, count, values)) : fmi2Error;
}

FUNCTION(fmi2SetReal)(
    fmi2Component instance, const fmi2ValueReference variables[], size_t count, const double values[]);
FUNCTION(fmi2SetReal)(
    fmi2Component instance, const fmi2ValueReference variables[], size_t count, const double values[])
{
    return instance ? status_of(set_values(instance, variables, count, values)) : fmi2Error;
}

FUNCTION(fmi2DoStep)(fmi2Component instance, double time, double size, fmi2Boolean never_before);
FUNCTION(fmi2DoStep)(fmi2Component instance, double time, double size, fmi2Boolean never_before)
{
    (void)never_before;
    return instance ? status_of(advance(instance, time, size)) : fmi2Error;
}

/* States */

FUNCTION(fmi2GetFMUstate)(fmi2Component instance, fmi2FMUstate *state);
FUNCTION(fmi2GetFMUstate)(fmi2Component instance, fmi2FMUstate *state)
{
    return status_of(get_state(instance, state));
}

FUNCTION(fmi2SetFMUstate)(fmi2Component instance, fmi2FMUstate state);
FUNCTION(fmi2SetFMUstate)(fmi2Component instance, fmi2FMUstate state)
{
    return status_of(set_state(instance, state));
}

FUNCTION(fmi2FreeFMUstate)(fmi2Component instance, fmi2FMUstate *state);
FUNCTION(fmi2FreeFMUstate)(fmi2Component instance, fmi2FMUstate *state)
{
    (void)instance;
    return status_of(free_state(state));
}

FUNCTION(fmi2SerializedFMUstateSize)(fmi2Component instance, fmi2FMUstate state, size_t *size);
FUNCTION(fmi2SerializedFMUstateSize)(fmi2Component instance, fmi2FMUstate state, size_t *size)
{
    return status_of(measure_state(instance, state, size));
}

FUNCTION(fmi2SerializeFMUstate)(fmi2Component instance, fmi2FMUstate state, char bytes[], size_t size);
FUNCTION(fmi2SerializeFMUstate)(fmi2Component instance, fmi2FMUstate state, char bytes[], size_t size)
{
    return status_of(write_state(instance, state, bytes, size));
}

FUNCTION(fmi2DeSerializeFMUstate)(fmi2Component instance, const char bytes[], size_t size, fmi2FMUstate *state);
FUNCTION(fmi2DeSerializeFMUstate)(fmi2Component instance, const char bytes[], size_t size, fmi2FMUstate *state)
{
    return status_of(read_state(instance, bytes, size, state));
}

/* What an FMU for co-simulation without derivatives, other types and steps of its own pace answers: that only none of
   them can be asked for. The compilers see no use of the arguments. */

#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#define NONE(name, parameters)                                   \
    FUNCTION(name) parameters;                                   \
    FUNCTION(name) parameters                                    \
    {                                                            \
        return refused(instance, #name " is not for this FMU");  \
    }

#define OTHER_TYPE(type, name)                                                                                         \
    FUNCTION(fmi2Get##name)(fmi2Component instance, const fmi2ValueReference v[], size_t n, type values[]);            \
    FUNCTION(fmi2Get##name)(fmi2Component instance, const fmi2ValueReference v[], size_t n, type values[])             \
    {                                                                                                                  \
        return instance && !n ? fmi2OK : refused(instance, "all variables are of the type Real");                      \
    }                                                                                                                  \
    FUNCTION(fmi2Set##name)(fmi2Component instance, const fmi2ValueReference v[], size_t n, const type values[]);      \
    FUNCTION(fmi2Set##name)(fmi2Component instance, const fmi2ValueReference v[], size_t n, const type values[])       \
    {                                                                                                                  \
        return instance && !n ? fmi2OK : refused(instance, "all variables are of the type Real");                      \
    }

OTHER_TYPE(int, Integer)
OTHER_TYPE(fmi2Boolean, Boolean)
OTHER_TYPE(fmi2String, String)

#define VARIABLE_LIST fmi2Component instance, const fmi2ValueReference v[], size_t n

NONE(fmi2GetDirectionalDerivative,
     (VARIABLE_LIST, const fmi2ValueReference knowns[], size_t m, const double seed[], double values[]))
NONE(fmi2SetRealInputDerivatives, (VARIABLE_LIST, const int orders[], const double values[]))
NONE(fmi2GetRealOutputDerivatives, (VARIABLE_LIST, const int orders[], double values[]))
NONE(fmi2CancelStep, (fmi2Component instance))
NONE(fmi2GetStatus, (fmi2Component instance, int kind, fmi2Status *value))
NONE(fmi2GetIntegerStatus, (fmi2Component instance, int kind, int *value))
NONE(fmi2GetBooleanStatus, (fmi2Component instance, int kind, fmi2Boolean *value))
NONE(fmi2GetStringStatus, (fmi2Component instance, int kind, fmi2String *value))

/* kind 2 is fmi2LastSuccessfulTime */
FUNCTION(fmi2GetRealStatus)(fmi2Component instance, int kind, double *value);
FUNCTION(fmi2GetRealStatus)(fmi2Component instance, int kind, double *value)
{
    if (!instance || kind != 2 || !value) return refused(instance, "only the last successful time is known");
    *value = ((Instance *)instance)->data.time;
    return fmi2OK;
}
