"""Compare `residyn excite` with other tools that design excitation, on one arm within one set of limits.

    cargo build --release -p residyn-excite --example judge
    python3 benches/excite_peers.py --judge target/release/examples/judge --pipeline FOLDER

FOLDER is a copy of https://github.com/alibrd/robot-sysid-pipeline (numpy, scipy and sympy are needed). It is given a URDF of the
arm, written from the model file, and the same limits; its motion is judged by the same program as the designed one. The
others' code is run as it is; nothing of it is here.
"""

import argparse
import json
import math
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import numpy
import scipy.interpolate

ROOT = Path(__file__).resolve().parents[1]
STEP_S = 0.01
DURATION_S = 10.0


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--judge", type=Path, required=True, help="the example `judge` of residyn-excite")
    parser.add_argument("--pipeline", type=Path, help="a copy of robot-sysid-pipeline")
    parser.add_argument("--model", type=Path, default=ROOT / "configs/bench/arm-seven.toml")
    parser.add_argument("--torque", type=float, default=150.0, help="largest torque of joint 1 (N m); each further one has 62 % of it")
    parser.add_argument("--iterations", type=int, default=300, help="most iterations of the pipeline's optimiser; its own default is 300")
    parser.add_argument("--out", type=Path, default=Path("excite-peers"))
    return parser.parse_args()


def limits(joints, torque):
    """Symmetric limits of each joint, as in the tests of residyn-excite."""
    return [
        {"angle": [-2.0, 2.0], "speed": 2.0, "acceleration": 10.0, "torque": torque * 0.62**k, "torque_rate": 20.0 * torque * 0.62**k}
        for k in range(joints)
    ]


def limits_text(joints):
    def value(item):
        return json.dumps(item)

    tables = ["[[joint]]\n" + "".join(f"{key} = {value(item)}\n" for key, item in joint.items()) for joint in joints]
    return f"step_s = {STEP_S}\n\n" + "\n".join(tables)


def urdf(model):
    """The serial chain of a model file as a URDF: every link frame has its joint's axis as z."""
    parameters = {name: table["value"] for name, table in model["parameters"].items()}
    links = model["chain"]["link"]
    text = [f'<robot name="{model["system"]["name"]}">', '<link name="base"/>']
    for number, link in enumerate(links, start=1):
        axis, across = numpy.array(link["axis"]), numpy.array(link["across"])
        rotation = numpy.column_stack([across, numpy.cross(axis, across), axis])
        roll = math.atan2(rotation[2, 1], rotation[2, 2])
        pitch = math.atan2(-rotation[2, 0], math.hypot(rotation[0, 0], rotation[1, 0]))
        yaw = math.atan2(rotation[1, 0], rotation[0, 0])
        mass = parameters[link["mass"]]
        centre = numpy.array([parameters[name] for name in link["moment"]]) / mass
        xx, xy, xz, yy, yz, zz = (parameters[name] for name in link["inertia"])
        about_origin = numpy.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        inertia = about_origin - mass * (centre @ centre * numpy.eye(3) - numpy.outer(centre, centre))
        parent = "base" if number == 1 else f"link{number - 1}"
        xyz = " ".join(map(repr, link["origin"]))
        text += [
            f'<link name="link{number}"><inertial>',
            f'<origin xyz="{" ".join(repr(float(c)) for c in centre)}" rpy="0 0 0"/><mass value="{mass!r}"/>',
            "<inertia "
            + " ".join(
                f'i{name}="{float(inertia[i, j])!r}"'
                for name, i, j in [("xx", 0, 0), ("xy", 0, 1), ("xz", 0, 2), ("yy", 1, 1), ("yz", 1, 2), ("zz", 2, 2)]
            )
            + "/></inertial></link>",
            f'<joint name="joint{number}" type="revolute"><parent link="{parent}"/><child link="link{number}"/>',
            f'<origin xyz="{xyz}" rpy="{roll!r} {pitch!r} {yaw!r}"/><axis xyz="0 0 1"/>',
            '<limit lower="-2.0" upper="2.0" velocity="2.0" effort="1000"/></joint>',
        ]
    return "\n".join(text + ["</robot>"])


