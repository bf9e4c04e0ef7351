

def _advance(state, torque, time, h, parameters):
    """Semi-implicit Euler: the velocities first, then the positions with the new ones."""
    rates = derivative(state, torque, time, parameters)
    gain = h * rates[..., JOINTS:]
    return state + np.concatenate([h * (rates[..., :JOINTS] + gain), gain], axis=-1)
