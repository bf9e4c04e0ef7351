
/* The derivatives of the rates by what the derivatives `of_state` are by: the rows of states, to which the torques
   belong as they are. */
static inline void model_flow(const model_parameters *parameters,@STEP_TAKEN@
        const model_real state[MODEL_STATES],
        const model_real torque[MODEL_JOINTS], model_real time,
        model_real of_state[MODEL_STATES][MODEL_COLUMNS],
        model_real rates[MODEL_STATES],
        model_real of_rates[MODEL_STATES][MODEL_COLUMNS])
{
    model_real by_state[MODEL_STATES][MODEL_STATES], by_torque[MODEL_STATES][MODEL_JOINTS];@BY_BEGUN_TAKEN@
    int i, k, c;
    model_@RATES@(parameters, @STEP@state, torque, time, rates);
    model_@RATES@_jacobian(parameters, @STEP@state, torque, time, by_state, @BY_BEGUN@by_torque);
    for (i = 0; i < MODEL_STATES; i++)
        for (c = 0; c < MODEL_COLUMNS; c++) {
            of_rates[i][c] = c < MODEL_STATES ? 0 : by_torque[i][c - MODEL_STATES];
            for (k = 0; k < MODEL_STATES; k++)
                of_rates[i][c] += by_state[i][k] * of_state[k][c];@OF_BEGUN@
        }
}
