

def _advance(state, torque, time, h, parameters):
    """Semi-implicit Euler: the velocities first, then the positions with the new ones."""
    rates = derivative(state, torque, time, parameters@BEGUN@)
    gain = h * rates
    gain[..., :JOINTS] += h * gain[..., JOINTS : 2 * JOINTS]
    return state + gain
