"""Run a written file of actuator blocks on stand-ins: python actuator_blocks.py BLOCKS.py EXPECTED.json fails unless its
ACTUATORS, in their order, have these classes and fields. The stand-ins have the fields of the classes and no others."""

import dataclasses
import importlib.util
import json
import pathlib
import sys
import types

def stand_in(name, required, optional):
    fields = [(field, object) for field in required]
    fields += [(field, object, dataclasses.field(default=value)) for field, value in optional.items()]
    return dataclasses.make_dataclass(name, fields, kw_only=True)


# ActuatorBaseCfg of Isaac Lab: fields of 2.3 that 3.0 has as well.
BASE = ["joint_names_expr", "stiffness", "damping"]
OPTIONAL = dict.fromkeys(
    ["effort_limit", "effort_limit_sim", "velocity_limit", "velocity_limit_sim", "armature", "friction",
     "dynamic_friction", "viscous_friction"]
)  # fmt: skip
isaaclab = types.SimpleNamespace(
    ImplicitActuatorCfg=stand_in("ImplicitActuatorCfg", BASE, OPTIONAL),
    DelayedPDActuatorCfg=stand_in("DelayedPDActuatorCfg", BASE, OPTIONAL | {"min_delay": 0, "max_delay": 0}),
)
# ActuatorCfg and BuiltinPositionActuatorCfg of mjlab 1.3.
mjlab = types.SimpleNamespace(
    BuiltinPositionActuatorCfg=stand_in(
        "BuiltinPositionActuatorCfg",
        ["target_names_expr", "stiffness", "damping"],
        dict.fromkeys(["effort_limit", "armature", "velocity_limit", "frictionloss", "viscous_damping"])
        | {"delay_min_lag": 0, "delay_max_lag": 0, "delay_hold_prob": 0.0, "delay_update_period": 0}
        | {"delay_per_env_phase": True},
    )
)
for package, module, names in (("isaaclab", "isaaclab.actuators", isaaclab), ("mjlab", "mjlab.actuator", mjlab)):
    sys.modules[package] = types.ModuleType(package)
    sys.modules[module] = names

spec = importlib.util.spec_from_file_location("blocks", sys.argv[1])
blocks = importlib.util.module_from_spec(spec)
spec.loader.exec_module(blocks)
written = blocks.ACTUATORS
if isinstance(written, dict):
    # One a joint, under its name.
    assert [[name] for name in written] == [actuator.joint_names_expr for actuator in written.values()], written
    written = written.values()
found = [{"class": type(actuator).__name__} | dataclasses.asdict(actuator) for actuator in written]
expected = json.loads(pathlib.Path(sys.argv[2]).read_text())
assert len(found) == len(expected), found
for mine, theirs in zip(expected, found):
    assert mine.items() <= json.loads(json.dumps(theirs)).items(), (mine, theirs)
