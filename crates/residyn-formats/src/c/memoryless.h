
/* Nothing: the torques of the past do not matter. */
typedef struct {
    char nothing;
} model_memory;

static inline void model_reset(model_memory *memory)
{
    (void)memory;
}

/* The torques that act in each part of a step: those commanded. */
static inline void model_acting(const model_parameters *parameters, model_memory *memory,
        const model_real torque[MODEL_JOINTS], model_real step,
        model_real acting[MODEL_PARTS][MODEL_JOINTS])
{
    int part, j;
    (void)parameters;
    (void)memory;
    (void)step;
    for (part = 0; part < MODEL_PARTS; part++)
        for (j = 0; j < MODEL_JOINTS; j++)
            acting[part][j] = torque[j];
}
