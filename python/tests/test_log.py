from pathlib import Path

import numpy as np
import pytest
import residyn

TIME = np.arange(50) * 0.01


def test_arrays_come_back_as_they_were_given() -> None:
    q = np.column_stack([np.sin(TIME), np.cos(TIME)])
    log = residyn.Log(time=TIME, q=q, qd=2 * q, tau=-q, name="swing")
    assert np.array_equal(log.time, TIME) and np.array_equal(log.q, q)
    assert np.array_equal(log.qd, 2 * q) and log.tau is not None and np.array_equal(log.tau, -q)
    assert (log.cmd, log.joints, len(log), log.name) == (None, 2, 50, "swing")


def test_one_joint_needs_no_second_axis_and_integers_are_numbers() -> None:
    log = residyn.Log(time=list(range(50)), q=np.arange(50, dtype=np.int32))
    assert log.q.shape == (50, 1) and log.q.dtype == np.float64
    assert np.allclose(log.qd, 1.0) and len(log.notes) == 2


def test_commands_are_no_torques() -> None:
    log = residyn.Log(time=TIME, q=TIME, cmd=2 * TIME)
    assert log.tau is None and log.cmd is not None and np.array_equal(log.cmd[:, 0], 2 * TIME)


def test_a_written_log_reads_back(tmp_path: Path) -> None:
    log = residyn.Log(time=TIME, q=np.sin(TIME), qd=np.cos(TIME), tau=TIME)
    log.write(tmp_path / "swing.csv")
    back = residyn.read_log(tmp_path / "swing.csv")
    assert np.array_equal(back.q, log.q) and back.name == "swing.csv"


def test_an_audit_finds_degrees() -> None:
    swing = residyn.simulate("pendulum", seed=1)
    degrees = residyn.Log(time=swing.time, q=np.degrees(swing.q), qd=swing.qd, tau=swing.tau)
    assert not [finding for finding in swing.audit()["findings"] if finding["severity"] == "serious"]
    assert degrees.audit()["findings"][0]["severity"] == "serious"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"q": np.full(50, np.nan)}, 'log, row 1, column "q1": "NaN" is not a finite number'),
        ({"time": TIME[::-1], "q": TIME}, "does not come after"),
        ({"q": TIME[:-3]}, 'row 48, column "q1": is empty'),
        ({"q": np.zeros((50, 2, 2))}, r"q has the shape \[50, 2, 2\]; give an array of the shape \(rows, joints\)"),
        ({"q": TIME, "tau": TIME, "cmd": TIME}, "give either tau or cmd"),
    ],
)
def test_what_is_wrong_is_said(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(residyn.ResidynError, match=words):
        residyn.Log(**{"time": TIME, **arguments})  # type: ignore[arg-type]
