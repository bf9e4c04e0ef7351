import json
import os
import signal
import threading
import time
from pathlib import Path

import pytest
import residyn
from conftest import command


def test_the_hidden_effect_is_named(report: residyn.Report) -> None:
    (effect,) = report.effects
    (friction,) = effect.parameters
    assert (report.verdict, effect.name, effect.joint) == ("explained", "coulomb_friction", 1)
    assert friction.ci95 is not None and friction.ci95[0] < 0.2 < friction.ci95[1] and friction.unit == "N m"
    assert report.errors["after"]["position_rmse"][1][0] < 0.5 * report.errors["before"]["position_rmse"][1][0]
    assert report.model.effects == ["coulomb_friction on joint 1"]
    assert "coulomb_friction on joint 1: F_c1 = 0.20" in str(report)


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
