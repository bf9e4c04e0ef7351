"""Plants in another process keep to docs/plants.md, and are safe whatever a host sends."""

import json
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import gymnasium
import jsonschema
import numpy as np
import pytest
import residyn
from conftest import command
from residyn.plants import Limits, Plant, PlantError, Row
from residyn.plants.description import description
from residyn.plants.episode import WallEpisode
from residyn.plants.gymnasium import READY, GymnasiumPlant, acrobot
from residyn.plants.guard import Guard
from residyn.plants.messages import Reset, Step
from residyn.plants.mujoco import MujocoPlant, Sensors

DOCS = Path(__file__).parents[2] / "docs"
SCHEMA = json.loads((DOCS / "plants.schema.json").read_text())
HELLO = {"type": "hello", "protocol": 1, "program": "test"}
RESET = {"type": "reset", "seed": 7}
STOP = {"type": "stop"}
Message = dict[str, Any]


def step(number: int, *command: float) -> Message:
    return {"type": "step", "id": number, "command": list(command)}


def check(message: object, sender: str) -> None:
    jsonschema.validate(message, {**SCHEMA, "anyOf": [{"$ref": f"#/$defs/{sender}"}]})


class Child:
    """A plant in a process of its own; what it says is checked against the schema."""

    def __init__(self, *arguments: str | Path) -> None:
        pipe = subprocess.PIPE
        self.process = subprocess.Popen([sys.executable, *arguments], stdin=pipe, stdout=pipe, stderr=pipe)
        assert self.process.stdin and self.process.stdout and self.process.stderr
        self.stdin, self.stdout, self.stderr = self.process.stdin, self.process.stdout, self.process.stderr

    def send(self, *messages: Message) -> None:
        for message in messages:
            check(message, "FromHost")
            self.send_line(json.dumps(message).encode())

    def send_line(self, line: bytes) -> None:
        self.stdin.write(line + b"\n")
        self.stdin.flush()

    def receive(self) -> Message:
        line = self.stdout.readline()
        assert line, self.stderr.read().decode()
        message: Message = json.loads(line)
        check(message, "FromPlant")
        return message

    def receive_until(self, kind: str) -> Message:
        while (message := self.receive())["type"] != kind:
            pass
        return message

    def row_of(self, command: int) -> Message:
        """The next row up to which this command acted."""
        while True:
            message = self.receive()
            assert message["type"] == "rows", message
            for row in message["rows"]:
                if row["command"] == command:
                    assert isinstance(row, dict)
                    return row

    def end(self) -> int:
        """The exit status; nothing more was said."""
        self.stdin.close()
        assert self.stdout.read() == b""
        return self.process.wait()


@contextmanager
def child(*arguments: str | Path) -> Iterator[Child]:
    made = Child(*arguments)
    try:
        yield made
    finally:
        made.process.kill()
        made.process.wait()
        for pipe in (made.stdin, made.stdout, made.stderr):
            with suppress(BrokenPipeError):
                pipe.close()


def rows(arguments: Sequence[str | Path], *messages: Message) -> list[Message]:
    """All rows of a conversation that ends well, the newest last."""
    with child(*arguments) as plant:
        plant.send(HELLO, *messages, STOP)
        assert plant.receive()["type"] == "hello"
        found = [row for _ in messages for row in plant.receive()["rows"]]
        assert plant.receive() == {"type": "stopped"} and plant.end() == 0
        return found


TRACED = """
import sys
import time
from pathlib import Path
from residyn.plants import Limits, Plant, Row, serve

TRACE = Path(sys.argv[1])
GO = TRACE.with_suffix(".go")

class Traced(Plant):
    name = "traced"
    joints = ["shaft"]
    step_s = {step_s}
    clock = "{clock}"
    patience = 3
    limits = Limits(command=[(-2.0, 2.0)], rate=[100.0])
    measured = ["voltage"]

    def reset(self, seed, start):
        print("this is not for the host")
        self.note("reset")
        return Row(q=[0.0], measured={{"voltage": 24.0}})

    def step(self, command):
        self.note(f"step {{command[0]}}")
        {body}
        return Row(q=[0.0], tau=command)

    def stop(self):
        self.note("stop")
        {stop}

    def wait(self):
        if not GO.exists():
            print("busy", file=sys.stderr)
            while not GO.exists():
                time.sleep(0.01)
            # The thread that reads is given time to.
            time.sleep(0.3)

    def note(self, text):
        with TRACE.open("a") as file:
            print(text, file=file)

sys.exit(serve(Traced(), sys.argv[2:]))
"""


class Script:
    """A plant that writes down what is done to it."""

    def __init__(
        self, folder: Path, clock: str = "simulated", body: str = "pass", stop: str = "pass", step_s: float = 0.01
    ) -> None:
        self.path, self.trace = folder / "traced.py", folder / "trace.txt"
        self.path.write_text(TRACED.format(clock=clock, body=body, stop=stop, step_s=step_s))
        self.arguments = (self.path, self.trace)

    def done(self) -> list[str]:
        return self.trace.read_text().splitlines() if self.trace.exists() else []


