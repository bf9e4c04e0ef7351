    model_real by_begun[MODEL_STATES][MODEL_INTERNAL];
    int i, k;
    model_mean_rates_jacobian(parameters, state, 0, state, torque, time, by_state, by_begun,
        by_torque);
    for (i = 0; i < MODEL_STATES; i++)
        for (k = 0; k < MODEL_INTERNAL; k++)
            by_state[i][2 * MODEL_JOINTS + k] += by_begun[i][k];
