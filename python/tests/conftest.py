"""What several tests share."""

import subprocess
import sys
from pathlib import Path

import pytest
import residyn


@pytest.fixture(scope="session")
def logs() -> list[residyn.Log]:
    """Four logs of a pendulum with dry friction that its model does not declare."""
    return [residyn.simulate("pendulum", effects={"coulomb_friction": 0.2}, seed=seed) for seed in range(4)]


@pytest.fixture(scope="session")
def pendulum() -> residyn.Model:
    return residyn.Model.read("pendulum")


@pytest.fixture(scope="session")
def report(pendulum: residyn.Model, logs: list[residyn.Log]) -> residyn.Report:
    return residyn.close_loop(pendulum, logs[:3], logs[3:])


def command(*arguments: str | Path) -> "subprocess.CompletedProcess[str]":
    """Run the command `residyn` of this environment."""
    program = Path(sys.executable).parent / "residyn"
    return subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