# An arm whose shoulder has no motor, and whose elbow's motor is geared by 2.
ARM = """
<mujoco model="arm">
  <option timestep="0.002"/>
  <worldbody>
    <body>
      <joint name="shoulder" axis="0 1 0" damping="0.1"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.03" mass="1"/>
      <body pos="0 0 -0.5">
        <joint name="elbow" axis="0 1 0" limited="true" range="-120 120"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.03" mass="1"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="elbow" gear="2" ctrllimited="true" ctrlrange="-1.5 1.5"/></actuator>
</mujoco>
"""

# A cart of 2 kg on a rail without gravity or friction.
CART = """
<mujoco>
  <option timestep="0.01" gravity="0 0 0"/>
  <worldbody><body><joint name="cart" type="slide" {joint}/><geom size="0.1" mass="2"/></body></worldbody>
  <actuator>{actuator}</actuator>
</mujoco>
"""
MOTOR = '<motor joint="cart" ctrllimited="true" ctrlrange="-4 4"/>'


def cart(actuator: str = MOTOR, joint: str = "") -> str:
    return CART.format(actuator=actuator, joint=joint)


def arm(folder: Path, *options: str) -> list[str | Path]:
    model = folder / "arm.xml"
    model.write_text(ARM)
    return ["-m", "residyn.plants.mujoco", model, "--step", "0.02", *options]


def test_a_mujoco_model_says_what_it_is_and_moves_in_steps(tmp_path: Path) -> None:
    with child(*arm(tmp_path, "--rate", "50")) as plant:
        plant.send(HELLO)
        hello = plant.receive()
        assert (hello["name"], hello["joints"]) == ("arm in MuJoCo", ["shoulder", "elbow"])
        assert (hello["command"], hello["clock"], hello["safe"]) == ("torque", "simulated", [0.0, 0.0])
        assert hello["limits"]["command"] == [[0.0, 0.0], [-3.0, 3.0]] and hello["limits"]["rate"] == [50.0, 50.0]
        assert hello["limits"]["angle"] == [None, [pytest.approx(-2 * np.pi / 3), pytest.approx(2 * np.pi / 3)]]
        plant.send({**RESET, "start": [0.1, -0.2, 0.0, 0.3]})
        (first,) = plant.receive()["rows"]
        assert (first["time"], first["command"], first["q"], first["qd"]) == (0.0, 0, [0.1, -0.2], [0.0, 0.3])
        # The rate allows 1 N m a step, and the shoulder has no motor.
        torques = []
        for number in range(1, 6):
            plant.send(step(number, 5.0, 99.0))
            (row,) = plant.receive()["rows"]
            assert row["command"] == number and row["time"] == pytest.approx(0.02 * number)
            torques.append(row["tau"])
        assert np.allclose(torques, [[0, 1], [0, 2], [0, 3], [0, 3], [0, 3]], atol=1e-12)
        plant.send(STOP)
        assert plant.receive() == {"type": "stopped"} and plant.end() == 0


def test_an_episode_is_that_of_its_seed(tmp_path: Path) -> None:
    noisy = arm(tmp_path, "--position-noise", "0.01", "--velocity-noise", "0.1")
    steps = [step(number, 0.0, 1.0) for number in range(1, 4)]
    first = rows(noisy, RESET, *steps, RESET, *steps, {**RESET, "seed": 8}, *steps)
    assert first[:4] == first[4:8] and first[:4] == rows(noisy, RESET, *steps)
    assert [row["q"] for row in first[:4]] != [row["q"] for row in first[8:]]


@pytest.mark.parametrize("name", sorted(READY))
def test_a_gymnasium_environment_is_served(name: str) -> None:
    with child("-m", "residyn.plants.gymnasium", name) as plant:
        plant.send(HELLO)
        hello = plant.receive()
        joints, ranges = len(hello["joints"]), np.array(hello["limits"]["command"])
        plant.send({**RESET, "start": [0.1] * joints + [0.0] * joints}, step(1, *[99.0] * joints))
        (first,), (second,) = plant.receive()["rows"], plant.receive()["rows"]
        assert np.allclose(first["q"], 0.1) and second["time"] == hello["step_s"]
        assert second["tau"] == ranges[:, 1].tolist()
        plant.send(RESET, STOP)
        assert plant.receive()["rows"][0]["q"] != first["q"]
        assert plant.receive() == {"type": "stopped"} and plant.end() == 0


def test_the_plant_on_the_page_is_a_plant(tmp_path: Path) -> None:
    page = (DOCS / "plants.md").read_text()
    smallest = re.findall(r"```python\n(.*?)```", page, re.DOTALL)[0]
    script = tmp_path / "pendulum.py"
    script.write_text(smallest)
    found = rows([script], RESET, step(1, 9.0), step(2, 0.0), {**RESET, "start": [0.5, 0.0]})
    assert found[0]["q"] == [np.pi] and found[1]["qd"] == [pytest.approx(0.06, rel=0.01)] and found[3]["q"] == [0.5]


def test_the_conversation_on_the_page_is_of_the_schema() -> None:
    said = re.findall(r"^([<>]) (.*)$", (DOCS / "plants.md").read_text(), re.MULTILINE)
    assert len(said) == 12
    for sender, line in said:
        check(json.loads(line), "FromHost" if sender == ">" else "FromPlant")


