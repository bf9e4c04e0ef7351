
    for (j = 2 * MODEL_JOINTS; j < MODEL_STATES; j++) {
        state[j] += h * rates[j];
        for (c = 0; c < MODEL_COLUMNS; c++)
            of_state[j][c] += h * of_rates[j][c];
    }