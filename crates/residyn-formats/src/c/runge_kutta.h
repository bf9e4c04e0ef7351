
/* The @TITLE@: weight of each stage's slope, and how far the next stage is. */
#define MODEL_STAGES @STAGES@
static const model_real model_weight[MODEL_STAGES] = {@WEIGHTS@};
static const model_real model_reach[MODEL_STAGES] = {@REACHES@};

static inline void model_advance(const model_parameters *parameters, model_real state[MODEL_STATES],
        const model_real torque[MODEL_JOINTS], model_real time,
        model_real h)
{
    model_real inner[MODEL_STATES], sum[MODEL_STATES], rates[MODEL_STATES], now = time;
    int stage, i;
    for (i = 0; i < MODEL_STATES; i++)
        inner[i] = sum[i] = state[i];
    for (stage = 0; stage < MODEL_STAGES; stage++) {
        const model_real weight = model_weight[stage] * h, reach = model_reach[stage] * h;
        model_@RATES@(parameters, @STATE_AND_STEP@inner, torque, now, rates);
        for (i = 0; i < MODEL_STATES; i++) {
            sum[i] += weight * rates[i];
            inner[i] = state[i] + reach * rates[i];
        }
        now = time + reach;
    }
    for (i = 0; i < MODEL_STATES; i++)
        state[i] = sum[i];
}

/* The same, and the derivatives of the state. */
static inline void model_advance_jacobian(const model_parameters *parameters,
        model_real state[MODEL_STATES],
        model_real of_state[MODEL_STATES][MODEL_COLUMNS],
        const model_real torque[MODEL_JOINTS], model_real time,
        model_real h)
{
    model_real inner[MODEL_STATES], sum[MODEL_STATES], rates[MODEL_STATES], now = time;
    model_real of_inner[MODEL_STATES][MODEL_COLUMNS], of_sum[MODEL_STATES][MODEL_COLUMNS],
        of_rates[MODEL_STATES][MODEL_COLUMNS];
    int stage, i, c;
    for (i = 0; i < MODEL_STATES; i++) {
        inner[i] = sum[i] = state[i];
        for (c = 0; c < MODEL_COLUMNS; c++)
            of_inner[i][c] = of_sum[i][c] = of_state[i][c];
    }
    for (stage = 0; stage < MODEL_STAGES; stage++) {
        const model_real weight = model_weight[stage] * h, reach = model_reach[stage] * h;
        model_flow(parameters, @STATE_OF_STATE_AND_STEP@inner, torque, now, of_inner, rates, of_rates);
        for (i = 0; i < MODEL_STATES; i++) {
            sum[i] += weight * rates[i];
            inner[i] = state[i] + reach * rates[i];
            for (c = 0; c < MODEL_COLUMNS; c++) {
                of_sum[i][c] += weight * of_rates[i][c];
                of_inner[i][c] = of_state[i][c] + reach * of_rates[i][c];
            }
        }
        now = time + reach;
    }
    for (i = 0; i < MODEL_STATES; i++) {
        state[i] = sum[i];
        for (c = 0; c < MODEL_COLUMNS; c++)
            of_state[i][c] = of_sum[i][c];
    }
}
