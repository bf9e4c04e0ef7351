
/* The scaled features that the network takes. */
static inline void model_NETWORK_features(const model_real state[MODEL_STATES],
        const model_real torque[MODEL_JOINTS], model_real *x)
{
    int i;
    for (i = 0; i < MODEL_JOINTS; i++) {
        ANGLES
        x[VELOCITIES + i] = state[MODEL_JOINTS + i];
        x[VELOCITIES + MODEL_JOINTS + i] = torque[i];
    }
    for (i = 0; i < FEATURES; i++)
        x[i] = (x[i] - model_NETWORK_mean[i]) * model_NETWORK_factor[i];
}

/* Their derivatives by state and torque. */
static inline void model_NETWORK_features_linear(const model_real state[MODEL_STATES],
        model_real *dx)
{
    int i, c;
    (void)state;
    for (i = 0; i < FEATURES * MODEL_COLUMNS; i++)
        dx[i] = 0;
    for (i = 0; i < MODEL_JOINTS; i++) {
        ANGLES_LINEAR
        dx[(VELOCITIES + i) * MODEL_COLUMNS + MODEL_JOINTS + i] = 1;
        dx[(VELOCITIES + MODEL_JOINTS + i) * MODEL_COLUMNS + MODEL_STATES + i] = 1;
    }
    for (i = 0; i < FEATURES; i++)
        for (c = 0; c < MODEL_COLUMNS; c++)
            dx[i * MODEL_COLUMNS + c] *= model_NETWORK_factor[i];
}

static inline void model_NETWORK(const model_real state[MODEL_STATES],
        const model_real torque[MODEL_JOINTS], model_real y[OUTPUTS])
{
    model_real x[2][WIDTH];
    model_NETWORK_features(state, torque, x[0]);
LAYERS
}

/* Derivatives of the outputs by state and torque. */
static inline void model_NETWORK_jacobian(const model_real state[MODEL_STATES],
        const model_real torque[MODEL_JOINTS],
        model_real dy[OUTPUTS * MODEL_COLUMNS])
{
    model_real x[2][WIDTH], dx[2][WIDTH * MODEL_COLUMNS];
    model_NETWORK_features(state, torque, x[0]);
    model_NETWORK_features_linear(state, dx[0]);
LINEAR
}
