"""What a plant says of itself, checked."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy

from .limits import Interval, Limits
from .messages import PROTOCOL
from .plant import Array, Plant, PlantError


def safe_command(plant: Plant) -> Array:
    """The command that is safe to hold, shape (joints,).

    Raises:
        PlantError: no safe position is given.
    """
    if plant.safe is None and plant.command == "position":
        raise PlantError("a plant with position commands names the position that is safe to hold: safe = [...]")
    return numpy.zeros(len(plant.joints)) if plant.safe is None else numpy.array(plant.safe, float)


def description(plant: Plant) -> Mapping[str, Any]:
    """The plant's hello.

    Raises:
        PlantError: what is missing or cannot be.
    """
    for name in ("name", "joints", "step_s", "limits"):
        if not hasattr(plant, name):
            raise PlantError(f"a plant has {name} (see residyn.plants.Plant)")
    _check(plant)
    message = {
        "type": "hello",
        "protocol": PROTOCOL,
        "name": plant.name,
        "joints": list(plant.joints),
        "step_s": float(plant.step_s),
        "command": plant.command,
        "clock": plant.clock,
        "limits": _limits(plant.limits),
        "safe": safe_command(plant).tolist(),
        "measured": list(plant.measured),
    }
    # In the period after these, the watchdog acts.
    by_itself = {"patience": plant.patience, "next": plant.patience - 1}
    return {**message, **by_itself} if plant.clock == "wall" else message


def _check(plant: Plant) -> None:
    joints = len(plant.joints)
    _require(joints > 0, "a plant has joints")
    _require(len({*plant.joints, *plant.measured}) == joints + len(plant.measured), "names of joints and values differ")
    _require(_is_positive(plant.step_s), "step_s is a positive number of seconds")
    _require(plant.command in ("torque", "position"), 'command is "torque" or "position"')
    _require(plant.clock in ("simulated", "wall"), 'clock is "simulated" or "wall"')
    _require(plant.patience >= 1, "patience is at least one period")
    has_stop = type(plant).stop is not Plant.stop
    _require(plant.clock == "simulated" or has_stop, "a plant on the wall clock has stop(): how its motors are switched off")
    _check_limits(plant.limits, joints)
    _check_safe(safe_command(plant), plant)


def _check_limits(limits: Limits, joints: int) -> None:
    for name in ("command", "rate", "speed", "angle"):
        entries: Sequence[object] | None = getattr(limits, name)
        _require(entries is None or len(entries) == joints, f"limits.{name} has an entry for each of {joints} joints")
    _require(all(map(_is_interval, limits.command)), "limits.command holds pairs (least, greatest) of finite numbers")
    angles = [angle for angle in limits.angle or () if angle is not None]
    _require(all(map(_is_interval, angles)), "limits.angle holds pairs (least, greatest) of finite numbers, or None")
    positive = [limit for limit in [*(limits.rate or ()), *(limits.speed or ()), limits.brake_s] if limit is not None]
    _require(all(map(_is_positive, positive)), "limits.rate, speed and brake_s are positive")


def _check_safe(safe: Array, plant: Plant) -> None:
    _require(safe.shape == (len(plant.joints),), f"safe has a number for each of {len(plant.joints)} joints")
    for joint, value, (low, high) in zip(plant.joints, safe.tolist(), plant.limits.command, strict=True):
        _require(low <= value <= high, f"the safe command {value} of {joint} is outside its limits {low} to {high}")


def _limits(limits: Limits) -> Mapping[str, Any]:
    optional = {"rate": limits.rate, "speed": limits.speed, "angle": limits.angle}
    given = {name: list(entries) for name, entries in optional.items() if entries is not None}
    return {"command": list(limits.command), **given, "brake_s": limits.brake_s}


def _is_interval(interval: Interval) -> bool:
    low, high = interval
    return math.isfinite(low) and math.isfinite(high) and low <= high


def _is_positive(value: float) -> bool:
    return math.isfinite(value) and value > 0


def _require(holds: bool, otherwise: str) -> None:
    if not holds:
        raise PlantError(otherwise)
