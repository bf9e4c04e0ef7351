

def _advance(state, torque, time, h, parameters):
    """The classical Runge-Kutta method of order 4."""
    k1 = derivative(state, torque, time, parameters)
    k2 = derivative(state + 0.5 * h * k1, torque, time + 0.5 * h, parameters)
    k3 = derivative(state + 0.5 * h * k2, torque, time + 0.5 * h, parameters)
    k4 = derivative(state + h * k3, torque, time + h, parameters)
    return state + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
