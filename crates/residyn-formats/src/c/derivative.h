
/* ds/dt under the torque that acts. */
static inline void model_derivative(const model_parameters *parameters,
        const model_real state[MODEL_STATES],
        const model_real torque[MODEL_JOINTS], model_real time,
        model_real rates[MODEL_STATES])
{
    (void)parameters, (void)state, (void)torque, (void)time;
RATES
}

/* Its derivatives by the state and by the torque: [rate][state], [rate][joint]. */
static inline void model_derivative_jacobian(const model_parameters *parameters,
        const model_real state[MODEL_STATES],
        const model_real torque[MODEL_JOINTS],
        model_real time,
        model_real by_state[MODEL_STATES][MODEL_STATES],
        model_real by_torque[MODEL_STATES][MODEL_JOINTS])
{
    (void)parameters, (void)state, (void)torque, (void)time;
JACOBIAN
}
