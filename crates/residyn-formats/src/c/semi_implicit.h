
/* v' = v + h f_v, q' = q + h (f_q + h f_v) */
static inline void model_advance(const model_parameters *parameters, model_real state[MODEL_STATES],
        const model_real torque[MODEL_JOINTS], model_real time,
        model_real h)
{
    model_real rates[MODEL_STATES];
    int j;
    model_@RATES@(parameters, @STATE_AND_STEP@state, torque, time, rates);
    for (j = 0; j < MODEL_JOINTS; j++) {
        const model_real gain = h * rates[MODEL_JOINTS + j];
        state[j] += h * (rates[j] + gain);
        state[MODEL_JOINTS + j] += gain;
    }@OTHERS@
}

/* The same, and the derivatives of the state. */
static inline void model_advance_jacobian(const model_parameters *parameters,
        model_real state[MODEL_STATES],
        model_real of_state[MODEL_STATES][MODEL_COLUMNS],
        const model_real torque[MODEL_JOINTS], model_real time,
        model_real h)
{
    model_real rates[MODEL_STATES], of_rates[MODEL_STATES][MODEL_COLUMNS];
    int j, c;
    model_flow(parameters, @STATE_OF_STATE_AND_STEP@state, torque, time, of_state, rates, of_rates);
    for (j = 0; j < MODEL_JOINTS; j++) {
        const model_real gain = h * rates[MODEL_JOINTS + j];
        state[j] += h * (rates[j] + gain);
        state[MODEL_JOINTS + j] += gain;
        for (c = 0; c < MODEL_COLUMNS; c++) {
            const model_real of_gain = h * of_rates[MODEL_JOINTS + j][c];
            of_state[j][c] += h * (of_rates[j][c] + of_gain);
            of_state[MODEL_JOINTS + j][c] += of_gain;
        }
    }@OF_OTHERS@
}
