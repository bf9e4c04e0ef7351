
/* The states of effects as they are before anything has moved; positions and velocities stay. */
static inline void model_rest(const model_parameters *parameters, model_real state[MODEL_STATES])
{
    (void)parameters;
STARTS
}

/* The mean rates over a step of this length that begins at `begun` and is at `state`, under the torque that acts: states of
   effects may move faster than any step. */
static inline void model_mean_rates(const model_parameters *parameters,
        const model_real begun[MODEL_STATES], model_real length,
        const model_real state[MODEL_STATES],
        const model_real torque[MODEL_JOINTS], model_real time,
        model_real rates[MODEL_STATES])
{
    (void)parameters, (void)begun, (void)length, (void)state, (void)torque, (void)time;
RATES
}

/* Their derivatives by the state, by the states of effects at the beginning, and by the torque. */
static inline void model_mean_rates_jacobian(const model_parameters *parameters,
        const model_real begun[MODEL_STATES], model_real length,
        const model_real state[MODEL_STATES],
        const model_real torque[MODEL_JOINTS], model_real time,
        model_real by_state[MODEL_STATES][MODEL_STATES],
        model_real by_begun[MODEL_STATES][MODEL_INTERNAL],
        model_real by_torque[MODEL_STATES][MODEL_JOINTS])
{
    (void)parameters, (void)begun, (void)length, (void)state, (void)torque, (void)time;
JACOBIAN
}
