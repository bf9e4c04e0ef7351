
/* Move `state` on from `time` by `step` s under a held `torque`. The memory moves on as well. */
static inline void model_step(const model_parameters *parameters, model_memory *memory,
        model_real state[MODEL_STATES], const model_real torque[MODEL_JOINTS],
        model_real time, model_real step)
{
    model_real acting[MODEL_PARTS][MODEL_JOINTS];
    const model_real h = step / MODEL_PARTS;
    int part;
    model_acting(parameters, memory, torque, step, acting);
    for (part = 0; part < MODEL_PARTS; part++)
        model_advance(parameters, state, acting[part], time + (model_real)part * h, h);
}

/* The same, and the derivatives of the new state by the old one, and by a torque that is added to what acts
   throughout the step. */
static inline void model_step_jacobian(const model_parameters *parameters, model_memory *memory,
        model_real state[MODEL_STATES],
        const model_real torque[MODEL_JOINTS], model_real time,
        model_real step,
        model_real by_state[MODEL_STATES][MODEL_STATES],
        model_real by_torque[MODEL_STATES][MODEL_JOINTS])
{
    model_real acting[MODEL_PARTS][MODEL_JOINTS], of_state[MODEL_STATES][MODEL_COLUMNS];
    const model_real h = step / MODEL_PARTS;
    int part, i, c;
    for (i = 0; i < MODEL_STATES; i++)
        for (c = 0; c < MODEL_COLUMNS; c++)
            of_state[i][c] = i == c ? 1 : 0;
    model_acting(parameters, memory, torque, step, acting);
    for (part = 0; part < MODEL_PARTS; part++)
        model_advance_jacobian(parameters, state, of_state, acting[part],
        time + (model_real)part * h, h);
    for (i = 0; i < MODEL_STATES; i++) {
        for (c = 0; c < MODEL_STATES; c++)
            by_state[i][c] = of_state[i][c];
        for (c = 0; c < MODEL_JOINTS; c++)
            by_torque[i][c] = of_state[i][MODEL_STATES + c];
    }
}
