import errno
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas
import polars
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


SWING = {
    "time": TIME,
    "q1": np.sin(TIME),
    "q2": np.cos(TIME),
    "tau1": 2 * TIME,
    "tau2": -TIME,
    "note": ["a"] * 50,
    "day": np.full(50, np.datetime64("2026-01-01", "ns")),
}


@pytest.mark.parametrize("package", [pandas, polars])
def test_a_data_frame_is_a_log_and_back(package: ModuleType) -> None:
    log = residyn.Log.from_dataframe(package.DataFrame(SWING), name="swing")
    assert (log.name, log.joints, len(log)) == ("swing", 2, 50)
    assert log.columns == ["time", "q1", "q2", "qd1", "qd2", "tau1", "tau2"]
    for name in ["time", "q1", "q2", "tau1", "tau2"]:
        assert np.array_equal(log[name], SWING[name])
    frame = log.to_pandas() if package is pandas else log.to_polars()
    assert isinstance(frame, package.DataFrame) and list(frame.columns) == log.columns
    again = residyn.Log.from_dataframe(frame)
    assert all(np.array_equal(again[name], log[name]) for name in log.columns)


def test_commands_stay_commands_in_a_data_frame() -> None:
    log = residyn.Log(time=TIME, q=np.sin(TIME), cmd=2 * TIME)
    again = residyn.Log.from_dataframe(log.to_polars())
    assert again.columns == ["time", "q1", "qd1", "cmd1"] and np.array_equal(again["cmd1"], 2 * TIME)


@pytest.mark.parametrize("package", [pandas, polars])
def test_the_columns_of_a_data_frame_are_those_of_a_model(package: ModuleType) -> None:
    text = residyn.Model.read("pendulum").text
    columns = '[columns]\ntime = { column = "ms", unit = "ms" }\nq = [{ column = "angle", unit = "deg" }]\ntau = ["torque"]\n'
    model = residyn.Model.from_text(text + columns)
    frame = package.DataFrame({"angle": np.degrees(np.sin(TIME)), "ms": 1e3 * TIME, "torque": TIME})
    log = residyn.Log.from_dataframe(frame, model=model)
    assert np.allclose(log["q1"], np.sin(TIME)) and np.allclose(log.time, TIME)


@pytest.mark.parametrize("package", [pandas, polars])
def test_what_is_wrong_with_a_data_frame_is_said(package: ModuleType) -> None:
    frame = package.DataFrame({**SWING, "time": SWING["day"]})
    with pytest.raises(residyn.ResidynError, match='no column "time".*; these columns hold no numbers: time, note, day'):
        residyn.Log.from_dataframe(frame)
    missing = package.DataFrame({"time": TIME, "q1": [None, *TIME[1:]]})
    with pytest.raises(residyn.ResidynError, match='log, row 1, column "q1": "NaN" is not a finite number'):
        residyn.Log.from_dataframe(missing)


def test_a_package_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    log = residyn.Log(time=TIME, q=TIME)
    for package in ["pandas", "polars"]:
        monkeypatch.setitem(sys.modules, package, None)
        with pytest.raises(ImportError, match=f"to_{package} needs {package}: pip install {package}"):
            getattr(log, f"to_{package}")()


def test_a_column_that_is_not_there_is_a_key_that_is_not_there() -> None:
    log = residyn.Log(time=TIME, q=TIME, cmd=2 * TIME)
    assert np.array_equal(log["cmd1"], 2 * TIME)
    with pytest.raises(KeyError, match="no column .*tau1.*; there are time, q1, qd1, cmd1"):
        log["tau1"]


@pytest.mark.parametrize(
    "read",
    [
        residyn.read_log,
        residyn.Model.read,
        residyn.Model.from_urdf,
        residyn.simulate,
        residyn.Rig,
        residyn.Library().with_folder,
        lambda path: residyn.Model.read("pendulum").read_log(path),
        lambda path: residyn.train(path, "unused"),
        lambda path: residyn.tune(path, "unused", logs=["unused.csv"]),
        lambda path: residyn.control(residyn.Model.read("pendulum"), path),
        lambda path: residyn.Rig("pendulum", path),
    ],
)
def test_a_file_that_is_missing_is_not_found(read: Callable[[Path], object], tmp_path: Path) -> None:
    path = tmp_path / "nothing.toml"
    with pytest.raises(FileNotFoundError, match="nothing.toml") as caught:
        read(path)
    assert isinstance(caught.value, residyn.ResidynError) and isinstance(caught.value, ValueError)
    assert (caught.value.filename, caught.value.errno) == (str(path), errno.ENOENT)
    assert str(caught.value) == caught.value.strerror


def test_a_file_that_is_wrong_is_found(tmp_path: Path) -> None:
    path = tmp_path / "wrong.csv"
    path.write_text("time,q1\n0,a\n")
    with pytest.raises(residyn.ResidynError) as caught:
        residyn.read_log(path)
    assert not isinstance(caught.value, OSError)


def test_what_cannot_be_written_is_pythons_own_error(tmp_path: Path) -> None:
    log = residyn.Log(time=TIME, q=TIME)
    with pytest.raises(FileNotFoundError) as caught:
        log.write(tmp_path / "nowhere" / "log.csv")
    assert isinstance(caught.value, residyn.ResidynError)


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
