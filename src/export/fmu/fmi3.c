/* FMI 3.0 around the model in model.h: model exchange and co-simulation. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Steps of a co-simulation may be far shorter than those of the model. */
#define MODEL_PAST 4096
#include "model.h"

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

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

/* Where the code of several FMUs is linked together, names begin with that of the model. */
#ifdef FMI3_FUNCTION_PREFIX
#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#define FMI(name) EXPORT fmi3Status JOIN(FMI3_FUNCTION_PREFIX, fmi3##name)
#define FMI_OF(type, name) EXPORT type JOIN(FMI3_FUNCTION_PREFIX, fmi3##name)
#else
#define FMI(name) EXPORT fmi3Status fmi3##name
#define FMI_OF(type, name) EXPORT type fmi3##name
#endif

/* Torques that follow their command with a lag. */
#define LAGS @LAGS@

#define TOKEN "@TOKEN@"

enum {
    JOINTS = MODEL_JOINTS,
    STATES = MODEL_STATES + LAGS, /* positions, velocities, lagged torques */
    PARAMETERS = @PARAMETERS@,
    POINTS = @POINTS@ /* of the past that a delay sees in model exchange */
};

/* Value references: time, then these. */
enum {
    TIME,
    TORQUE,
    STATE = TORQUE + JOINTS,
    RATE = STATE + STATES,
    PARAMETER = RATE + STATES,
    END = PARAMETER + PARAMETERS
};

/* For each joint its lagged torque among the states, or -1. */
static const int LAG_STATE[JOINTS] = {@LAG_STATE@};

typedef struct {
    model_parameters parameters;
    model_memory memory; /* of co-simulation */
    double time;
    double torque[JOINTS];
    double state[STATES];
    int points, newest; /* accepted points of model exchange */
    double point_time[POINTS];
    double point_torque[POINTS][JOINTS];
} Data;

