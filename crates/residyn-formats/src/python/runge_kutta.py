

# The @TITLE@: when each stage is, how far the next lies along its slope, and its weight.
STAGES = [@STAGES@]


def _advance(state, torque, time, h, parameters):
    """An explicit Runge-Kutta method whose stages each need the one before."""
    inner = end = state
    for after, reach, weight in STAGES:
        rates = derivative(inner, torque, time + after * h, parameters@BEGUN@)
        end = end + weight * h * rates
        inner = state + reach * h * rates
    return end
