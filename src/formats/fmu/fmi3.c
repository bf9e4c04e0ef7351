/* FMI 3.0 around unit.h: model exchange and co-simulation. */

#include "unit.h"

/* What the standard calls its types. */
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

#ifdef FMI3_FUNCTION_PREFIX
#define FMI(name) EXPORT fmi3Status JOIN(FMI3_FUNCTION_PREFIX, fmi3##name)
#define FMI_OF(type, name) EXPORT type JOIN(FMI3_FUNCTION_PREFIX, fmi3##name)
#else
#define FMI(name) EXPORT fmi3Status fmi3##name
#define FMI_OF(type, name) EXPORT type fmi3##name
#endif

typedef struct {
    Data data;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Instance;

static Data *data_of(fmi3Instance instance)
{
    return &((Instance *)instance)->data;
}

/* The status for what is wrong, or for NULL. */
static fmi3Status told(fmi3Instance instance, const char *wrong)
{
    const Instance *const self = (const Instance *)instance;
    if (wrong && self->log)
        self->log(self->environment, fmi3Error, "error", wrong);
    return wrong ? fmi3Error : fmi3OK;
}

/* ---- life ---- */

static const char *const OTHER_COUNT = "variables have one value each: another number of them is given";

static Instance *instantiate(fmi3String token, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    Instance *instance = (Instance *)calloc(1, sizeof *instance);
    if (!instance)
        return NULL;
    instance->environment = environment;
    instance->log = log;
    if (!token || strcmp(token, TOKEN) != 0) {
        told(instance, "the instantiation token is that of another FMU");
        free(instance);
        return NULL;
    }
    reset(&instance->data);
    return instance;
}

FMI_OF(const char *, GetVersion)(void)
{
    return "3.0";
}

FMI(SetDebugLogging)(fmi3Instance instance, fmi3Boolean on, size_t count, const fmi3String categories[])
{
    (void)instance, (void)on, (void)count, (void)categories;
    return fmi3OK;
}

FMI_OF(fmi3Instance, InstantiateModelExchange)(fmi3String name, fmi3String token, fmi3String resources,
        fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    (void)name, (void)resources, (void)visible, (void)logging;
    return instantiate(token, environment, log);
}

FMI_OF(fmi3Instance, InstantiateCoSimulation)(fmi3String name, fmi3String token, fmi3String resources,
        fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
        const fmi3ValueReference required[], size_t count, fmi3InstanceEnvironment environment,
        fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)events, (void)early;
    (void)required, (void)count, (void)update;
    return instantiate(token, environment, log);
}

FMI_OF(fmi3Instance, InstantiateScheduledExecution)(fmi3String name, fmi3String token, fmi3String resources,
        fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
        fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
    (void)update, (void)lock, (void)unlock;
    return NULL;
}

FMI_OF(void, FreeInstance)(fmi3Instance instance)
{
    free(instance);
}

FMI(EnterInitializationMode)(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
        fmi3Float64 start, fmi3Boolean stopDefined, fmi3Float64 stop)
{
    (void)toleranceDefined, (void)tolerance, (void)stopDefined, (void)stop;
    data_of(instance)->time = start;
    return fmi3OK;
}

FMI(ExitInitializationMode)(fmi3Instance instance)
{
    accept_point(data_of(instance));
    return fmi3OK;
}

FMI(Reset)(fmi3Instance instance)
{
    reset(data_of(instance));
    return fmi3OK;
}

#define NOTHING_TO_DO(name) \
    FMI(name)(fmi3Instance instance) \
    { \
        (void)instance; \
        return fmi3OK; \
    }

NOTHING_TO_DO(EnterEventMode)
NOTHING_TO_DO(Terminate)
NOTHING_TO_DO(EnterConfigurationMode)
NOTHING_TO_DO(ExitConfigurationMode)
NOTHING_TO_DO(EvaluateDiscreteStates)
NOTHING_TO_DO(EnterStepMode)

FMI(UpdateDiscreteStates)(fmi3Instance instance, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals,
        fmi3Boolean *values, fmi3Boolean *timeDefined, fmi3Float64 *time)
{
    (void)instance, (void)time;
    *again = *terminate = *nominals = *values = *timeDefined = false;
    return fmi3OK;
}

/* ---- variables ---- */

FMI(GetFloat64)(fmi3Instance instance, const fmi3ValueReference references[], size_t count, fmi3Float64 values[],
        size_t valueCount)
{
    if (valueCount != count)
        return told(instance, OTHER_COUNT);
    return told(instance, get_values(data_of(instance), references, count, values));
}