typedef struct {
    Data data;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Instance;

static double *parameter(Data *data, int k)
{
    double *const all[PARAMETERS + 1] = {@ADDRESSES@};
    (void)data;
    return all[k];
}

static void parameters_of_filters(const Data *data, double delay[JOINTS], double lag[JOINTS])
{
    const model_parameters *const parameters = &data->parameters;
    const double delays[JOINTS] = {@DELAYS@}, lags[JOINTS] = {@FILTER_LAGS@};
    (void)parameters;
    memcpy(delay, delays, sizeof delays);
    memcpy(lag, lags, sizeof lags);
}

static void reset(Data *data)
{
    memset(data, 0, sizeof *data);
    data->parameters = model_defaults();
    model_reset(&data->memory);
}

static fmi3Status complain(const Instance *instance, const char *message)
{
    if (instance->log)
        instance->log(instance->environment, fmi3Error, "error", message);
    return fmi3Error;
}

/* ---- model exchange: the torque of the past ---- */

static int place(const Data *data, int age)
{
    return (data->newest + POINTS - age) % POINTS;
}

static bool same_torque(const Data *data, int age)
{
    return memcmp(data->point_torque[place(data, age)], data->torque, sizeof data->torque) == 0;
}

/* Put an accepted point among those of the past; while the torque is held, two are enough. */
static void accept_point(Data *data)
{
    const bool held = data->points > 1 && same_torque(data, 0) && same_torque(data, 1);
    if (!held) {
        data->newest = (data->newest + 1) % POINTS;
        data->points += data->points < POINTS ? 1 : 0;
    }
    data->point_time[data->newest] = data->time;
    memcpy(data->point_torque[data->newest], data->torque, sizeof data->torque);
}

/* The torque commanded `delay` s ago, on straight lines through accepted points; none before the first. */
static double delayed(const Data *data, int joint, double delay)
{
    const double when = data->time - delay;
    double later = data->time, torque = data->torque[joint];
    int age;
    if (delay <= 0)
        return torque;
    for (age = 0; age < data->points; age++) {
        const int k = place(data, age);
        const double earlier = data->point_time[k], before = data->point_torque[k][joint];
        if (earlier <= when)
            return later > earlier ? before + (torque - before) * (when - earlier) / (later - earlier) : before;
        later = earlier;
        torque = before;
    }
    return data->points < POINTS ? 0 : torque;
}

/* How much of the torque that is set now the delay lets through: what lies between the last accepted point and now. */
static double share_of_now(const Data *data, double delay)
{
    const double last = data->point_time[data->newest], when = data->time - delay;
    if (delay <= 0)
        return 1;
    return data->points > 0 && when > last ? (when - last) / (data->time - last) : 0;
}

static void rates(const Data *data, double rate[STATES])
{
    double delay[JOINTS], lag[JOINTS], acting[JOINTS];
    int j;
    parameters_of_filters(data, delay, lag);
    for (j = 0; j < JOINTS; j++) {
        const int k = LAG_STATE[j];
        const double torque = delayed(data, j, delay[j]);
        acting[j] = k >= 0 && lag[j] > 0 ? data->state[k] : torque;
        if (k >= 0)
            rate[k] = lag[j] > 0 ? (torque - data->state[k]) / lag[j] : 0;
    }
    model_derivative(&data->parameters, data->state, acting, data->time, rate);
}

/* Derivatives of the rates by the states, then by the torques. */
static void jacobian(const Data *data, double of_rates[STATES][STATES + JOINTS])
{
    double delay[JOINTS], lag[JOINTS], acting[JOINTS];
    double by_state[MODEL_STATES][MODEL_STATES], by_torque[MODEL_STATES][MODEL_JOINTS];
    int i, j;
    parameters_of_filters(data, delay, lag);
    memset(of_rates, 0, STATES * sizeof *of_rates);
    for (j = 0; j < JOINTS; j++) {
        const int k = LAG_STATE[j];
        acting[j] = k >= 0 && lag[j] > 0 ? data->state[k] : delayed(data, j, delay[j]);
    }
    model_derivative_jacobian(&data->parameters, data->state, acting, data->time, by_state, by_torque);
    for (i = 0; i < MODEL_STATES; i++)
        memcpy(of_rates[i], by_state[i], sizeof by_state[i]);
    for (j = 0; j < JOINTS; j++) {
        const int k = LAG_STATE[j];
        const bool lags = k >= 0 && lag[j] > 0;
        const double now = share_of_now(data, delay[j]);
        for (i = 0; i < MODEL_STATES; i++) {
            if (lags)
                of_rates[i][k] = by_torque[i][j];
            else
                of_rates[i][STATES + j] = now * by_torque[i][j];
        }
        if (lags) {
            of_rates[k][k] = -1 / lag[j];
            of_rates[k][STATES + j] = now / lag[j];
        }
    }
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
        complain(instance, "the instantiation token is that of another FMU");
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
    ((Instance *)instance)->data.time = start;
    return fmi3OK;
}

FMI(ExitInitializationMode)(fmi3Instance instance)
{
    accept_point(&((Instance *)instance)->data);
    return fmi3OK;
}

FMI(Reset)(fmi3Instance instance)
{
    reset(&((Instance *)instance)->data);
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
    Data *const data = &((Instance *)instance)->data;
    double rate[STATES];
    size_t k;
    if (valueCount != count)
        return complain((Instance *)instance, OTHER_COUNT);
    rates(data, rate);
    for (k = 0; k < count; k++) {
        const fmi3ValueReference r = references[k];
        if (r == TIME)
            values[k] = data->time;
        else if (r < STATE)
            values[k] = data->torque[r - TORQUE];
        else if (r < RATE)
            values[k] = data->state[r - STATE];
        else if (r < PARAMETER)
            values[k] = rate[r - RATE];
        else if (r < END)
            values[k] = *parameter(data, (int)(r - PARAMETER));
        else
            return complain((Instance *)instance, "there is no variable of this value reference");
    }
    return fmi3OK;
}

FMI(SetFloat64)(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
        const fmi3Float64 values[], size_t valueCount)
{
    Data *const data = &((Instance *)instance)->data;
    size_t k;
    if (valueCount != count)
        return complain((Instance *)instance, OTHER_COUNT);
    for (k = 0; k < count; k++) {
        const fmi3ValueReference r = references[k];
        if (r >= TORQUE && r < STATE)
            data->torque[r - TORQUE] = values[k];
        else if (r >= STATE && r < RATE)
            data->state[r - STATE] = values[k];
        else if (r >= PARAMETER && r < END)
            *parameter(data, (int)(r - PARAMETER)) = values[k];
        else
            return complain((Instance *)instance, "the variable of this value reference cannot be set");
    }
    return fmi3OK;
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
    return complain((Instance *)instance, "dependencies do not change: they are in the model description");
}

FMI(GetVariableDependencies)(fmi3Instance instance, fmi3ValueReference dependent, size_t elements[],
        fmi3ValueReference independents[], size_t of[], fmi3DependencyKind kinds[], size_t count)
{
    (void)dependent, (void)elements, (void)independents, (void)of, (void)kinds, (void)count;
    return complain((Instance *)instance, "dependencies do not change: they are in the model description");
}

/* ---- derivatives ---- */

/* d unknown / d known, where the standard lets one ask. */
static bool partial(double of_rates[STATES][STATES + JOINTS], fmi3ValueReference unknown, fmi3ValueReference known,
        double *value)
{
    const bool of_state = unknown >= STATE && unknown < RATE, of_rate = unknown >= RATE && unknown < PARAMETER;
    const bool by_state = known >= STATE && known < RATE, by_torque = known >= TORQUE && known < STATE;
    if (!(of_state || of_rate) || !(by_state || by_torque))
        return false;
    if (of_state)
        *value = unknown == known ? 1 : 0;
    else
        *value = of_rates[unknown - RATE][by_state ? known - STATE : STATES + known - TORQUE];
    return true;
}

static const char *const NO_DERIVATIVE = "derivatives are those of states and their rates by states and torques";

FMI(GetDirectionalDerivative)(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t unknownCount,
        const fmi3ValueReference knowns[], size_t knownCount, const fmi3Float64 seed[], size_t seedCount,
        fmi3Float64 sensitivity[], size_t sensitivityCount)
{
    double of_rates[STATES][STATES + JOINTS], value;
    size_t u, k;
    if (seedCount != knownCount || sensitivityCount != unknownCount)
        return complain((Instance *)instance, OTHER_COUNT);
    jacobian(&((Instance *)instance)->data, of_rates);
    for (u = 0; u < unknownCount; u++) {
        sensitivity[u] = 0;
        for (k = 0; k < knownCount; k++) {
            if (!partial(of_rates, unknowns[u], knowns[k], &value))
                return complain((Instance *)instance, NO_DERIVATIVE);
            sensitivity[u] += value * seed[k];
        }
    }
    return fmi3OK;
}

FMI(GetAdjointDerivative)(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t unknownCount,
        const fmi3ValueReference knowns[], size_t knownCount, const fmi3Float64 seed[], size_t seedCount,
        fmi3Float64 sensitivity[], size_t sensitivityCount)
{
    double of_rates[STATES][STATES + JOINTS], value;
    size_t u, k;
    if (seedCount != unknownCount || sensitivityCount != knownCount)
        return complain((Instance *)instance, OTHER_COUNT);
    jacobian(&((Instance *)instance)->data, of_rates);
    for (k = 0; k < knownCount; k++) {
        sensitivity[k] = 0;
        for (u = 0; u < unknownCount; u++) {
            if (!partial(of_rates, unknowns[u], knowns[k], &value))
                return complain((Instance *)instance, NO_DERIVATIVE);
            sensitivity[k] += value * seed[u];
        }
    }
    return fmi3OK;
}

/* ---- the whole state ---- */

FMI(GetFMUState)(fmi3Instance instance, fmi3FMUState *state)
{
    if (!*state)
        *state = malloc(sizeof(Data));
    if (!*state)
        return complain((Instance *)instance, "there is no memory for a state");
    memcpy(*state, &((Instance *)instance)->data, sizeof(Data));
    return fmi3OK;
}

FMI(SetFMUState)(fmi3Instance instance, fmi3FMUState state)
{
    memcpy(&((Instance *)instance)->data, state, sizeof(Data));
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
    if (size < sizeof(Data))
        return complain((Instance *)instance, "a state needs more bytes");
    memcpy(bytes, state, sizeof(Data));
    return fmi3OK;
}

FMI(DeserializeFMUState)(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    if (size < sizeof(Data))
        return complain((Instance *)instance, "a state needs more bytes");
    if (!*state)
        *state = malloc(sizeof(Data));
    if (!*state)
        return complain((Instance *)instance, "there is no memory for a state");
    memcpy(*state, bytes, sizeof(Data));
    return fmi3OK;
}

/* ---- model exchange ---- */

FMI(EnterContinuousTimeMode)(fmi3Instance instance)
{
    accept_point(&((Instance *)instance)->data);
    return fmi3OK;
}

FMI(CompletedIntegratorStep)(fmi3Instance instance, fmi3Boolean final, fmi3Boolean *enterEventMode,
        fmi3Boolean *terminate)
{
    (void)final;
    accept_point(&((Instance *)instance)->data);
    *enterEventMode = *terminate = false;
    return fmi3OK;
}

FMI(SetTime)(fmi3Instance instance, fmi3Float64 time)
{
    ((Instance *)instance)->data.time = time;
    return fmi3OK;
}

FMI(SetContinuousStates)(fmi3Instance instance, const fmi3Float64 states[], size_t count)
{
    if (count != STATES)
        return complain((Instance *)instance, "another number of states");
    memcpy(((Instance *)instance)->data.state, states, STATES * sizeof *states);
    return fmi3OK;
}

FMI(GetContinuousStates)(fmi3Instance instance, fmi3Float64 states[], size_t count)
{
    if (count != STATES)
        return complain((Instance *)instance, "another number of states");
    memcpy(states, ((Instance *)instance)->data.state, STATES * sizeof *states);
    return fmi3OK;
}

FMI(GetContinuousStateDerivatives)(fmi3Instance instance, fmi3Float64 derivatives[], size_t count)
{
    if (count != STATES)
        return complain((Instance *)instance, "another number of states");
    rates(&((Instance *)instance)->data, derivatives);
    return fmi3OK;
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

static void lags_to_memory(Data *data)
{
#if LAGS > 0
    int j;
    for (j = 0; j < JOINTS; j++)
        if (LAG_STATE[j] >= 0)
            data->memory.lagged[j] = data->state[LAG_STATE[j]];
#else
    (void)data;
#endif
}

static void lags_from_memory(Data *data)
{
#if LAGS > 0
    int j;
    for (j = 0; j < JOINTS; j++)
        if (LAG_STATE[j] >= 0)
            data->state[LAG_STATE[j]] = data->memory.lagged[j];
#else
    (void)data;
#endif
}

/* In as many equal steps as are not longer than the model's own. */
FMI(DoStep)(fmi3Instance instance, fmi3Float64 from, fmi3Float64 length, fmi3Boolean final,
        fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last)
{
    Data *const data = &((Instance *)instance)->data;
    const double steps = fmax(1, ceil(length / @STEP@ - 1e-9)), step = length / steps;
    double k;
    int i;
    (void)final;
    if (length > 0) {
        lags_to_memory(data);
        for (k = 0; k < steps; k++)
            model_step(&data->parameters, &data->memory, data->state, data->torque, from + k * step, step);
        lags_from_memory(data);
    }
    data->time = from + length;
    *eventHandlingNeeded = *terminate = *early = false;
    *last = data->time;
    for (i = 0; i < STATES; i++)
        if (!isfinite(data->state[i]))
            return complain((Instance *)instance, "the motion has left all bounds");
    return fmi3OK;
}

FMI(GetOutputDerivatives)(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
        const fmi3Int32 orders[], fmi3Float64 values[], size_t valueCount)
{
    (void)references, (void)count, (void)orders, (void)values, (void)valueCount;
    return complain((Instance *)instance, "outputs come without derivatives");
}

FMI(ActivateModelPartition)(fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 time)
{
    (void)clock, (void)time;
    return complain((Instance *)instance, "there are no clocks");
}
