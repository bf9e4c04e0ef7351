    model_mean_rates(parameters, state, 0, state, torque, time, rates);