def judged(options, motion=None):
    command = [options.judge, options.model, options.out / "limits.toml", str(DURATION_S)]
    done = subprocess.run([*map(str, command), *([str(motion)] if motion else [])], check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def write(path, q, qd, qdd):
    stems = [f"{stem}{k + 1}" for stem in ("q", "qd", "qdd") for k in range(q.shape[1])]
    numpy.savetxt(path, numpy.hstack([q, qd, qdd]), delimiter=",", header=",".join(stems), comments="")


def of_pipeline(options, joints):
    """The motion of robot-sysid-pipeline: five harmonics of one period, the least condition number, torques within limits."""
    both = {"position": "angle", "velocity": "speed", "acceleration": "acceleration", "torque": "torque"}
    ranged = {
        name: [own[key] if isinstance(own[key], list) else [-own[key], own[key]] for own in joints] for name, key in both.items()
    }
    config = {
        "urdf_path": str((options.out / "arm.urdf").resolve()),
        "output_dir": str((options.out / "pipeline").resolve()),
        "method": "newton_euler",
        "stages": {"excitation": True, "identification": False, "validation": False, "plot": False, "report": False, "benchmark": False},
        "joint_limits": ranged,
        "excitation": {
            "basis_functions": "both",
            "optimize_phase": False,
            "num_harmonics": 5,
            "base_frequency_hz": 1.0 / DURATION_S,
            "optimize_condition_number": True,
            "optimizer_max_iter": options.iterations,
            "trajectory_duration_periods": 1,
            "torque_constraint_method": "soft_penalty",
        },
        "friction": {"model": "none"},
    }
    path = options.out / "pipeline.json"
    path.write_text(json.dumps(config))
    written = options.out / "pipeline/pipeline/excitation_trajectory.npz"
    written.unlink(missing_ok=True)
    start = time.monotonic()
    with (options.out / "pipeline.log").open("w") as log:
        run = subprocess.Popen([sys.executable, "sysid.py", str(path.resolve())], cwd=options.pipeline, stdout=log, stderr=log)
        # After the motion it goes on to other results.
        while run.poll() is None and not written.exists():
            time.sleep(0.2)
        seconds = time.monotonic() - start
        time.sleep(2.0)
        run.terminate()
    found = numpy.load(written, allow_pickle=True)
    times = numpy.arange(round(DURATION_S / STEP_S) + 1) * STEP_S
    # One period, from its few rows to those of the limits.
    return [scipy.interpolate.CubicSpline(found["t"], rows(found, name), axis=0)(times) for name in ("q", "dq", "ddq")], seconds


def rows(found, name):
    """A channel with one row each time."""
    channel = found[name]
    return channel if channel.shape[0] == len(found["t"]) else channel.T


def row(name, value, seconds):
    relative = sum(one["half_width"] / one["size"] for one in value["expected"])
    most = max(value["uses"], key=lambda use: use["share"])
    print(
        f"| {name} | {value['log_determinant']:.1f} | {value['condition']:.0f} | {relative:.2f} | {seconds:.1f} | "
        f"{100 * most['share']:.0f} % of the {most['quantity']} of joint {most['joint']} |"
    )


def main():
    options = arguments()
    options.out.mkdir(parents=True, exist_ok=True)
    model = tomllib.loads(options.model.read_text())
    joints = limits(model["system"]["joints"], options.torque)
    (options.out / "limits.toml").write_text(limits_text(joints))
    (options.out / "arm.urdf").write_text(urdf(model))
    print("| tool | log det | condition | sum of relative intervals | s | most of a limit |")
    print("|---|---|---|---|---|---|")
    designed = judged(options)
    row("residyn excite", designed, designed["time_s"])
    if options.pipeline:
        motion, seconds = of_pipeline(options, joints)
        write(options.out / "pipeline.csv", *motion)
        row("robot-sysid-pipeline", judged(options, options.out / "pipeline.csv"), seconds)


if __name__ == "__main__":
    main()
