import json
import os
import signal
import threading
import time
from pathlib import Path
from typing import get_args, get_type_hints

import numpy as np
import pytest
import residyn
from conftest import command

MAGNET = """
[effect]
name = "magnet"
about = "a magnet beside the path"
force = "-F*(q - 0.5)*exp(-((q - 0.5)/0.3)^2)"

[parameters]
F = { unit = "N m/rad", about = "its pull", typical = 1.0, positive = true }
"""


def test_the_hidden_effect_is_named(report: residyn.Report) -> None:
    (effect,) = report.effects
    (friction,) = effect.parameters
    assert (report.verdict, effect.name, effect.joint) == ("explained", "coulomb_friction", 1)
    assert friction.ci95 is not None and friction.ci95[0] < 0.2 < friction.ci95[1] and friction.unit == "N m"
    assert report.after.position_rmse[1, 0] < 0.5 * report.before.position_rmse[1, 0]
    assert report.model.effects == ["coulomb_friction on joint 1"]
    assert "coulomb_friction on joint 1: F_c1 = 0.20" in str(report)


def test_errors_are_those_of_the_file(report: residyn.Report) -> None:
    written = report.to_dict()["error"]
    assert report.horizons_s.tolist() == written["horizons_s"] and report.before.torque is None
    for name in ["declared", "before", "with_friction", "after", "hybrid"]:
        errors = getattr(report, name)
        assert (errors is None) == (written[name] is None), name
        for number in ["position_rmse", "position_median", "velocity_rmse", "windows", "diverged"] if errors else ():
            assert getattr(errors, number).tolist() == written[name][number], (name, number)
    assert report.before.position_rmse.shape == (len(report.horizons_s), 1)
    assert report.reduction_ci95 is not None and list(report.reduction_ci95) == written["reduction_ci95"]


def test_a_verdict_is_one_of_those_of_the_file() -> None:
    schema = json.loads((Path(__file__).parents[2] / "docs" / "report.schema.json").read_text())
    assert {entry["const"] for entry in schema["$defs"]["Verdict"]["oneOf"]} == set(get_args(get_type_hints(residyn.Report.verdict.fget)["return"]))


def test_torques_have_errors_as_well() -> None:
    arm = [residyn.simulate("acrobot", effects={"coulomb_friction@2": 0.3}, seed=seed, duration_s=4.0) for seed in range(2)]
    report = residyn.close_loop(residyn.Model.read("acrobot"), arm[:1], arm[1:], network=False)
    written = report.to_dict()["torque"]
    for errors, name in [(report.declared, "as_declared"), (report.before, "before"), (report.after, "after")]:
        assert errors.torque is not None and errors.torque.relative == written[name]["relative"]
        assert errors.torque.rms.tolist() == written[name]["rms"]
    assert report.hybrid is None


def test_an_effect_of_ones_own_is_found() -> None:
    library = residyn.Library().with_effect(MAGNET)
    hidden = {"magnet": 3.0}
    logs = [residyn.simulate("pendulum", effects=hidden, seed=seed, library=library) for seed in range(4)]
    report = residyn.close_loop(residyn.Model.read("pendulum", effects=library), logs, network=False)
    (effect,) = report.effects
    (pull,) = effect.parameters
    assert effect.name == "magnet" and pull.ci95 is not None and pull.ci95[0] < 3.0 < pull.ci95[1]
    assert report.model.library.effects == library.effects
    with pytest.raises(residyn.ResidynError, match="unknown effect `magnet`"):
        residyn.Model.from_text(report.model.text)


def test_a_notebook_shows_the_page_in_a_frame(report: residyn.Report) -> None:
    shown = report._repr_html_()
    assert shown.startswith("<iframe") and "coulomb_friction" in shown and "<script" not in shown


def test_the_report_is_that_of_the_command(tmp_path: Path, report: residyn.Report, logs: list[residyn.Log]) -> None:
    report.write(tmp_path / "ours")
    written = json.loads((tmp_path / "ours" / "report.json").read_text())
    assert written == report.to_dict()
    files = [tmp_path / f"pendulum-{number}" for number in range(4)]
    for log, path in zip(logs, files, strict=True):
        log.write(path)
    said = command(
        "closeloop", "--model", "pendulum", "--train", *files[:3], "--test", files[3], "--out", tmp_path / "theirs", "--json"
    )
    theirs = json.loads(said.stdout)
    for key in ["verdict", "effects", "supported", "parameters", "error", "alternatives", "unexplained"]:
        assert written[key] == theirs[key], key


def test_progress_is_told_in_order(pendulum: residyn.Model, logs: list[residyn.Log]) -> None:
    told: list[tuple[str, int | None, int | None]] = []
    residyn.close_loop(
        pendulum, logs, network=False, progress=lambda stage, text, done, of: told.append((stage, done, of))
    )
    stages = list(dict.fromkeys(stage for stage, _, _ in told))
    assert stages[0] == "auditing the logs" and stages[-1] == "scoring on the test logs" and len(stages) >= 7
    assert any(done == of for _, done, of in told if done is not None)


def test_ctrl_c_stops_within_a_second(pendulum: residyn.Model, logs: list[residyn.Log]) -> None:
    pressed: list[float] = []

    def press() -> None:
        pressed.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    # What runs in the background of a shell ignores Ctrl-C.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    threading.Timer(0.3, press).start()
    try:
        with pytest.raises(KeyboardInterrupt):
            residyn.close_loop(pendulum, logs)
    finally:
        signal.signal(signal.SIGINT, before)
    assert time.monotonic() - pressed[0] < 1.0


def test_what_progress_raises_ends_the_work(pendulum: residyn.Model, logs: list[residyn.Log]) -> None:
    def refuse(*_: object) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        residyn.close_loop(pendulum, logs, progress=refuse)


def test_other_threads_go_on(pendulum: residyn.Model, logs: list[residyn.Log]) -> None:
    ended = threading.Event()
    counted = 0

    def count() -> None:
        nonlocal counted
        while not ended.wait(0.005):
            counted += 1

    counter = threading.Thread(target=count)
    counter.start()
    residyn.close_loop(pendulum, logs, network=False)
    ended.set()
    counter.join()
    assert counted > 20


def test_files_are_logs_as_well(tmp_path: Path, pendulum: residyn.Model, logs: list[residyn.Log]) -> None:
    for number, log in enumerate(logs):
        log.write(tmp_path / f"run{number}.csv")
    files = [str(tmp_path / "run0.csv"), tmp_path / "run1.csv"]
    report = residyn.close_loop(pendulum, files, [tmp_path / "run3.csv"], network=False)
    assert [effect.name for effect in report.effects] == ["coulomb_friction"]


def test_what_is_wrong_is_said(pendulum: residyn.Model, logs: list[residyn.Log]) -> None:
    short = residyn.simulate("pendulum", duration_s=0.1)
    with pytest.raises(residyn.ResidynError, match="too short"):
        residyn.close_loop(pendulum, [short])
    with pytest.raises(residyn.ResidynError, match='give "motion", "torque"'):
        residyn.close_loop(pendulum, logs, errors="both")  # type: ignore[arg-type]
    with pytest.raises(residyn.ResidynError, match="give a log of this rig"):
        residyn.close_loop(residyn.Model.read("acrobot"), logs)