def test_prints_do_not_reach_the_host(tmp_path: Path) -> None:
    script = Script(tmp_path, body="os = __import__('os'); os.write(1, b'nor is this\\n')")
    found = rows(script.arguments, RESET, step(1, 1.0))
    assert found[0]["measured"] == {"voltage": 24.0} and found[1]["tau"] == [1.0]


def test_commands_are_clipped_to_range_and_rate(tmp_path: Path) -> None:
    script = Script(tmp_path)
    rows(script.arguments, RESET, step(1, 9.0), step(2, 9.0), step(3, 9.0), step(4, 0.0))
    assert script.done() == ["reset", "step 1.0", "step 2.0", "step 2.0", "step 1.0", "stop"]


MALFORMED = {
    "garbage": b"what?",
    "not an object": b"[1]",
    "not UTF-8": b'{"type":"\xff"}',
    "deeply nested": b"[" * 100_000,
    "NaN": b'{"type":"step","id":2,"command":[NaN]}',
    "infinity": b'{"type":"step","id":2,"command":[-Infinity]}',
    "too large": b'{"type":"step","id":2,"command":[1e999]}',
    "an integer too large": b'{"type":"step","id":2,"command":[1' + b"0" * 400 + b"]}",
    "no command": b'{"type":"step","id":2}',
    "null": b'{"type":"step","id":2,"command":[null]}',
    "text": b'{"type":"step","id":2,"command":["1"]}',
    "two joints": b'{"type":"step","id":2,"command":[1,1]}',
    "an id left out": b'{"type":"step","id":3,"command":[1]}',
    "an id again": b'{"type":"step","id":1,"command":[1]}',
    "next that is a command": b'{"type":"step","id":2,"command":[1],"next":[1]}',
    "next of two joints": b'{"type":"step","id":2,"command":[1],"next":[[1],[1,1]]}',
    "next that is not finite": b'{"type":"step","id":2,"command":[1],"next":[[1],[1e999]]}',
    "next that is null": b'{"type":"step","id":2,"command":[1],"next":null}',
    "unknown type": b'{"type":"jump"}',
    "a second hello": json.dumps(HELLO).encode(),
    "a seed that is a boolean": b'{"type":"reset","seed":true}',
    "too long": b" " * 1_000_000 + b'{"type":"stop"}',
}


@pytest.mark.parametrize("line", MALFORMED.values(), ids=MALFORMED)
def test_a_malformed_line_stops_the_plant_before_the_host_is_told(tmp_path: Path, line: bytes) -> None:
    script = Script(tmp_path)
    with child(*script.arguments) as plant:
        plant.send(HELLO, RESET, step(1, 1.0))
        assert [plant.receive()["type"] for _ in range(3)] == ["hello", "rows", "rows"]
        plant.send_line(line)
        assert plant.receive()["type"] == "error"
        assert script.done() == ["reset", "step 1.0", "stop"]
        assert plant.end() == 1


@pytest.mark.parametrize("first", [RESET, step(1, 0.0), {**HELLO, "protocol": 2}])
def test_a_conversation_begins_with_a_hello_of_the_protocol(tmp_path: Path, first: Message) -> None:
    script = Script(tmp_path)
    with child(*script.arguments) as plant:
        plant.send_line(json.dumps(first).encode())
        assert plant.receive()["type"] == "error" and plant.end() == 1
    assert script.done() == ["stop"]


def test_a_step_before_a_reset_is_refused(tmp_path: Path) -> None:
    script = Script(tmp_path)
    with child(*script.arguments) as plant:
        plant.send(HELLO, step(1, 1.0))
        assert plant.receive()["type"] == "hello"
        assert "after a reset" in plant.receive()["message"] and plant.end() == 1
    assert script.done() == ["stop"]


def test_unknown_fields_are_ignored(tmp_path: Path) -> None:
    found = rows(Script(tmp_path).arguments, {**RESET, "mood": "good"}, {**step(1, 1.0), "deadline": 3})
    assert found[1]["tau"] == [1.0]


@pytest.mark.parametrize("clock", ["simulated", "wall"])
def test_the_end_of_input_stops_the_plant(tmp_path: Path, clock: str) -> None:
    script = Script(tmp_path, clock)
    with child(*script.arguments) as plant:
        plant.send(HELLO, RESET, step(1, 1.0))
        plant.receive()
        plant.row_of(1)
        plant.stdin.close()
        assert plant.process.wait() == 0
    assert script.done()[-1] == "stop"


