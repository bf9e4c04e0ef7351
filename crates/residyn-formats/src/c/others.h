
    for (j = 2 * MODEL_JOINTS; j < MODEL_STATES; j++)
        state[j] += h * rates[j];