import json
from pathlib import Path

import numpy as np
import pytest
import residyn
from conftest import command

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="rod">
    <inertial>
      <origin xyz="0 0 -0.25"/><mass value="0.6"/>
      <inertia ixx="0.0125" ixy="0" ixz="0" iyy="0.0125" iyz="0" izz="0.0001"/>
    </inertial>
  </link>
  <joint name="shoulder" type="continuous">
    <parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
  </joint>
</robot>"""


def test_a_robot_description_is_a_model(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    model = residyn.Model.from_urdf(path)
    assert (model.name, model.joints, model.joint_names) == ("arm", 1, ["shoulder"])
    # A rod on a pivot: the period of its small swings is that of the textbook, 2 pi sqrt(J / (m g a)).
    period = 2 * np.pi * np.sqrt((0.0125 + 0.6 * 0.25**2) / (0.6 * 9.81 * 0.25))
    states = model.rollout([0.01, 0.0], np.zeros(round(period / 1e-3)), 1e-3)
    assert np.allclose(states[-1], states[0], atol=1e-4)
    again = residyn.Model.from_text(model.text)
    assert [parameter.name for parameter in again.parameters] == [parameter.name for parameter in model.parameters]


def test_errors_are_those_of_the_command(tmp_path: Path, report: residyn.Report, logs: list[residyn.Log]) -> None:
    report.model.write(tmp_path / "model.toml")
    logs[3].write(tmp_path / "test.csv")
    printed = command("evaluate", "--model", tmp_path / "model.toml", "--test", tmp_path / "test.csv", "--json")
    wanted = json.loads(printed.stdout)
    found = report.model.evaluate([logs[3]])
    assert {key: wanted[key] for key in found} == found


def test_predictions_start_from_the_log(report: residyn.Report, logs: list[residyn.Log]) -> None:
    windows = report.model.predict(logs[3], 0.5)
    assert len(windows) > 30 and windows[0].q.shape == (len(windows[0].time), 1)
    for time, q in windows:
        measured = logs[3].q[np.searchsorted(logs[3].time, time)]
        assert q.shape == measured.shape and np.abs(q - measured).max() < 0.1
        assert abs(time[-1] - time[0] - 0.5) < 0.02


def test_torques_are_of_models_with_a_mass(pendulum: residyn.Model, logs: list[residyn.Log]) -> None:
    arm = residyn.Model.read("acrobot")
    log = residyn.simulate("acrobot", seed=2)
    time, logged, needed = torques = arm.torques(log)
    assert torques.needed is needed and isinstance(torques, residyn.Torques)
    assert time.shape == (len(logged),) and logged.shape == needed.shape == (len(time), 2)
    with pytest.raises(residyn.ResidynError, match="gives accelerations"):
        pendulum.torques(logs[0])


def test_an_exported_module_steps_as_the_model(tmp_path: Path, report: residyn.Report) -> None:
    assert report.model.export("python", tmp_path / "pendulum_model.py", step_s=0.02) == []
    module: dict[str, object] = {"__name__": "pendulum_model"}
    exec((tmp_path / "pendulum_model.py").read_text(), module)
    after, _ = module["step"](np.array([0.3, 1.0]), np.array([0.5]))  # type: ignore[operator]
    assert np.allclose(after, report.model.rollout([0.3, 1.0], [0.5], 0.02)[1], rtol=1e-12)


def test_a_log_of_another_rig_is_refused(pendulum: residyn.Model) -> None:
    with pytest.raises(residyn.ResidynError, match="acrobot-0 has 2 joint.s., pendulum has 1; give a log of this rig"):
        pendulum.evaluate([residyn.simulate("acrobot")])
    with pytest.raises(residyn.ResidynError, match="servo-0 has `cmd`, pendulum is driven by `tau`"):
        pendulum.evaluate([residyn.simulate("servo")])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: residyn.Model.read("pendulam"), "give a model file or one of acrobot"),
        (lambda: residyn.Model.from_text("name = 3"), "model.toml, line 1"),
        (lambda: residyn.Model.read("pendulum").export("cc", "x"), "did you mean `c`"),
        (lambda: residyn.Model.read("pendulum").export("c", "x", step_s=0), "a step of 0 s"),
        (lambda: residyn.Model.read("pendulum").rollout([0], [0], 0.1), "give a state of 2 numbers"),
        (lambda: residyn.simulate("pendulum", effects={"friction": 1.0}), "unknown effect"),
        (lambda: residyn.simulate("pendulum", effects={"coulomb_friction@2": 1.0}), "joint"),
    ],
)
def test_what_is_wrong_is_said(call: object, words: str) -> None:
    with pytest.raises(residyn.ResidynError, match=words):
        call()  # type: ignore[operator]


def test_a_library_has_effects_from_texts_and_folders(tmp_path: Path) -> None:
    text = """
[effect]
name = "weak_spring"
about = "a weak spring"
force = "-k*q"

[parameters]
k = { unit = "N m/rad", about = "stiffness", typical = 0.01 }
"""
    built_in = residyn.Library()
    library = built_in.with_effect(text)
    assert "weak_spring" in library and "weak_spring" not in built_in and len(library) == len(built_in) + 1
    (tmp_path / "spring.toml").write_text(text)
    of_folder = residyn.Model.read("pendulum", effects=[tmp_path]).library
    assert of_folder.effects == built_in.with_folder(tmp_path).effects == library.effects == sorted(library.effects)
    sprung = library.model("pendulum").text + '\n[[effect]]\nname = "weak_spring"\njoint = 1\nk = 0.02\n'
    assert residyn.Model.from_text(sprung, effects=library).effects == ["weak_spring on joint 1"]
    with pytest.raises(residyn.ResidynError, match="effect, line 2, column 2: unknown key `efect`; did you mean `effect`"):
        library.with_effect("\n[efect]\n")
