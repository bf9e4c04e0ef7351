/* FMI 2.0: what functions.h does not share with other versions. */

#define OF(name) fmi2##name
#ifdef FMI2_FUNCTION_PREFIX
#define PREFIX FMI2_FUNCTION_PREFIX
#endif
#include "unit.h"

/* The types of the standard. */
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

typedef struct {
    Data data;
    fmi2ComponentEnvironment environment;
    fmi2CallbackLogger log;
    char name[]; /* which messages begin with */
} Instance;

static void report(const Instance *instance, const char *message)
{
    if (instance->log)
        instance->log(instance->environment, instance->name, fmi2Error, "error", message);
}

#define FMU_STATE FMUstate
#define DESERIALIZE DeSerialize
#include "functions.h"

/* ---- life ---- */

FMI_OF(const char *, GetTypesPlatform)(void)
{
    return "default";
}

FMI_OF(const char *, GetVersion)(void)
{
    return "2.0";
}

FMI_OF(fmi2Component, Instantiate)(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
        const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    const char *const called = name ? name : "";
    Instance *const instance = (Instance *)calloc(1, sizeof *instance + strlen(called) + 1);
    if (!instance)
        return NULL;
    strcpy(instance->name, called);
    if (functions) {
        instance->environment = functions->componentEnvironment;
        instance->log = functions->logger;
    }
    return checked(instance, guid);
}

FMI(SetupExperiment)(fmi2Component component, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real start,
        fmi2Boolean stopDefined, fmi2Real stop)
{
    data_of(component)->time = start;
    return fmi2OK;
}

NOTHING_TO_DO(EnterInitializationMode)

/* ---- variables ---- */

FMI(GetReal)(fmi2Component component, const fmi2ValueReference references[], size_t count, fmi2Real values[])
{
    return status(component, get_values(data_of(component), references, count, values));
}

FMI(SetReal)(fmi2Component component, const fmi2ValueReference references[], size_t count, const fmi2Real values[])
{
    return status(component, set_values(data_of(component), references, count, values));
}

NO_VARIABLES(GetInteger, fmi2Integer values[])
NO_VARIABLES(SetInteger, const fmi2Integer values[])
NO_VARIABLES(GetBoolean, fmi2Boolean values[])
NO_VARIABLES(SetBoolean, const fmi2Boolean values[])
NO_VARIABLES(GetString, fmi2String values[])
NO_VARIABLES(SetString, const fmi2String values[])

FMI(GetDirectionalDerivative)(fmi2Component component, const fmi2ValueReference unknowns[], size_t unknownCount,
        const fmi2ValueReference knowns[], size_t knownCount, const fmi2Real seed[], fmi2Real sensitivity[])
{
    return status(component,
                  directional(data_of(component), unknowns, unknownCount, knowns, knownCount, seed, sensitivity));
}

/* ---- model exchange ---- */

FMI(NewDiscreteStates)(fmi2Component component, fmi2EventInfo *info)
{
    memset(info, 0, sizeof *info);
    return fmi2OK;
}

FMI(GetDerivatives)(fmi2Component component, fmi2Real derivatives[], size_t count)
{
    return status(component, get_rates(data_of(component), derivatives, count));
}

/* ---- co-simulation ---- */

FMI(DoStep)(fmi2Component component, fmi2Real from, fmi2Real length, fmi2Boolean final)
{
    return status(component, advance(data_of(component), from, length));
}

FMI(CancelStep)(fmi2Component component)
{
    return status(component, "a step is over when it returns: there is none to cancel");
}

FMI(SetRealInputDerivatives)(fmi2Component component, const fmi2ValueReference references[], size_t count,
        const fmi2Integer orders[], const fmi2Real values[])
{
    return status(component, "inputs are held over a step");
}

FMI(GetRealOutputDerivatives)(fmi2Component component, const fmi2ValueReference references[], size_t count,
        const fmi2Integer orders[], fmi2Real values[])
{
    return status(component, NO_OUTPUT_DERIVATIVES);
}

/* The status of pending or discarded steps, of which there are none. */
#define NO_STATUS(name, type) \
    FMI(name)(fmi2Component component, const fmi2StatusKind kind, type *value) \
    { \
        return fmi2Discard; \
    }

NO_STATUS(GetStatus, fmi2Status)
NO_STATUS(GetRealStatus, fmi2Real)
NO_STATUS(GetIntegerStatus, fmi2Integer)
NO_STATUS(GetBooleanStatus, fmi2Boolean)
NO_STATUS(GetStringStatus, fmi2String)
