    {
        model_real y[OUTPUTS];
        int i;
        model_NETWORK(state, torque, y);
        for (i = 0; i < OUTPUTS; i++)
            rates[2 * MODEL_JOINTS - OUTPUTS + i] += y[i];
    }
