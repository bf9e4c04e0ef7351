/* The model in model.h as a unit, independent of the version of FMI. Functions that can fail return a message, or NULL. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Steps of a co-simulation may be far shorter than those of the model. */
#define MODEL_PAST 4096
#include "model.h"

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

/* Torques that follow their command with a lag. */
#define LAGS @LAGS@

/* Identifies the model description of this unit. */
#define TOKEN "@TOKEN@"

enum {
    JOINTS = MODEL_JOINTS,
    STATES = MODEL_STATES + LAGS, /* positions, velocities, states of effects, lagged torques */
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
    model_reset(&data->memory);@REST@
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

/* Store an accepted point; while the torque is held, two are enough. */
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

/* The torque commanded `delay` s ago, interpolated linearly between accepted points; zero before the first. */
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

/* Derivative of the delayed torque by the present one: its weight in the interpolation. */
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

/* ---- variables ---- */

static const char *get_values(Data *data, const uint32_t references[], size_t count, double values[])
{
    double rate[STATES];
    size_t k;
    rates(data, rate);
    for (k = 0; k < count; k++) {
        const uint32_t r = references[k];
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
            return "there is no variable of this value reference";
    }
    return NULL;
}

static const char *set_values(Data *data, const uint32_t references[], size_t count, const double values[])
{
    size_t k;
    for (k = 0; k < count; k++) {
        const uint32_t r = references[k];
        if (r >= TORQUE && r < STATE)
            data->torque[r - TORQUE] = values[k];
        else if (r >= STATE && r < RATE)
            data->state[r - STATE] = values[k];
        else if (r >= PARAMETER && r < END)
            *parameter(data, (int)(r - PARAMETER)) = values[k];
        else
            return "the variable of this value reference cannot be set";
    }
    return NULL;
}

static const char *const OTHER_STATES = "another number of states";

static const char *get_states(const Data *data, double states[], size_t count)
{
    if (count != STATES)
        return OTHER_STATES;
    memcpy(states, data->state, sizeof data->state);
    return NULL;
}

static const char *set_states(Data *data, const double states[], size_t count)
{
    if (count != STATES)
        return OTHER_STATES;
    memcpy(data->state, states, sizeof data->state);
    return NULL;
}

static const char *get_rates(const Data *data, double derivatives[], size_t count)
{
    if (count != STATES)
        return OTHER_STATES;
    rates(data, derivatives);
    return NULL;
}

/* ---- derivatives ---- */

/* d unknown / d known, for the pairs that the standard allows. */
static bool partial(double of_rates[STATES][STATES + JOINTS], uint32_t unknown, uint32_t known, double *value)
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

static const char *directional(const Data *data, const uint32_t unknowns[], size_t unknownCount,
        const uint32_t knowns[], size_t knownCount, const double seed[], double sensitivity[])
{
    double of_rates[STATES][STATES + JOINTS], value;
    size_t u, k;
    jacobian(data, of_rates);
    for (u = 0; u < unknownCount; u++) {
        sensitivity[u] = 0;
        for (k = 0; k < knownCount; k++) {
            if (!partial(of_rates, unknowns[u], knowns[k], &value))
                return NO_DERIVATIVE;
            sensitivity[u] += value * seed[k];
        }
    }
    return NULL;
}

/* ---- the whole state ---- */

static const char *keep(const void *bytes, void **kept)
{
    if (!*kept)
        *kept = malloc(sizeof(Data));
    if (!*kept)
        return "no memory for a copy of the state";
    memcpy(*kept, bytes, sizeof(Data));
    return NULL;
}

static const char *serialise(const void *kept, void *bytes, size_t size)
{
    if (size < sizeof(Data))
        return "a state needs more bytes";
    memcpy(bytes, kept, sizeof(Data));
    return NULL;
}

static const char *deserialise(const void *bytes, size_t size, void **kept)
{
    return size < sizeof(Data) ? "a state needs more bytes" : keep(bytes, kept);
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
static const char *advance(Data *data, double from, double length)
{
    const double steps = fmax(1, ceil(length / @STEP@ - 1e-9)), step = length / steps;
    double k;
    int i;
    if (length > 0) {
        lags_to_memory(data);
        for (k = 0; k < steps; k++)
            model_step(&data->parameters, &data->memory, data->state, data->torque, from + k * step, step);
        lags_from_memory(data);
    }
    data->time = from + length;
    for (i = 0; i < STATES; i++)
        if (!isfinite(data->state[i]))
            return "the state is not finite: the motion diverges";
    return NULL;
}