@pytest.mark.parametrize("clock", ["simulated", "wall"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_the_plant_before_the_host_is_told(tmp_path: Path, clock: str, number: signal.Signals) -> None:
    script = Script(tmp_path, clock)
    with child(*script.arguments) as plant:
        plant.send(HELLO, RESET, step(1, 1.0))
        plant.receive()
        plant.row_of(1)
        plant.process.send_signal(number)
        assert plant.receive_until("error")["message"] == f"interrupted by {number.name}"
        assert script.done()[-1] == "stop" and plant.end() == 128 + number


FAILURES = {
    "an exception": ("1 / 0", "ZeroDivisionError"),
    "an exit": ("sys.exit(0)", "SystemExit"),
    "a position that is not finite": ("return Row(q=[float('nan')])", "not finite"),
    "a joint too many": ("return Row(q=[0.0, 0.0])", "shape (2,)"),
    "no rows": ("return []", "no rows"),
    "time that stands still": ("return Row(q=[0.0], time=0.0)", "increases"),
    "an unknown value": ("return Row(q=[0.0], measured={'current': 1.0})", "current"),
}


@pytest.mark.parametrize(("body", "message"), FAILURES.values(), ids=FAILURES)
def test_a_plant_that_fails_is_stopped_before_the_host_is_told(tmp_path: Path, body: str, message: str) -> None:
    script = Script(tmp_path, body=body)
    with child(*script.arguments) as plant:
        plant.send(HELLO, RESET, step(1, 1.0))
        assert message in plant.receive_until("error")["message"]
        assert script.done()[-1] == "stop" and plant.end() == 1


def test_a_plant_that_cannot_be_stopped_says_so(tmp_path: Path) -> None:
    script = Script(tmp_path, body="1 / 0", stop="raise OSError('no cable')")
    with child(*script.arguments) as plant:
        plant.send(HELLO, RESET, step(1, 1.0))
        message = plant.receive_until("error")["message"]
        assert "ZeroDivisionError" in message and "may move: OSError: no cable" in message and plant.end() == 1


def test_a_refused_start_ends_the_run(tmp_path: Path) -> None:
    with child(*arm(tmp_path)) as plant:
        plant.send(HELLO, {**RESET, "start": [0.0, 0.0]})
        assert plant.receive()["type"] == "hello"
        assert "list of 4 numbers" in plant.receive()["message"] and plant.end() == 1


def test_the_watchdog_holds_the_safe_command_until_the_next(tmp_path: Path) -> None:
    script = Script(tmp_path, "wall")
    with child(*script.arguments) as plant:
        plant.send(HELLO)
        assert plant.receive()["patience"] == 3
        plant.send(RESET)
        plant.row_of(0)
        plant.send(step(1, 0.5))
        plant.row_of(1)
        # Nothing is sent until the watchdog has acted.
        assert plant.row_of(0)["tau"] == [0.0]
        plant.send(step(2, -0.5))
        plant.row_of(2)
        plant.send(STOP)
        plant.receive_until("stopped")
    done = script.done()
    first = done.index("step 0.5")
    held = next(k for k, line in enumerate(done[first:]) if line != "step 0.5")
    # Three periods of silence at most, fewer if the machine was late and periods were left out.
    assert 1 <= held <= 3 and done[first + held] == "step 0.0"
    assert "step -0.5" in done[first + held :] and done[-1] == "stop"


def test_in_silence_a_plant_goes_on_with_the_next_commands_until_the_watchdog_acts(tmp_path: Path) -> None:
    script = Script(tmp_path, "wall")
    with child(*script.arguments) as plant:
        plant.send(HELLO)
        assert plant.receive()["next"] == 2
        plant.send(RESET)
        plant.row_of(0)
        plant.send({**step(1, 0.5), "next": [[1.0], [9.0], [0.1]]})
        acted = [plant.row_of(1)]
        while (row := plant.receive()["rows"][0])["command"]:
            acted.append(row)
        assert row["tau"] == [0.0] and "ahead" not in row
        # A newer step ends what came with the one before.
        plant.send({**step(2, -0.5), "next": []})
        assert "ahead" not in plant.row_of(2)
        plant.send(STOP)
        plant.receive_until("stopped")
    # Those of periods that the machine was late for are left out, and the rate allows 1 N m a step.
    found = [row.get("ahead", 0) for row in acted]
    assert found[0] == 0 and found == sorted(set(found)) and found[-1] <= 2
    held = {0: "step 0.5", 1: "step 1.0", 2: "step 2.0" if 1 in found else "step 1.5"}
    done = script.done()
    first = done.index("step 0.5")
    assert done[first : first + len(found) + 1] == [*(held[ahead] for ahead in found), "step 0.0"]


class Still(Plant):
    """A plant on the wall clock whose periods a test ends, and what was done to it."""

    name = "still"
    joints = ("shaft",)
    step_s = 3600.0
    clock = "wall"
    patience = 4
    limits = Limits(command=[(-2.0, 2.0)], rate=[1.0 / 3600.0], angle=[(-1.0, 1.0)])
    q = 0.0

    def __init__(self) -> None:
        self.done: list[float] = []

    def reset(self, seed: int, start: object) -> Row:
        return Row(q=[self.q], qd=[0.0])

    def step(self, command: Any) -> Row:
        self.done.append(float(command[0]))
        time = float(len(self.done))
        return Row(q=[self.q], qd=[0.0], time=time)

    def stop(self) -> None:
        """There is nothing to switch off."""


def ahead(number: int, *commands: float) -> Step:
    first, *later = (np.array([command]) for command in commands)
    return Step(number, first, later)


def ticks(episode: WallEpisode, count: int) -> list[tuple[int, int]]:
    """What acted up to the rows of so many periods: id and how many of its next."""
    rows = [episode.tick()[0] for _ in range(count)]
    return [(row["command"], row.get("ahead", 0)) for row in rows]


def test_next_commands_act_one_a_period_and_the_last_is_held_until_the_watchdog() -> None:
    plant = Still()
    episode = WallEpisode(plant, Reset(1, None))
    episode.take(ahead(1, 0.5, 0.6, 0.7))
    assert ticks(episode, 6) == [(0, 0), (1, 0), (1, 1), (1, 2), (1, 2), (0, 0)]
    assert plant.done == [0.5, 0.6, 0.7, 0.7, 0.0, 0.0]


def test_a_newer_command_takes_the_place_of_those_that_came_with_the_one_before() -> None:
    plant = Still()
    episode = WallEpisode(plant, Reset(1, None))
    episode.take(ahead(1, 0.5, 0.6, 0.7))
    ticks(episode, 2)
    episode.take(ahead(2, -0.1, -0.2))
    assert ticks(episode, 3) == [(1, 1), (2, 0), (2, 1)]
    assert plant.done == [0.5, 0.6, -0.1, -0.2, -0.2]


def test_next_commands_are_clipped_to_range_rate_and_braking_zone() -> None:
    plant = Still()
    episode = WallEpisode(plant, Reset(1, None))
    episode.take(ahead(1, 0.5, 9.0, 9.0, 9.0))
    ticks(episode, 2)
    assert plant.done == [0.5, 1.5]
    # The row of this period says that the joint is past its limit.
    plant.q = 1.2
    ticks(episode, 2)
    assert plant.done == [0.5, 1.5, 2.0, 0.0]


def test_a_simulated_plant_ignores_next_commands(tmp_path: Path) -> None:
    script = Script(tmp_path)
    found = rows(script.arguments, RESET, {**step(1, 0.5), "next": [[1.0]]}, step(2, -0.1))
    assert [row.get("ahead", 0) for row in found] == [0, 0, 0]
    assert script.done() == ["reset", "step 0.5", "step -0.1", "stop"]


def test_a_flood_of_messages_stops_the_plant_before_the_host_is_told(tmp_path: Path) -> None:
    # A period that does not end: nothing but the flood can stop this plant.
    script = Script(tmp_path, "wall", step_s=3600.0)
    with child(*script.arguments) as plant:
        plant.send(HELLO, RESET)
        with suppress(BrokenPipeError):
            for number in range(1, 1500):
                plant.send_line(json.dumps(step(number, 0.5)).encode())
        assert "more than 1000 messages in a period" in plant.receive_until("error")["message"]
        assert script.done() == ["reset", "stop"]


def test_of_commands_within_a_period_the_newest_acts(tmp_path: Path) -> None:
    # The plant is busy in its first step until three commands have arrived.
    script = Script(tmp_path, "wall", "self.wait()")
    with child(*script.arguments) as plant:
        plant.send(HELLO, RESET)
        while plant.stderr.readline() != b"busy\n":
            pass
        plant.send(step(1, 0.1), step(2, 0.2), step(3, 0.3))
        script.trace.with_suffix(".go").touch()
        plant.receive()
        plant.row_of(3)
        plant.send(STOP)
        plant.receive_until("stopped")
    assert not {"step 0.1", "step 0.2"} & set(script.done()) and "step 0.3" in script.done()


def test_time_on_the_wall_clock_increases_and_periods_do_not_drift(tmp_path: Path) -> None:
    script = Script(tmp_path, "wall")
    with child(*script.arguments) as plant:
        plant.send(HELLO, RESET)
        plant.receive()
        times = [plant.receive()["rows"][-1]["time"] for _ in range(20)]
    assert (np.diff(times) > 0).all()
    # No row comes before its period ends, however many came before it.
    assert (np.array(times[1:]) >= 0.01 * np.arange(1, 20)).all()


def test_a_new_episode_begins_from_a_stopped_plant(tmp_path: Path) -> None:
    script = Script(tmp_path)
    rows(script.arguments, RESET, step(1, 1.0), RESET, step(1, -1.0))
    assert script.done() == ["reset", "step 1.0", "stop", "reset", "step -1.0", "stop"]


def test_hosts_are_served_over_tcp_one_after_another(tmp_path: Path) -> None:
    script = Script(tmp_path)
    with child(*script.arguments, "--tcp", "127.0.0.1:0") as plant:
        port = int(plant.stderr.readline().split()[-1])
        for last, answer in [(STOP, "stopped"), ({"type": "jump"}, "error"), (STOP, "stopped")]:
            with socket.create_connection(("127.0.0.1", port)) as host, host.makefile("rwb") as file:
                file.writelines(json.dumps(message).encode() + b"\n" for message in [HELLO, RESET, step(1, 1.0), last])
                file.flush()
                said = [json.loads(line) for line in file]
            for message in said:
                check(message, "FromPlant")
            assert [message["type"] for message in said] == ["hello", "rows", "rows", answer]
        plant.process.send_signal(signal.SIGTERM)
        assert plant.process.wait() == 128 + signal.SIGTERM
    assert script.done() == 3 * ["reset", "step 1.0", "stop"]


def test_a_host_that_disconnects_stops_the_plant(tmp_path: Path) -> None:
    script = Script(tmp_path, "wall")
    with child(*script.arguments, "--tcp", "0") as plant:
        port = int(plant.stderr.readline().split()[-1])
        for _ in range(2):
            with socket.create_connection(("127.0.0.1", port)) as host, host.makefile("rwb") as file:
                file.writelines(json.dumps(message).encode() + b"\n" for message in [HELLO, RESET])
                file.flush()
                assert file.readline() and file.readline()
        plant.process.send_signal(signal.SIGINT)
        assert plant.process.wait() == 128 + signal.SIGINT
    assert script.done().count("reset") == 2 and script.done()[-1] == "stop"


class Joint(Plant):
    """A plant for its description and its guard alone."""

    name = "joint"
    joints = ("shaft",)
    step_s = 0.01
    limits = Limits(command=[(-2.0, 2.0)], speed=[5.0], angle=[(-1.0, 1.0)], brake_s=0.1)


class Servo(Joint):
    command = "position"
    safe = (0.0,)


@pytest.mark.parametrize(
    ("q", "qd", "wanted", "admitted"),
    [
        (0.0, 0.0, 1.0, 1.0),
        (0.95, 0.0, 1.0, 1.0),
        (0.95, 1.0, 1.0, 0.0),
        (0.95, 1.0, -1.0, -1.0),
        (1.1, 0.0, 1.0, 0.0),
        (1.1, -1.0, 1.0, 0.0),
        (-0.95, -1.0, -1.0, 0.0),
        (-0.95, -1.0, 9.0, 2.0),
        (0.0, 6.0, 1.0, 0.0),
        (0.0, 6.0, -1.0, -1.0),
        (0.0, -6.0, -1.0, 0.0),
    ],
)
def test_in_the_braking_zone_a_torque_pushes_away_or_brakes(q: float, qd: float, wanted: float, admitted: float) -> None:
    guard = Guard(Joint(), np.zeros(1))
    guard.observe(0.0, np.array([q]), np.array([qd]))
    assert guard.admit(np.array([wanted])) == [admitted]


def test_in_the_braking_zone_a_position_is_not_ahead_of_the_joint() -> None:
    guard = Guard(Servo(), np.zeros(1))
    guard.observe(0.0, np.array([0.95]), np.array([1.0]))
    assert guard.admit(np.array([2.0])) == [0.95]
    assert guard.admit(np.array([-0.5])) == [-0.5]


def test_positions_begin_where_the_joint_is_and_keep_to_the_rate() -> None:
    slow = type("Slow", (Servo,), {"limits": Limits(command=[(-2.0, 2.0)], rate=[1.0])})
    guard = Guard(slow(), np.zeros(1))
    guard.observe(0.0, np.array([0.5]), np.zeros(1))
    assert guard.rest() == pytest.approx([0.49]) and guard.rest() == pytest.approx([0.48])
    assert guard.admit(np.array([2.0])) == pytest.approx([0.49])


def test_a_velocity_that_is_not_measured_is_found_from_positions() -> None:
    guard = Guard(Joint(), np.zeros(1))
    guard.observe(0.0, np.array([0.90]), None)
    assert guard.admit(np.array([1.0])) == [1.0]
    guard.observe(0.01, np.array([0.95]), None)
    assert guard.admit(np.array([1.0])) == [0.0]


WRONG: dict[str, tuple[Message, str]] = {
    "no joints": ({"joints": ()}, "has joints"),
    "names again": ({"joints": ("a", "a"), "limits": Limits([(0, 1), (0, 1)])}, "names"),
    "no step": ({"step_s": 0.0}, "step_s"),
    "an unknown command": ({"command": "speed"}, '"torque" or "position"'),
    "an unknown clock": ({"clock": "sand"}, '"simulated" or "wall"'),
    "no safe position": ({"command": "position"}, "safe to hold"),
    "no way to stop": ({"clock": "wall"}, "stop()"),
    "a limit missing": ({"limits": Limits(command=[])}, "each of 1 joints"),
    "limits swapped": ({"limits": Limits(command=[(1.0, -1.0)])}, "pairs"),
    "a rate of 0": ({"limits": Limits(command=[(-1.0, 1.0)], rate=[0.0])}, "positive"),
    "a safe command outside": ({"safe": (3.0,)}, "outside its limits"),
}


@pytest.mark.parametrize(("attributes", "message"), WRONG.values(), ids=WRONG)
def test_a_plant_that_cannot_be_is_refused(attributes: Message, message: str) -> None:
    with pytest.raises(PlantError, match=re.escape(message)):
        description(type("Wrong", (Joint,), attributes)())


def test_a_description_is_of_the_schema() -> None:
    for plant in (Joint(), Servo(), MujocoPlant(cart(), step_s=0.02)):
        check(json.loads(json.dumps(description(plant))), "PlantHello")


def moved(plant: Plant, *commands: float) -> list[Row]:
    """Rows of an episode of a plant with one joint."""
    found = [plant.reset(1, None)]
    for command in commands:
        row = plant.step(np.array([command]))
        assert isinstance(row, Row)
        found.append(row)
    return found


def forces(found: list[Row]) -> list[float]:
    return [row.tau[0] for row in found if row.tau is not None]


def test_a_force_accelerates_a_mass() -> None:
    found = moved(MujocoPlant(cart(), step_s=0.1), 4.0, 4.0)
    assert np.allclose([row.qd[0] for row in found if row.qd is not None], [0.0, 0.2, 0.4])
    assert np.allclose(forces(found), [0.0, 4.0, 4.0])


def test_a_delay_is_in_steps() -> None:
    found = moved(MujocoPlant(cart(), step_s=0.1, delay=2), 4.0, 0.0, 0.0, 0.0)
    assert np.allclose(forces(found), [0.0, 0.0, 0.0, 4.0, 0.0])


def test_an_encoder_counts_steps_and_measures_no_velocity() -> None:
    found = moved(MujocoPlant(cart(), step_s=0.1, sensors=Sensors(encoder_step=0.003)), *[4.0] * 5)
    counts = np.array([row.q for row in found]) / 0.003
    assert np.allclose(counts, np.round(counts)) and counts[-1] > 0
    assert all(row.qd is None for row in found)


def test_a_position_servo_takes_positions_and_is_safe_where_it_begins() -> None:
    servo = '<position joint="cart" kp="800" kv="80" gear="2" ctrllimited="true" ctrlrange="-3 3"/>'
    plant = MujocoPlant(cart(servo, 'ref="0.5"'), step_s=0.01)
    assert (plant.command, plant.safe, plant.limits.command) == ("position", [0.5], [(-1.5, 1.5)])
    assert np.allclose(moved(plant, *[0.8] * 300)[-1].q, 0.8, atol=1e-6)


REFUSED = {
    "a free joint": ("<freejoint/>", "", "is a free joint"),
    "a ball joint": ('<joint type="ball"/>', "", "is a ball joint"),
    "no joint": ("", "", "no joints"),
    "two actuators": ('<joint name="cart"/>', 2 * MOTOR, "more than one actuator"),
    "no range": ('<joint name="cart"/>', '<motor joint="cart"/>', "no ctrlrange"),
    "a speed servo": ('<joint name="cart"/>', '<velocity joint="cart" ctrlrange="-1 1"/>', "neither a motor nor"),
    "both kinds": (
        '<joint name="cart"/><joint name="other" axis="1 0 0"/>',
        MOTOR + '<position joint="other" kp="5" ctrlrange="-1 1"/>',
        "one kind of command",
    ),
}


@pytest.mark.parametrize(("joint", "actuator", "message"), REFUSED.values(), ids=REFUSED)
def test_a_model_that_is_no_plant_is_refused(joint: str, actuator: str, message: str) -> None:
    body = f'<body>{joint}<geom size="0.1" mass="2"/></body>'
    model = f"<mujoco><worldbody>{body}</worldbody><actuator>{actuator}</actuator></mujoco>"
    with pytest.raises(PlantError, match=message):
        MujocoPlant(model, step_s=0.02)


def test_a_step_is_a_multiple_of_the_models() -> None:
    with pytest.raises(PlantError, match="not a multiple"):
        MujocoPlant(cart(), step_s=0.025)


def test_a_simulation_that_diverges_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # MuJoCo writes its warnings there.
    monkeypatch.chdir(tmp_path)
    plant = MujocoPlant(cart(joint='damping="-10000"'), step_s=0.1)
    with pytest.raises(PlantError, match="diverged"):
        moved(plant, *[4.0] * 100)


@pytest.mark.parametrize(
    ("name", "command", "action"),
    [("Pendulum-v1", [2.0], np.array([2.0], np.float32)), ("Acrobot-v1", [0.0, -1.0], 0), ("CartPole-v1", [10.0, 0.0], 1)],
)
def test_a_ready_plant_moves_as_gymnasium_does(name: str, command: list[float], action: Any) -> None:
    plant = READY[name].make(READY[name].step_s)
    env: Any = gymnasium.make(name).unwrapped
    if name == "Acrobot-v1":
        env.dt = plant.step_s
    observation, _ = env.reset(seed=5)
    row = plant.reset(5, None)
    # So few that Gymnasium's cart-pole does not complain of its pole.
    for _ in range(5):
        expected = plant._measure(observation, np.zeros(len(command)))
        # Gymnasium's angles do not count turns.
        turns = (np.array(row.q, float) - np.array(expected.q, float)) / (2 * np.pi)
        assert np.allclose(turns, np.round(turns), rtol=0, atol=1e-12)
        assert row.qd is not None and expected.qd is not None and np.array_equal(row.qd, expected.qd)
        observation, *_ = env.step(action)
        row = plant.step(np.array(command))


def test_angles_count_on_over_full_turns() -> None:
    plant = READY["Pendulum-v1"].make(0.05)
    first = plant.reset(1, np.array([3.0 + 4 * np.pi, 8.0]))
    second = plant.step(np.array([0.0]))
    assert np.allclose(first.q, 3.0 + 4 * np.pi) and 0.3 < second.q[0] - first.q[0] < 0.5


def test_an_acrobot_whose_elbow_cannot_be_followed_is_refused() -> None:
    with pytest.raises(PlantError, match="too long"):
        acrobot(0.2)


def test_commands_are_scaled_to_the_actions_of_an_environment() -> None:
    plant = GymnasiumPlant(
        gymnasium.make("Pendulum-v1"),
        name="scaled",
        joints=["pivot"],
        step_s=0.05,
        limits=Limits(command=[(-10.0, 10.0)]),
        measure=lambda seen, command: Row(q=[0.0], qd=[seen[2]]),
    )
    env = gymnasium.make("Pendulum-v1")
    env.reset(seed=3)
    plant.reset(3, None)
    assert plant.step(np.array([5.0])).qd == [env.step(np.array([1.0], np.float32))[0][2]]
    with pytest.raises(PlantError, match="begins where it chooses"):
        plant.reset(3, np.zeros(2))
    with pytest.raises(PlantError, match="not continuous"):
        GymnasiumPlant(
            gymnasium.make("CartPole-v1"), name="n", joints=["a"], step_s=1, limits=Limits([(0, 1)]), measure=plant._measure
        )


# A rod of 1 kg and 1 m under 10 m/s^2, upright at q = 0: the equations of the built-in system `pendulum`.
ROD = """
<mujoco>
  <option timestep="0.001" gravity="0 0 -10"/>
  <worldbody><body>
    <joint name="pivot" axis="0 1 0"/>
    <inertial pos="0 0 0.5" mass="1" diaginertia="0.0833333 0.0833333 0.0001"/>
  </body></worldbody>
  <actuator><motor joint="pivot" ctrlrange="-3 3"/></actuator>
</mujoco>
"""

SWING_UP = """
system = "pendulum"
about = "swing up Gymnasium's pendulum"
objective = "cos(q1)"
steps = 100
step_s = 0.05
start = [3.141592653589793, 0.0]
torque = [[-2.0, 2.0]]
replan = 5
integrator = "semi_implicit_euler"

[planner]
method = "icem"
population = 100
elite = 10
iterations = 5
horizon = 40

[goal]
formula = "cos(q1)"
at_least = 0.9
hold_s = 1.0
"""


# The same rod, which moves by itself.
FALLING = """
import math, time
from residyn.plants import Limits, Plant, Row, serve

class Rod(Plant):
    name = "rod on the wall clock"
    joints = ["pivot"]
    step_s = 0.05
    clock = "wall"
    limits = Limits(command=[(-3.0, 3.0)])
    measured = ["applied"]

    def reset(self, seed, start):
        self.q, self.qd, self.torque, self.now = math.pi, 0.0, 0.0, time.monotonic()
        return self.row()

    def step(self, command):
        while self.now < time.monotonic():
            self.qd += 1e-3 * (15.0 * math.sin(self.q) + 3.0 * self.torque)
            self.q += 1e-3 * self.qd
            self.now += 1e-3
        row = self.row()
        self.torque = float(command[0])
        return row

    def row(self):
        return Row(q=[self.q], qd=[self.qd], measured={"applied": self.torque})

    def stop(self):
        self.torque = 0.0

serve(Rod())
"""


def controlled(folder: Path, module: str, *more: str) -> dict[str, Any]:
    return played(folder, f"-m residyn.plants.{module}", *more)


def played(folder: Path, program: str, *more: str) -> dict[str, Any]:
    plant = f"exec:{sys.executable} {program}"
    done = command("control", "--model", "pendulum", "--plant", plant, "--out", folder / "e", "--json", *more)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_the_program_swings_up_a_pendulum_in_mujoco(tmp_path: Path) -> None:
    model = tmp_path / "rod.xml"
    model.write_text(ROD)
    found = controlled(tmp_path, f"mujoco '{model}' --step 0.02", "--replan", "5")
    assert found["successes"] == 1, found
    log = residyn.read_log(tmp_path / "e" / "episode-000.csv")
    assert len(log.time) == 501


def test_the_program_swings_up_the_pendulum_of_gymnasium(tmp_path: Path) -> None:
    task = tmp_path / "task.toml"
    task.write_text(SWING_UP)
    found = controlled(tmp_path, "gymnasium Pendulum-v1", "--task", str(task))
    assert found["successes"] == 1, found


def test_the_program_controls_a_rod_that_does_not_wait(tmp_path: Path) -> None:
    task, rod = tmp_path / "task.toml", tmp_path / "rod.py"
    task.write_text(SWING_UP.replace("steps = 100", "steps = 40"))
    rod.write_text(FALLING)
    found = played(tmp_path, f"'{rod}'", "--task", str(task), "--episodes", "2")
    for number, episode in enumerate(found["episodes"]):
        # A command acts at the next period at the earliest.
        assert episode["late"] >= 0 and episode["latency_s"] >= 0.05, found
        log = residyn.read_log(tmp_path / "e" / f"episode-{number:03}.csv")
        assert len(log.time) >= 41 and np.all(np.abs(log["tau1"]) <= 2.0)
        # What the log says acted up to each row is what the plant applied, however late answers were.
        rows = np.genfromtxt(tmp_path / "e" / f"episode-{number:03}.csv", delimiter=",", names=True)
        assert np.array_equal(rows["tau1"][:-1], rows["u_applied"][1:])
