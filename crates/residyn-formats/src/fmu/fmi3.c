/* FMI 3.0: what functions.h does not share with other versions. */

#define OF(name) fmi3##name
#ifdef FMI3_FUNCTION_PREFIX
#define PREFIX FMI3_FUNCTION_PREFIX
#endif
#include "unit.h"

/* The types of the standard. */
typedef void *fmi3Instance;
typedef void *fmi3InstanceEnvironment;
typedef void *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean;
typedef const char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef bool fmi3Clock;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef int fmi3DependencyKind;
typedef int fmi3IntervalQualifier;
typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String, fmi3String);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment, fmi3Float64, fmi3Boolean, fmi3Boolean,
                                               fmi3Boolean, fmi3Boolean, fmi3Boolean *, fmi3Float64 *);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment);
typedef void (*fmi3LockPreemptionCallback)(void);
typedef void (*fmi3UnlockPreemptionCallback)(void);

typedef struct {
    Data data;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Instance;

static void report(const Instance *instance, const char *message)
{
    if (instance->log)
        instance->log(instance->environment, fmi3Error, "error", message);
}

#define FMU_STATE FMUState
#define DESERIALIZE Deserialize
#include "functions.h"

/* ---- life ---- */

static Instance *instantiate(fmi3String token, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    Instance *instance = (Instance *)calloc(1, sizeof *instance);
    if (!instance)
        return NULL;
    instance->environment = environment;
    instance->log = log;
    return checked(instance, token);
}

FMI_OF(const char *, GetVersion)(void)
{
    return "3.0";
}

FMI_OF(fmi3Instance, InstantiateModelExchange)(fmi3String name, fmi3String token, fmi3String resources,
        fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    return instantiate(token, environment, log);
}

FMI_OF(fmi3Instance, InstantiateCoSimulation)(fmi3String name, fmi3String token, fmi3String resources,
        fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
        const fmi3ValueReference required[], size_t count, fmi3InstanceEnvironment environment,
        fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    return instantiate(token, environment, log);
}

FMI_OF(fmi3Instance, InstantiateScheduledExecution)(fmi3String name, fmi3String token, fmi3String resources,
        fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
        fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    return NULL;
}

FMI(EnterInitializationMode)(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
        fmi3Float64 start, fmi3Boolean stopDefined, fmi3Float64 stop)
{
    data_of(instance)->time = start;
    return fmi3OK;
}

NOTHING_TO_DO(EnterConfigurationMode)
NOTHING_TO_DO(ExitConfigurationMode)
NOTHING_TO_DO(EvaluateDiscreteStates)
NOTHING_TO_DO(EnterStepMode)

FMI(UpdateDiscreteStates)(fmi3Instance instance, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals,
        fmi3Boolean *values, fmi3Boolean *timeDefined, fmi3Float64 *time)
{
    *again = *terminate = *nominals = *values = *timeDefined = false;
    return fmi3OK;
}

/* ---- variables ---- */

static const char *const OTHER_COUNT = "variables have one value each: another number of them is given";

FMI(GetFloat64)(fmi3Instance instance, const fmi3ValueReference references[], size_t count, fmi3Float64 values[],
        size_t valueCount)
{
    if (valueCount != count)
        return status(instance, OTHER_COUNT);
    return status(instance, get_values(data_of(instance), references, count, values));
}

FMI(SetFloat64)(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
        const fmi3Float64 values[], size_t valueCount)
{
    if (valueCount != count)
        return status(instance, OTHER_COUNT);
    return status(instance, set_values(data_of(instance), references, count, values));
}

#define NO_VARIABLES_OF(type) \
    NO_VARIABLES(Get##type, fmi3##type values[], size_t valueCount) \
    NO_VARIABLES(Set##type, const fmi3##type values[], size_t valueCount)

NO_VARIABLES_OF(Float32)
NO_VARIABLES_OF(Int8)
NO_VARIABLES_OF(UInt8)
NO_VARIABLES_OF(Int16)
NO_VARIABLES_OF(UInt16)
NO_VARIABLES_OF(Int32)
NO_VARIABLES_OF(UInt32)
NO_VARIABLES_OF(Int64)
NO_VARIABLES_OF(UInt64)
NO_VARIABLES_OF(Boolean)
NO_VARIABLES_OF(String)
NO_VARIABLES(GetBinary, size_t sizes[], fmi3Binary values[], size_t valueCount)
NO_VARIABLES(SetBinary, const size_t sizes[], const fmi3Binary values[], size_t valueCount)

/* Clocks. */
NO_VARIABLES(GetClock, fmi3Clock values[])
NO_VARIABLES(SetClock, const fmi3Clock values[])
NO_VARIABLES(GetIntervalDecimal, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
NO_VARIABLES(SetIntervalDecimal, const fmi3Float64 intervals[])
NO_VARIABLES(GetIntervalFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
NO_VARIABLES(SetIntervalFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NO_VARIABLES(GetShiftDecimal, fmi3Float64 shifts[])
NO_VARIABLES(SetShiftDecimal, const fmi3Float64 shifts[])
NO_VARIABLES(GetShiftFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
NO_VARIABLES(SetShiftFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])

static const char *const NO_DEPENDENCIES = "dependencies do not change: they are in the model description";

FMI(GetNumberOfVariableDependencies)(fmi3Instance instance, fmi3ValueReference reference, size_t *count)
{
    return status(instance, NO_DEPENDENCIES);
}

FMI(GetVariableDependencies)(fmi3Instance instance, fmi3ValueReference dependent, size_t elements[],
        fmi3ValueReference independents[], size_t of[], fmi3DependencyKind kinds[], size_t count)
{
    return status(instance, NO_DEPENDENCIES);
}

/* ---- derivatives ---- */

FMI(GetDirectionalDerivative)(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t unknownCount,
        const fmi3ValueReference knowns[], size_t knownCount, const fmi3Float64 seed[], size_t seedCount,
        fmi3Float64 sensitivity[], size_t sensitivityCount)
{
    if (seedCount != knownCount || sensitivityCount != unknownCount)
        return status(instance, OTHER_COUNT);
    return status(instance,
                  directional(data_of(instance), unknowns, unknownCount, knowns, knownCount, seed, sensitivity));
}

FMI(GetAdjointDerivative)(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t unknownCount,
        const fmi3ValueReference knowns[], size_t knownCount, const fmi3Float64 seed[], size_t seedCount,
        fmi3Float64 sensitivity[], size_t sensitivityCount)
{
    double of_rates[STATES][STATES + JOINTS], value;
    size_t u, k;
    if (seedCount != unknownCount || sensitivityCount != knownCount)
        return status(instance, OTHER_COUNT);
    jacobian(data_of(instance), of_rates);
    for (k = 0; k < knownCount; k++) {
        sensitivity[k] = 0;
        for (u = 0; u < unknownCount; u++) {
            if (!partial(of_rates, unknowns[u], knowns[k], &value))
                return status(instance, NO_DERIVATIVE);
            sensitivity[k] += value * seed[u];
        }
    }
    return fmi3OK;
}

/* ---- model exchange ---- */

FMI(GetContinuousStateDerivatives)(fmi3Instance instance, fmi3Float64 derivatives[], size_t count)
{
    return status(instance, get_rates(data_of(instance), derivatives, count));
}

FMI(GetNumberOfContinuousStates)(fmi3Instance instance, size_t *count)
{
    *count = STATES;
    return fmi3OK;
}

FMI(GetNumberOfEventIndicators)(fmi3Instance instance, size_t *count)
{
    *count = 0;
    return fmi3OK;
}

/* ---- co-simulation ---- */

FMI(DoStep)(fmi3Instance instance, fmi3Float64 from, fmi3Float64 length, fmi3Boolean final,
        fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last)
{
    *eventHandlingNeeded = *terminate = *early = false;
    *last = from + length;
    return status(instance, advance(data_of(instance), from, length));
}

FMI(GetOutputDerivatives)(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
        const fmi3Int32 orders[], fmi3Float64 values[], size_t valueCount)
{
    return status(instance, NO_OUTPUT_DERIVATIVES);
}

FMI(ActivateModelPartition)(fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 time)
{
    return status(instance, "there are no clocks");
}