FMI(SetFloat64)(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
        const fmi3Float64 values[], size_t valueCount)
{
    if (valueCount != count)
        return told(instance, OTHER_COUNT);
    return told(instance, set_values(data_of(instance), references, count, values));
}

#define NO_VARIABLES(type) \
    FMI(Get##type)(fmi3Instance instance, const fmi3ValueReference references[], size_t count, fmi3##type values[], \
            size_t valueCount) \
    { \
        (void)instance, (void)references, (void)values, (void)valueCount; \
        return count == 0 ? fmi3OK : fmi3Error; \
    } \
    FMI(Set##type)(fmi3Instance instance, const fmi3ValueReference references[], size_t count, \
            const fmi3##type values[], size_t valueCount) \
    { \
        (void)instance, (void)references, (void)values, (void)valueCount; \
        return count == 0 ? fmi3OK : fmi3Error; \
    }

NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

FMI(GetBinary)(fmi3Instance instance, const fmi3ValueReference references[], size_t count, size_t sizes[],
        fmi3Binary values[], size_t valueCount)
{
    (void)instance, (void)references, (void)sizes, (void)values, (void)valueCount;
    return count == 0 ? fmi3OK : fmi3Error;
}

FMI(SetBinary)(fmi3Instance instance, const fmi3ValueReference references[], size_t count, const size_t sizes[],
        const fmi3Binary values[], size_t valueCount)
{
    (void)instance, (void)references, (void)sizes, (void)values, (void)valueCount;
    return count == 0 ? fmi3OK : fmi3Error;
}

/* ---- clocks: there are none ---- */

FMI(GetClock)(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
        fmi3Clock values[])
{
    (void)instance, (void)references, (void)values;
    return count == 0 ? fmi3OK : fmi3Error;
}

FMI(SetClock)(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
        const fmi3Clock values[])
{
    (void)instance, (void)references, (void)values;
    return count == 0 ? fmi3OK : fmi3Error;
}

FMI(GetIntervalDecimal)(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
        fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
{
    (void)instance, (void)references, (void)intervals, (void)qualifiers;
    return count == 0 ? fmi3OK : fmi3Error;
}

FMI(GetIntervalFraction)(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
        fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
{
    (void)instance, (void)references, (void)counters, (void)resolutions, (void)qualifiers;
    return count == 0 ? fmi3OK : fmi3Error;
}

FMI(GetShiftDecimal)(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
        fmi3Float64 shifts[])
{
    (void)instance, (void)references, (void)shifts;
    return count == 0 ? fmi3OK : fmi3Error;
}

FMI(GetShiftFraction)(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
        fmi3UInt64 counters[], fmi3UInt64 resolutions[])
{
    (void)instance, (void)references, (void)counters, (void)resolutions;
    return count == 0 ? fmi3OK : fmi3Error;
}

FMI(SetIntervalDecimal)(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
        const fmi3Float64 intervals[])
{
    (void)instance, (void)references, (void)intervals;
    return count == 0 ? fmi3OK : fmi3Error;
}

FMI(SetIntervalFraction)(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
        const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)instance, (void)references, (void)counters, (void)resolutions;
    return count == 0 ? fmi3OK : fmi3Error;
}

FMI(SetShiftDecimal)(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
        const fmi3Float64 shifts[])
{
    (void)instance, (void)references, (void)shifts;
    return count == 0 ? fmi3OK : fmi3Error;
}

FMI(SetShiftFraction)(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
        const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)instance, (void)references, (void)counters, (void)resolutions;
    return count == 0 ? fmi3OK : fmi3Error;
}

FMI(GetNumberOfVariableDependencies)(fmi3Instance instance, fmi3ValueReference reference, size_t *count)
{
    (void)reference, (void)count;
    return told(instance, "dependencies do not change: they are in the model description");
}

FMI(GetVariableDependencies)(fmi3Instance instance, fmi3ValueReference dependent, size_t elements[],
        fmi3ValueReference independents[], size_t of[], fmi3DependencyKind kinds[], size_t count)
{
    (void)dependent, (void)elements, (void)independents, (void)of, (void)kinds, (void)count;
    return told(instance, "dependencies do not change: they are in the model description");
}

/* ---- derivatives ---- */

FMI(GetDirectionalDerivative)(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t unknownCount,
        const fmi3ValueReference knowns[], size_t knownCount, const fmi3Float64 seed[], size_t seedCount,
        fmi3Float64 sensitivity[], size_t sensitivityCount)
{
    if (seedCount != knownCount || sensitivityCount != unknownCount)
        return told(instance, OTHER_COUNT);
    return told(instance,
                directional(data_of(instance), unknowns, unknownCount, knowns, knownCount, seed, sensitivity));
}

FMI(GetAdjointDerivative)(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t unknownCount,
        const fmi3ValueReference knowns[], size_t knownCount, const fmi3Float64 seed[], size_t seedCount,
        fmi3Float64 sensitivity[], size_t sensitivityCount)
{
    double of_rates[STATES][STATES + JOINTS], value;
    size_t u, k;
    if (seedCount != unknownCount || sensitivityCount != knownCount)
        return told(instance, OTHER_COUNT);
    jacobian(data_of(instance), of_rates);
    for (k = 0; k < knownCount; k++) {
        sensitivity[k] = 0;
        for (u = 0; u < unknownCount; u++) {
            if (!partial(of_rates, unknowns[u], knowns[k], &value))
                return told(instance, NO_DERIVATIVE);
            sensitivity[k] += value * seed[u];
        }
    }
    return fmi3OK;
}

/* ---- the whole state ---- */

FMI(GetFMUState)(fmi3Instance instance, fmi3FMUState *state)
{
    return told(instance, keep(data_of(instance), state));
}

FMI(SetFMUState)(fmi3Instance instance, fmi3FMUState state)
{
    memcpy(data_of(instance), state, sizeof(Data));
    return fmi3OK;
}

FMI(FreeFMUState)(fmi3Instance instance, fmi3FMUState *state)
{
    (void)instance;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

FMI(SerializedFMUStateSize)(fmi3Instance instance, fmi3FMUState state, size_t *size)
{
    (void)instance, (void)state;
    *size = sizeof(Data);
    return fmi3OK;
}

FMI(SerializeFMUState)(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    return told(instance, serialise(state, bytes, size));
}

FMI(DeserializeFMUState)(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    return told(instance, deserialise(bytes, size, state));
}

/* ---- model exchange ---- */

FMI(EnterContinuousTimeMode)(fmi3Instance instance)
{
    accept_point(data_of(instance));
    return fmi3OK;
}

FMI(CompletedIntegratorStep)(fmi3Instance instance, fmi3Boolean final, fmi3Boolean *enterEventMode,
        fmi3Boolean *terminate)
{
    (void)final;
    accept_point(data_of(instance));
    *enterEventMode = *terminate = false;
    return fmi3OK;
}

FMI(SetTime)(fmi3Instance instance, fmi3Float64 time)
{
    data_of(instance)->time = time;
    return fmi3OK;
}

FMI(SetContinuousStates)(fmi3Instance instance, const fmi3Float64 states[], size_t count)
{
    return told(instance, set_states(data_of(instance), states, count));
}

FMI(GetContinuousStates)(fmi3Instance instance, fmi3Float64 states[], size_t count)
{
    return told(instance, get_states(data_of(instance), states, count));
}

FMI(GetContinuousStateDerivatives)(fmi3Instance instance, fmi3Float64 derivatives[], size_t count)
{
    return told(instance, get_rates(data_of(instance), derivatives, count));
}

FMI(GetNominalsOfContinuousStates)(fmi3Instance instance, fmi3Float64 nominals[], size_t count)
{
    size_t k;
    (void)instance;
    for (k = 0; k < count; k++)
        nominals[k] = 1;
    return fmi3OK;
}

FMI(GetNumberOfContinuousStates)(fmi3Instance instance, size_t *count)
{
    (void)instance;
    *count = STATES;
    return fmi3OK;
}

FMI(GetNumberOfEventIndicators)(fmi3Instance instance, size_t *count)
{
    (void)instance;
    *count = 0;
    return fmi3OK;
}

FMI(GetEventIndicators)(fmi3Instance instance, fmi3Float64 indicators[], size_t count)
{
    (void)instance, (void)indicators;
    return count == 0 ? fmi3OK : fmi3Error;
}

/* ---- co-simulation ---- */

FMI(DoStep)(fmi3Instance instance, fmi3Float64 from, fmi3Float64 length, fmi3Boolean final,
        fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last)
{
    (void)final;
    *eventHandlingNeeded = *terminate = *early = false;
    *last = from + length;
    return told(instance, advance(data_of(instance), from, length));
}

FMI(GetOutputDerivatives)(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
        const fmi3Int32 orders[], fmi3Float64 values[], size_t valueCount)
{
    (void)references, (void)count, (void)orders, (void)values, (void)valueCount;
    return told(instance, "outputs come without derivatives");
}

FMI(ActivateModelPartition)(fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 time)
{
    (void)clock, (void)time;
    return told(instance, "there are no clocks");
}
