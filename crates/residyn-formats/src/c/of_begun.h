
            for (k = 0; k < MODEL_INTERNAL; k++)
                of_rates[i][c] += by_begun[i][k] * of_begun[2 * MODEL_JOINTS + k][c];