"""A watch on a running machine."""

from pathlib import Path

import numpy
import pytest
import residyn

LINK = """
[system]
name = "link"
about = "a hanging link with dry friction"
joints = 1

[parameters]
J = { value = 0.2, unit = "kg m^2", positive = true, about = "inertia" }
G = { value = 3.0, unit = "N m", positive = true, about = "weight times arm" }
F = { value = 0.15, unit = "N m", positive = true, about = "dry friction" }

[dynamics]
mass = [["J"]]
bias = ["G*sin(q1) + F*sign(qd1)"]
"""


def rows(tmp_path: Path, friction: float, seed: int, from_s: float) -> dict[str, numpy.ndarray]:
    """Two minutes of the link with this dry friction."""
    path = tmp_path / f"{friction}.toml"
    path.write_text(LINK.replace("0.15", str(friction)))
    log = residyn.simulate(path, seed=seed, duration_s=120.0)
    return {"time": log["time"] + from_s, "q": log["q1"].reshape(-1, 1), "tau": log["tau1"].reshape(-1, 1)}


def test_friction_that_grew_is_named(tmp_path: Path) -> None:
    monitor = residyn.Monitor(residyn.Model.from_text(LINK), healthy_s=60.0)
    assert monitor.update(rows(tmp_path, 0.15, 1, 0.0)) == []
    (alarm,) = monitor.update(rows(tmp_path, 0.225, 2, 120.01))
    assert (alarm["name"], alarm["joint"]) == ("F", 1)
    low, high = alarm["estimate"]["ci95"]
    assert low < 0.5 < high
    assert abs(alarm["since_s"] - 120.0) < 3.0
    summary = monitor.summary()
    assert summary["rows"] == 24002
    assert len(summary["alarms"]) == 1


def test_rows_that_are_wrong_are_refused(tmp_path: Path) -> None:
    monitor = residyn.Monitor(residyn.Model.from_text(LINK))
    good = rows(tmp_path, 0.15, 1, 0.0)
    with pytest.raises(residyn.ResidynError, match="tau"):
        monitor.update({"time": good["time"], "q": good["q"]})
    with pytest.raises(residyn.ResidynError):
        monitor.update({**good, "q": numpy.full_like(good["q"], numpy.nan)})
    with pytest.raises(residyn.ResidynError, match="false"):
        residyn.Monitor(residyn.Model.from_text(LINK), false_alarms_per_hour=-1.0)
