"""Rigs in MuJoCo with hidden effects: are they named, and with how much motion, beside motions at random within the same limits?

    PATH=target/release:$PATH python benches/investigate.py FOLDER [NAME ...]

`python` needs `pip install residyn[plants]`. Each rig is a chain of links whose description, without what it hides, becomes the declared
model. A minute per rig and kind of motion; several minutes with many effects or joints.
"""

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

STEP_S = 0.01
ENCODER_NOISE = 3e-4
MOTION = "120s"
# What MuJoCo calls the effects.
NAMES = {
    "frictionloss": "coulomb_friction",
    "damping": "viscous_friction",
    "armature": "rotor_inertia",
    "stiffness": "joint_spring",
}
Hidden = dict[int, dict[str, float]]


@dataclass(frozen=True)
class Link:
    """Mass in kg, length in m, axis of the joint, greatest torque in N m, inertia of the rotor behind its gear in kg m^2."""

    mass: float
    length: float
    axis: str
    torque: float
    rotor: float = 0.0


ONE = (Link(0.8, 0.5, "0 1 0", 6),)
TWO = (Link(1.2, 0.45, "0 1 0", 20), Link(0.7, 0.4, "0 1 0", 6))
SIX = (
    Link(3, 0.2, "0 0 1", 60, 0.5),
    Link(3, 0.4, "0 1 0", 60, 0.5),
    Link(2, 0.35, "0 1 0", 30, 0.2),
    Link(1, 0.1, "0 0 1", 10, 0.05),
    Link(0.7, 0.1, "0 1 0", 6, 0.05),
    Link(0.3, 0.08, "0 0 1", 3, 0.02),
)


@dataclass(frozen=True)
class Rig:
    """Links, what each joint hides, whether position servos drive it, and by how many steps commands are late."""

    links: Sequence[Link]
    hidden: Hidden = field(default_factory=dict)
    is_servo: bool = False
    delay: int = 0

    def names(self) -> list[tuple[str, int]]:
        """What is to be named."""
        of_joints = [(NAMES[key], joint) for joint, values in self.hidden.items() for key in values]
        delays = [("actuator_delay", joint + 1) for joint in range(len(self.links)) if self.delay]
        return sorted(of_joints + delays)

    def mjcf(self, hidden: Hidden) -> str:
        """The description of a rig that hides this."""
        body = ""
        for number, link in reversed(list(enumerate(self.links, 1))):
            values = {"armature": link.rotor} | hidden.get(number, {})
            attributes = "".join(f' {key}="{value}"' for key, value in values.items())
            if "frictionloss" in values:
                # As stiff as the time step allows: softer friction acts some milliseconds ahead of the velocity.
                attributes += ' solreffriction="0.002 1"'
            above = self.links[number - 2].length if number > 1 else 0.0
            inertia = link.mass * link.length**2 / 12
            body = (
                f'<body name="link{number}" pos="0 0 {-above}">'
                f'<joint name="joint{number}" type="hinge" axis="{link.axis}"{attributes}/>'
                f'<inertial pos="0 0 {-link.length / 2}" mass="{link.mass}" '
                f'diaginertia="{inertia} {inertia} {max(inertia / 20, 1e-4)}"/>{body}</body>'
            )
        drives = "".join(self.drive(number, link) for number, link in enumerate(self.links, 1))
        return (
            '<mujoco model="rig"><option timestep="0.001" gravity="0 0 -9.81" integrator="RK4"/>'
            f"<worldbody>{body}</worldbody><actuator>{drives}</actuator></mujoco>"
        )

    def drive(self, number: int, link: Link) -> str:
        """The actuator of a joint."""
        if not self.is_servo:
            return f'<motor joint="joint{number}" ctrllimited="true" ctrlrange="{-link.torque} {link.torque}"/>'
        return (
            f'<position joint="joint{number}" kp="25" kv="1" ctrllimited="true" ctrlrange="-3 3" '
            f'forcelimited="true" forcerange="{-link.torque} {link.torque}"/>'
        )

    def limits(self) -> str:
        """The limits file."""
        tables = (
            "[[joint]]\nangle = [-1.6, 1.6]\nspeed = 5.0\nacceleration = 25.0\n"
            f"torque = {float(link.torque)}\ntorque_noise = {0.02 * link.torque}\nencoder_noise = {ENCODER_NOISE}\n"
            for link in self.links
        )
        return f"step_s = {STEP_S}\n\n" + "\n".join(tables)


