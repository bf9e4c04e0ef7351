

def rest(rows=()):
    """The memory of delayed and lagged torques after no torque, for a shape of rows."""
    return np.zeros((*rows, sum(f["past"] + f["lags"] for f in FILTERS)))


def _acting(torque, memory):
    """The torque that acts over each substep of a step, and the memory of the next."""
    acting, left, start = [list(torque) for _ in range(SUBSTEPS)], [], 0
    for f in FILTERS:
        past = [torque[f["joint"]], *memory[start : start + f["past"]]]
        start += f["past"] + f["lags"]
        sources = np.stack([memory[start - 1] if f["lags"] else past[0] * 0.0, *(past[k] for k in f["places"])])
        for substep, factors in zip(acting, f["mean"]):
            substep[f["joint"]] = np.tensordot(factors, sources, 1)
        left += past[: f["past"]] + [np.tensordot(f["end"], sources, 1)] * f["lags"]
    return [np.stack(substep, axis=-1) for substep in acting], left


def step(state, torque, memory=None, time=0.0, parameters=None):
    """The state after `torque` is held for STEP seconds, and the memory to hand to the next step.

    The memory is that of delayed and lagged torques; without one there was no torque before.
    """
    state, torque = np.asarray(state, float), np.asarray(torque, float)
    rows = np.broadcast_shapes(state.shape[:-1], torque.shape[:-1])
    memory = rest(rows) if memory is None else np.asarray(memory, float)
    torque = np.broadcast_to(torque, (*rows, JOINTS))
    acting, left = _acting(np.moveaxis(torque, -1, 0), np.moveaxis(memory, -1, 0))
    h = STEP / SUBSTEPS
    for k, held in enumerate(acting):
        state = _advance(state, held, time + k * h, h, parameters)
    return state, np.stack(left, axis=-1) if left else memory
