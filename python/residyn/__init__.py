"""Residyn: from a rig's log to the physical effect that its model lacks.

    import residyn

    model = residyn.Model.read("arm.toml")                      # or .from_urdf("arm.urdf")
    logs = [model.read_log(path) for path in ["run1.csv", "run2.csv", "run3.csv"]]
    report = residyn.close_loop(model, logs)
    for effect in report.effects:
        print(effect)                                           # name, joint, parameters with 95 % intervals
    report.model.export("c", "arm.h")

Angles are in rad, velocities in rad/s, torques in N m, times in s; for sliding joints, in m, m/s and N. Arrays of a log
have the shape (rows, joints). Whatever cannot be done raises a `ResidynError` that says what is wrong, where, and what to
do about it.
"""

from ._residyn import (
    Episode,
    Library,
    Log,
    Model,
    Monitor,
    Parameter,
    ResidynError,
    Rig,
    __version__,
    control,
    names,
    read_log,
    simulate,
    train,
    tune,
)
from .loop import close_loop
from .report import Effect, EffectParameter, Errors, Report, TorqueErrors
from .results import Bounds, Prediction, Step, Torques

__all__ = [
    "Bounds",
    "Effect",
    "EffectParameter",
    "Episode",
    "Errors",
    "Library",
    "Log",
    "Model",
    "Monitor",
    "Parameter",
    "Prediction",
    "Report",
    "ResidynError",
    "Rig",
    "Step",
    "TorqueErrors",
    "Torques",
    "__version__",
    "close_loop",
    "control",
    "names",
    "read_log",
    "simulate",
    "train",
    "tune",
]
