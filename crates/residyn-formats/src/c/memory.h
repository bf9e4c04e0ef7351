
/* How many steps of the past a delay may span; beyond them the oldest torque that was forgotten acts. */
#ifndef MODEL_PAST
#define MODEL_PAST @PAST@
#endif

/* The torques commanded until now, and what the lags have made of them. */
typedef struct {
    int steps;  /* that are remembered */
    int newest; /* where the last of them stands */
    model_real length[MODEL_PAST]; /* s */
    model_real torque[MODEL_PAST][MODEL_JOINTS];
    model_real before[MODEL_JOINTS]; /* commanded before all of them */
    model_real lagged[MODEL_JOINTS];
} model_memory;

/* Nothing was commanded yet. */
static inline void model_reset(model_memory *memory)
{
    int j;
    memory->steps = 0;
    memory->newest = 0;
    for (j = 0; j < MODEL_JOINTS; j++) {
        memory->before[j] = 0;
        memory->lagged[j] = 0;
    }
}

/* Where the step `age` steps ago stands; the last one has age 1. */
static inline int model_place(const model_memory *memory, int age)
{
    return (memory->newest + MODEL_PAST + 1 - age) % MODEL_PAST;
}

/* The torque commanded in the step `age` steps ago; age 0 is the step that begins. */
static inline model_real model_commanded(const model_memory *memory, int joint, int age,
        model_real now)
{
    if (age == 0)
        return now;
    return age > memory->steps ? memory->before[joint]
        : memory->torque[model_place(memory, age)][joint];
}

/* T dx/dt + x = command over `length`: x moves on, and its integral is returned. */
static inline model_real model_lag(model_real *x, model_real command, model_real T,
        model_real length)
{
    const model_real gap = *x - command;
    if (T <= 0) {
        *x = command;
        return command * length;
    }
    *x = command + gap * MODEL_(exp)(-length / T);
    return command * length - gap * T * MODEL_(expm1)(-length / T);
}

/* The mean torque on one joint in each part of a step under `command`, delayed by `delay` s and smoothed with the
   time constant `T` s. */
static inline void model_filter(model_memory *memory, int joint, model_real delay, model_real T,
        model_real command, model_real step,
        model_real acting[MODEL_PARTS][MODEL_JOINTS])
{
    const model_real length = step / MODEL_PARTS;
    model_real left = delay; /* until the torque changes that acts by the delay */
    int age = 0, part;
    while (left > 0 && age <= memory->steps) {
        age++;
        if (age <= memory->steps)
            left -= memory->length[model_place(memory, age)];
    }
    if (age > 0 && age <= memory->steps)
        left += memory->length[model_place(memory, age)];
    for (part = 0; part < MODEL_PARTS; part++) {
        model_real rest = length, integral = 0;
        while (age > 0 && left < rest) {
            integral += model_lag(&memory->lagged[joint],
        model_commanded(memory, joint, age, command), T, left);
            rest -= left;
            age--;
            left = age > 0 ? memory->length[model_place(memory, age)] : 0;
        }
        integral += model_lag(&memory->lagged[joint],
        model_commanded(memory, joint, age, command), T, rest);
        left -= rest;
        acting[part][joint] = integral / length;
    }
}

/* Put a step that is over among those of the past. */
static inline void model_remember(model_memory *memory, const model_real torque[MODEL_JOINTS],
        model_real step)
{
    int j;
    const int place = (memory->newest + 1) % MODEL_PAST;
    const int full = memory->steps == MODEL_PAST;
    for (j = 0; j < MODEL_JOINTS; j++) {
        if (full)
            memory->before[j] = memory->torque[place][j];
        memory->torque[place][j] = torque[j];
    }
    memory->length[place] = step;
    memory->newest = place;
    if (!full)
        memory->steps++;
}

/* The torques that act, as means over each part of a step; the memory moves on by the step. */
static inline void model_acting(const model_parameters *parameters, model_memory *memory,
        const model_real torque[MODEL_JOINTS], model_real step,
        model_real acting[MODEL_PARTS][MODEL_JOINTS])
{
    const model_real delay[MODEL_JOINTS] = {@DELAYS@};
    const model_real lag[MODEL_JOINTS] = {@LAGS@};
    int j;
    for (j = 0; j < MODEL_JOINTS; j++)
        model_filter(memory, j, delay[j], lag[j], torque[j], step, acting);
    model_remember(memory, torque, step);
}
