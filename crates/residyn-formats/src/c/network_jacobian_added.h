    {
        model_real dy[OUTPUTS * MODEL_COLUMNS];
        int i, c;
        model_NETWORK_jacobian(state, torque, dy);
        for (i = 0; i < OUTPUTS; i++) {
            for (c = 0; c < MODEL_STATES; c++)
                by_state[2 * MODEL_JOINTS - OUTPUTS + i][c] += dy[i * MODEL_COLUMNS + c];
            for (c = 0; c < MODEL_JOINTS; c++)
                by_torque[2 * MODEL_JOINTS - OUTPUTS + i][c] +=
                    dy[i * MODEL_COLUMNS + MODEL_STATES + c];
        }
    }
