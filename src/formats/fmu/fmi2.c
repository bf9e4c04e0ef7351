/* FMI 2.0 around unit.h: model exchange and co-simulation. */

#include "unit.h"

/* What the standard calls its types. */
typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef const char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef void (*fmi2CallbackLogger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
typedef void *(*fmi2CallbackAllocateMemory)(size_t, size_t);
typedef void (*fmi2CallbackFreeMemory)(void *);
typedef void (*fmi2StepFinished)(fmi2ComponentEnvironment, fmi2Status);

typedef struct {
    fmi2CallbackLogger logger;
    fmi2CallbackAllocateMemory allocateMemory;
    fmi2CallbackFreeMemory freeMemory;
    fmi2StepFinished stepFinished;
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

typedef struct {
    fmi2Boolean newDiscreteStatesNeeded;
    fmi2Boolean terminateSimulation;
    fmi2Boolean nominalsOfContinuousStatesChanged;
    fmi2Boolean valuesOfContinuousStatesChanged;
    fmi2Boolean nextEventTimeDefined;
    fmi2Real nextEventTime;
} fmi2EventInfo;

#ifdef FMI2_FUNCTION_PREFIX
#define FMI(name) EXPORT fmi2Status JOIN(FMI2_FUNCTION_PREFIX, fmi2##name)
#define FMI_OF(type, name) EXPORT type JOIN(FMI2_FUNCTION_PREFIX, fmi2##name)
#else
#define FMI(name) EXPORT fmi2Status fmi2##name
#define FMI_OF(type, name) EXPORT type fmi2##name
#endif

typedef struct {
    Data data;
    fmi2ComponentEnvironment environment;
    fmi2CallbackLogger log;
    char name[]; /* which messages begin with */
} Instance;

static Data *data_of(fmi2Component component)
{
    return &((Instance *)component)->data;
}

/* The status for what is wrong, or for NULL. */
static fmi2Status told(fmi2Component component, const char *wrong)
{
    const Instance *const self = (const Instance *)component;
    if (wrong && self->log)
        self->log(self->environment, self->name, fmi2Error, "error", wrong);
    return wrong ? fmi2Error : fmi2OK;
}

/* ---- life ---- */

FMI_OF(const char *, GetTypesPlatform)(void)
{
    return "default";
}

FMI_OF(const char *, GetVersion)(void)
{
    return "2.0";
}

FMI(SetDebugLogging)(fmi2Component component, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    (void)component, (void)on, (void)count, (void)categories;
    return fmi2OK;
}

FMI_OF(fmi2Component, Instantiate)(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
        const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    const char *const called = name ? name : "";
    Instance *const instance = (Instance *)calloc(1, sizeof *instance + strlen(called) + 1);
    (void)type, (void)resources, (void)visible, (void)logging;
    if (!instance)
        return NULL;
    strcpy(instance->name, called);
    if (functions) {
        instance->environment = functions->componentEnvironment;
        instance->log = functions->logger;
    }
    if (!guid || strcmp(guid, TOKEN) != 0) {
        told(instance, "the GUID is that of another FMU");
        free(instance);
        return NULL;
    }
    reset(&instance->data);
    return instance;
}

FMI_OF(void, FreeInstance)(fmi2Component component)
{
    free(component);
}

FMI(SetupExperiment)(fmi2Component component, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real start,
        fmi2Boolean stopDefined, fmi2Real stop)
{
    (void)toleranceDefined, (void)tolerance, (void)stopDefined, (void)stop;
    data_of(component)->time = start;
    return fmi2OK;
}

FMI(ExitInitializationMode)(fmi2Component component)
{
    accept_point(data_of(component));
    return fmi2OK;
}

FMI(Reset)(fmi2Component component)
{
    reset(data_of(component));
    return fmi2OK;
}

#define NOTHING_TO_DO(name) \
    FMI(name)(fmi2Component component) \
    { \
        (void)component; \
        return fmi2OK; \
    }

NOTHING_TO_DO(EnterInitializationMode)
NOTHING_TO_DO(EnterEventMode)
NOTHING_TO_DO(Terminate)

/* ---- variables ---- */

FMI(GetReal)(fmi2Component component, const fmi2ValueReference references[], size_t count, fmi2Real values[])
{
    return told(component, get_values(data_of(component), references, count, values));
}

FMI(SetReal)(fmi2Component component, const fmi2ValueReference references[], size_t count, const fmi2Real values[])
{
    return told(component, set_values(data_of(component), references, count, values));
}

#define NO_VARIABLES(type) \
    FMI(Get##type)(fmi2Component component, const fmi2ValueReference references[], size_t count, fmi2##type values[]) \
    { \
        (void)component, (void)references, (void)values; \
        return count == 0 ? fmi2OK : fmi2Error; \
    } \
    FMI(Set##type)(fmi2Component component, const fmi2ValueReference references[], size_t count, \
            const fmi2##type values[]) \
    { \
        (void)component, (void)references, (void)values; \
        return count == 0 ? fmi2OK : fmi2Error; \
    }

NO_VARIABLES(Integer)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

FMI(GetDirectionalDerivative)(fmi2Component component, const fmi2ValueReference unknowns[], size_t unknownCount,
        const fmi2ValueReference knowns[], size_t knownCount, const fmi2Real seed[], fmi2Real sensitivity[])
{
    return told(component,
                directional(data_of(component), unknowns, unknownCount, knowns, knownCount, seed, sensitivity));
}

/* ---- the whole state ---- */

FMI(GetFMUstate)(fmi2Component component, fmi2FMUstate *state)
{
    return told(component, keep(data_of(component), state));
}

FMI(SetFMUstate)(fmi2Component component, fmi2FMUstate state)
{
    memcpy(data_of(component), state, sizeof(Data));
    return fmi2OK;
}

FMI(FreeFMUstate)(fmi2Component component, fmi2FMUstate *state)
{
    (void)component;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

FMI(SerializedFMUstateSize)(fmi2Component component, fmi2FMUstate state, size_t *size)
{
    (void)component, (void)state;
    *size = sizeof(Data);
    return fmi2OK;
}

FMI(SerializeFMUstate)(fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    return told(component, serialise(state, bytes, size));
}

FMI(DeSerializeFMUstate)(fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    return told(component, deserialise(bytes, size, state));
}

/* ---- model exchange ---- */

FMI(NewDiscreteStates)(fmi2Component component, fmi2EventInfo *info)
{
    (void)component;
    memset(info, 0, sizeof *info);
    return fmi2OK;
}

FMI(EnterContinuousTimeMode)(fmi2Component component)
{
    accept_point(data_of(component));
    return fmi2OK;
}

FMI(CompletedIntegratorStep)(fmi2Component component, fmi2Boolean final, fmi2Boolean *enterEventMode,
        fmi2Boolean *terminate)
{
    (void)final;
    accept_point(data_of(component));
    *enterEventMode = *terminate = 0;
    return fmi2OK;
}

FMI(SetTime)(fmi2Component component, fmi2Real time)
{
    data_of(component)->time = time;
    return fmi2OK;
}

FMI(SetContinuousStates)(fmi2Component component, const fmi2Real states[], size_t count)
{
    return told(component, set_states(data_of(component), states, count));
}

FMI(GetContinuousStates)(fmi2Component component, fmi2Real states[], size_t count)
{
    return told(component, get_states(data_of(component), states, count));
}

FMI(GetDerivatives)(fmi2Component component, fmi2Real derivatives[], size_t count)
{
    return told(component, get_rates(data_of(component), derivatives, count));
}

FMI(GetNominalsOfContinuousStates)(fmi2Component component, fmi2Real nominals[], size_t count)
{
    size_t k;
    (void)component;
    for (k = 0; k < count; k++)
        nominals[k] = 1;
    return fmi2OK;
}

FMI(GetEventIndicators)(fmi2Component component, fmi2Real indicators[], size_t count)
{
    (void)component, (void)indicators;
    return count == 0 ? fmi2OK : fmi2Error;
}

/* ---- co-simulation ---- */

FMI(DoStep)(fmi2Component component, fmi2Real from, fmi2Real length, fmi2Boolean final)
{
    (void)final;
    return told(component, advance(data_of(component), from, length));
}

FMI(CancelStep)(fmi2Component component)
{
    return told(component, "a step is over when it returns: there is none to cancel");
}

FMI(SetRealInputDerivatives)(fmi2Component component, const fmi2ValueReference references[], size_t count,
        const fmi2Integer orders[], const fmi2Real values[])
{
    (void)references, (void)count, (void)orders, (void)values;
    return told(component, "inputs are held over a step");
}

FMI(GetRealOutputDerivatives)(fmi2Component component, const fmi2ValueReference references[], size_t count,
        const fmi2Integer orders[], fmi2Real values[])
{
    (void)references, (void)count, (void)orders, (void)values;
    return told(component, "outputs come without derivatives");
}

/* Of steps that are pending or discarded: there are none. */
#define NO_STATUS(name, type) \
    FMI(name)(fmi2Component component, const fmi2StatusKind kind, type *value) \
    { \
        (void)component, (void)kind, (void)value; \
        return fmi2Discard; \
    }

NO_STATUS(GetStatus, fmi2Status)
NO_STATUS(GetRealStatus, fmi2Real)
NO_STATUS(GetIntegerStatus, fmi2Integer)
NO_STATUS(GetBooleanStatus, fmi2Boolean)
NO_STATUS(GetStringStatus, fmi2String)
