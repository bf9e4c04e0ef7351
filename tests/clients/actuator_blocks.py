"""Run a written file of actuator blocks on stand-ins: python actuator_blocks.py BLOCKS.py EXPECTED.json fails unless its
ACTUATORS, in their order, have these classes and fields, and its EVENTS these functions, operations and ranges. The
stand-ins have the fields of the classes, and the parameters of the functions, and no others."""

import dataclasses
import importlib.util
import inspect
import json
import math
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
TERM = {"interval_range_s": None, "is_global_time": False, "min_step_count_between_reset": 0, "params": None}
EventTermCfg = stand_in("EventTermCfg", ["func", "mode"], TERM)


# Functions of isaaclab.envs.mdp, of 2.3 and 3.0.
def randomize_actuator_gains(
    env, env_ids, asset_cfg, stiffness_distribution_params=None, damping_distribution_params=None, operation="abs", distribution="uniform"
):
    pass


def randomize_joint_parameters(
    env, env_ids, asset_cfg, friction_distribution_params=None, armature_distribution_params=None,
    lower_limit_distribution_params=None, upper_limit_distribution_params=None, operation="abs", distribution="uniform"
):  # fmt: skip
    pass


# Functions of mjlab.envs.mdp.dr, of 1.3 and later.
def pd_gains(env, env_ids, kp_range, kd_range, asset_cfg=None, distribution="uniform", operation="scale"):
    pass


def effort_limits(env, env_ids, effort_limit_range, asset_cfg=None, distribution="uniform", operation="scale"):
    pass


def joint_damping(env, env_ids, ranges, asset_cfg=None, distribution="uniform", operation="abs", axes=None, shared_random=False):
    pass


def joint_armature(env, env_ids, ranges, asset_cfg=None, distribution="uniform", operation="abs", axes=None, shared_random=False):
    pass


def joint_friction(env, env_ids, ranges, asset_cfg=None, distribution="uniform", operation="abs", axes=None, shared_random=False):
    pass


MODULES = {
    "isaaclab.actuators": isaaclab,
    "isaaclab.envs": types.SimpleNamespace(mdp=sys.modules[__name__]),
    "isaaclab.managers": types.SimpleNamespace(
        EventTermCfg=EventTermCfg, SceneEntityCfg=dataclasses.make_dataclass("SceneEntityCfg", ["name", ("joint_names", object, None)])
    ),
    "mjlab.actuator": mjlab,
    "mjlab.envs.mdp": types.SimpleNamespace(dr=sys.modules[__name__]),
    "mjlab.managers.event_manager": types.SimpleNamespace(EventTermCfg=EventTermCfg),
    "mjlab.managers.scene_entity_config": types.SimpleNamespace(
        SceneEntityCfg=dataclasses.make_dataclass("SceneEntityCfg", ["name", ("joint_names", object, None), ("actuator_names", object, None)])
    ),
}
for module, names in MODULES.items():
    for package in module.split(".")[:-1]:
        sys.modules[package] = types.ModuleType(package)
    sys.modules[module] = names

spec = importlib.util.spec_from_file_location("blocks", sys.argv[1])
blocks = importlib.util.module_from_spec(spec)
spec.loader.exec_module(blocks)
expected = json.loads(pathlib.Path(sys.argv[2]).read_text())

written = blocks.ACTUATORS
if isinstance(written, dict):
    # One a joint, under its name.
    assert [[name] for name in written] == [actuator.joint_names_expr for actuator in written.values()], written
    written = written.values()
found = [{"class": type(actuator).__name__} | dataclasses.asdict(actuator) for actuator in written]
assert len(found) == len(expected["actuators"]), found
for mine, theirs in zip(expected["actuators"], found):
    assert mine.items() <= json.loads(json.dumps(theirs)).items(), (mine, theirs)

joints = [name for actuator in found for name in actuator.get("joint_names_expr") or actuator["target_names_expr"]]


def is_event(event, name, function, operation, ranges):
    """Whether an event draws from these ranges for the joint in its name, once for each environment."""
    inspect.signature(event.func).bind(None, None, **event.params)
    asset = event.params["asset_cfg"]
    named = [names for field, names in dataclasses.asdict(asset).items() if field.endswith("_names")]
    [joint] = [joint for joint in joints if name.endswith(f" of {joint}")]
    assert asset.name == "robot" and all(list(names) == [joint] for names in named), asset
    drawn = {key: value for key, value in event.params.items() if key not in ("asset_cfg", "operation")}
    assert drawn.keys() == ranges.keys(), drawn
    ends = [(end, wanted) for key in ranges for end, wanted in zip(drawn[key], ranges[key], strict=True)]
    assert all(isinstance(drawn[key], tuple) for key in ranges) and all(math.isclose(*pair, abs_tol=1e-12) for pair in ends), ends
    return [event.mode, event.func.__name__, event.params["operation"]] == ["startup", function, operation]


events = getattr(blocks, "EVENTS", {})
assert sorted(events) == sorted(expected["events"]), events
for name, wanted in expected["events"].items():
    assert is_event(events[name], name, *wanted), events[name]