def _dry(value: float) -> dict[str, float]:
    return {"frictionloss": value}


def _viscous(value: float) -> dict[str, float]:
    return {"damping": value}


def _rotor(value: float) -> dict[str, float]:
    return {"armature": value}


def _spring(value: float) -> dict[str, float]:
    return {"stiffness": value}


RIGS = {
    "one-none": Rig(ONE),
    "one-dry": Rig(ONE, {1: _dry(0.3)}),
    "one-viscous": Rig(ONE, {1: _viscous(0.15)}),
    "one-delay": Rig(ONE, delay=2),
    "one-dry-delay": Rig(ONE, {1: _dry(0.25)}, delay=2),
    "one-both": Rig(ONE, {1: _dry(0.2) | _viscous(0.1)}),
    "one-spring": Rig(ONE, {1: _spring(1.5)}),
    "one-dry-spring": Rig(ONE, {1: _dry(0.3) | _spring(1.0)}),
    "two-none": Rig(TWO),
    "two-dry1": Rig(TWO, {1: _dry(0.6)}),
    "two-viscous2": Rig(TWO, {2: _viscous(0.12)}),
    "two-rotor2": Rig(TWO, {2: _rotor(0.02)}),
    "two-delay": Rig(TWO, delay=2),
    "two-dry-both": Rig(TWO, {1: _dry(0.5), 2: _dry(0.25)}),
    "two-spring2": Rig(TWO, {2: _spring(1.2)}),
    "two-dry1-rotor2": Rig(TWO, {1: _dry(0.5), 2: _rotor(0.02)}),
    "servo-none": Rig(ONE, is_servo=True),
    "servo-dry": Rig(ONE, {1: _dry(0.25)}, is_servo=True),
    # The servo's own damping is free in the declared model and takes it.
    "servo-viscous": Rig(ONE, {1: _viscous(0.2)}, is_servo=True),
    "servo-delay": Rig(ONE, is_servo=True, delay=2),
    "six-none": Rig(SIX),
    "six-dry2": Rig(SIX, {2: _dry(3)}),
    "six-dry-viscous": Rig(SIX, {1: _dry(2), 3: _viscous(1)}),
    "six-dry-5": Rig(SIX, {2: _dry(2), 5: _dry(0.4)}),
}


def made(folder: Path, rig: Rig) -> None:
    """Write a rig, its declared model and its limits."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.xml").write_text(rig.mjcf(rig.hidden))
    (folder / "declared.xml").write_text(rig.mjcf({}))
    (folder / "limits.toml").write_text(rig.limits())
    new = ["residyn", "new", "--from-mjcf", "declared.xml", "--out", "model.toml"]
    subprocess.run(new, cwd=folder, check=True, capture_output=True)


def investigated(folder: Path, rig: Rig, more: Sequence[str]) -> str:
    """How an investigation ends, as a line."""
    sensors = f"--step {STEP_S} --delay {rig.delay} --position-noise {ENCODER_NOISE}"
    plant = f"exec:python -m residyn.plants.mujoco rig.xml {sensors}"
    words = ["--model", "model.toml", "--limits", "limits.toml", "--motion", MOTION, "--seed", "1", "--json", *more]
    command = ["residyn", "investigate", "--plant", plant, *words]
    run = subprocess.run(command, cwd=folder, check=False, capture_output=True, text=True)
    if not run.stdout:
        return f"failed: {run.stderr.strip().splitlines()[-1]}"
    found = json.loads(run.stdout)
    last = found["rounds"][-1]
    named = sorted((effect["name"], effect["joint"]) for effect in last["established"])
    verdict = "right" if named == rig.names() else "wrong"
    told = ", ".join(f"{name}@{joint}" for name, joint in named) or "none"
    return f"{verdict}, {found['motion_s']:.0f} s, {found['ended']}: {told}"


def main() -> None:
    """All rigs, or those that are named."""
    root, *names = sys.argv[1:]
    for name in names or RIGS:
        rig, folder = RIGS[name], Path(root) / name
        made(folder, rig)
        for kind, more in (("designed", []), ("random", ["--random-motions"])):
            print(f"{name:16} {kind:9} {investigated(folder, rig, ['--out', kind, *more])}", flush=True)


if __name__ == "__main__":
    main()
