"""Closing the loop: from logs and a declared model to the effects that the model lacks."""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Literal

from ._residyn import Log, Model
from ._residyn import close_loop as _close_loop
from .report import Report

Progress = Callable[[str, str, int | None, int | None], object]


def close_loop(
    model: Model,
    train: Sequence[Log | str | os.PathLike[str]],
    test: Sequence[Log | str | os.PathLike[str]] = (),
    *,
    against: Mapping[str, Model] | None = None,
    seed: int = 0,
    budget_s: float = 600.0,
    errors: Literal["motion", "torque"] | None = None,
    network: bool = True,
    progress: Progress | None = None,
) -> Report:
    """Find what a model lacks: fit it, trace the residual to effects, add them, refit, score before and after.

    Ctrl-C stops it at once. The interpreter is free meanwhile: other threads go on.

    Args:
        model: the declared model.
        train: logs to learn from, or their files.
        test: logs to test on, never fitted; without them, the last logs or the end of each log are set apart.
        against: other models of the same rig, by name, to score as they are.
        seed: of everything random; the same seed gives the same result on the same machine.
        budget_s: time in s after which the search for effects stops where it stands.
        errors: which errors to compare: of the open-loop motion, or of the torques that the logged motion needs;
            without it, whichever say more about these logs.
        network: train a small network on what no effect explains.
        progress: called with the stage, what is being done in it and, if it is fitting a number of models, how many are
            done out of how many.

    Returns:
        What was found; a notebook displays it.

    Raises:
        ResidynError: logs without a usable segment, or of another rig; a model that diverges from its starting values.
    """
    learnt, judged = ([_log(model, log) for log in logs] for logs in (train, test))
    others = list((against or {}).items())
    return Report(_close_loop(model, learnt, judged, others, seed, budget_s, errors, network, progress))


def _log(model: Model, log: Log | str | os.PathLike[str]) -> Log:
    return log if isinstance(log, Log) else model.read_log(log)
