"""Random motions of public robots, with the torques that Pinocchio and MuJoCo find for them, as JSON.

Arguments: a folder of descriptions of our own, and the file to write. Other robots are those of the package
example-robot-data.
"""

import json
import pathlib
import sys
import xml.etree.ElementTree as tree

import mujoco
import numpy
import pinocchio

# File, last link of the chain; the whole tree without one.
ROBOTS = [
    ("panda_description/urdf/panda.urdf", "panda_link8"),
    ("panda_description/urdf/panda.urdf", None),
    ("ur_description/urdf/ur10_robot.urdf", "tool0"),
    ("ur_description/urdf/ur5_gripper.urdf", "tool0"),
    ("kinova_description/robots/kinova.urdf", "j2s6s200_end_effector"),
    ("xarm_description/urdf/xarm7.urdf", None),
    ("z1_description/urdf/z1.urdf", None),
    ("talos_data/robots/talos_left_arm.urdf", "arm_left_7_link"),
    ("so_arm_description/urdf/so101.urdf", None),
    ("tiago_description/robots/tiago_no_hand.urdf", "arm_7_link"),
    ("baxter_description/urdf/baxter.urdf", "left_gripper"),
    ("go2_description/urdf/go2.urdf", None),
    ("b1_description/urdf/b1-z1.urdf", None),
    ("g1_description/urdf/g1_29dof_rev_1_0.urdf", None),
    ("talos_data/robots/talos_reduced.urdf", None),
    ("tiago_pro_description/robots/tiago_pro.urdf", None),
    ("alex_description/urdf/alex_sake_hands.urdf", None),
]
OWN = [("linkage_4r.urdf", "hand")]
SAMPLES = 100


def path_to(robot, tip):
    """Joints that move on the way to a link, from the base outwards."""
    above = {joint.find("child").get("link"): joint for joint in robot.iter("joint") if joint.find("child") is not None}
    path = []
    while tip in above:
        path.insert(0, above[tip])
        tip = above[tip].find("parent").get("link")
    return [joint for joint in path if joint.get("type") != "fixed"]


def joints_of(robot):
    """All joints that move: each before those that it carries, limb by limb."""
    below = {}
    for joint in robot.iter("joint"):
        if joint.find("child") is not None:
            below.setdefault(joint.find("parent").get("link"), []).append(joint)

    def beyond(link):
        for joint in below.get(link, []):
            yield joint
            yield from beyond(joint.find("child").get("link"))

    links = {link.get("name") for link in robot.iter("link")}
    carried = {joint.find("child").get("link") for joints in below.values() for joint in joints}
    (base,) = links - carried
    return [joint for joint in beyond(base) if joint.get("type") not in ("fixed", "floating")]


def bare(file, tip):
    """The file without shapes, with all joints off the path to `tip`, if there is one, fixed and those that follow others
    freed, the names of the others, and for each of them the joint that leads it (itself, if it follows none), ratio and
    offset."""
    robot = tree.parse(file).getroot()
    path = path_to(robot, tip) if tip else joints_of(robot)
    leaders = {joint.get("name"): (joint.get("name"), 1.0, 0.0) for joint in path}
    for joint in robot.iter("joint"):
        if joint not in path and joint.get("type") is not None:
            joint.set("type", "fixed")
        for mimic in joint.findall("mimic"):
            if joint in path:
                ratio, offset = (float(mimic.get(key, default)) for key, default in (("multiplier", 1), ("offset", 0)))
                leaders[joint.get("name")] = (mimic.get("joint"), ratio, offset)
            joint.remove(mimic)
    for link in robot.iter("link"):
        for shape in link.findall("visual") + link.findall("collision"):
            link.remove(shape)
    for other in list(robot):
        if other.tag not in ("link", "joint"):
            robot.remove(other)
    return tree.tostring(robot, encoding="unicode"), leaders


class Pinocchio:
    def __init__(self, text, joints):
        self.model = pinocchio.buildModelFromXML(text)
        self.data = self.model.createData()
        self.joints = [self.model.joints[self.model.getJointId(name)] for name in joints]

    def torques(self, q, qd, qdd):
        state, velocity, acceleration = pinocchio.neutral(self.model), numpy.zeros(self.model.nv), numpy.zeros(self.model.nv)
        for joint, *of_joint in zip(self.joints, q, qd, qdd):
            # A joint without limits has a cosine and a sine.
            state[joint.idx_q : joint.idx_q + joint.nq] = (
                of_joint[0] if joint.nq == 1 else [numpy.cos(of_joint[0]), numpy.sin(of_joint[0])]
            )
            velocity[joint.idx_v], acceleration[joint.idx_v] = of_joint[1:]
        found = pinocchio.rnea(self.model, self.data, state, velocity, acceleration)
        return [found[joint.idx_v] for joint in self.joints]


class Mujoco:
    def __init__(self, text, joints):
        self.model = mujoco.MjModel.from_xml_string(text)
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.model.dof_damping[:] = 0.0
        self.data = mujoco.MjData(self.model)
        self.joints = [self.model.joint(name) for name in joints]

    def torques(self, q, qd, qdd):
        for joint, *of_joint in zip(self.joints, q, qd, qdd):
            self.data.qpos[joint.qposadr], self.data.qvel[joint.dofadr], self.data.qacc[joint.dofadr] = of_joint
        mujoco.mj_inverse(self.model, self.data)
        return [float(self.data.qfrc_inverse[joint.dofadr][0]) for joint in self.joints]


def of_robot(file, tip, draw):
    text, leaders = bare(file, tip)
    joints = [name for name, (leader, _, _) in leaders.items() if leader == name]
    peers = [("Pinocchio", Pinocchio(text, leaders))]
    try:
        peers.append(("MuJoCo", Mujoco(text, leaders)))
    except ValueError as refused:
        print(f"{file}: MuJoCo: {refused}")
    samples = []
    for _ in range(SAMPLES):
        q, qd, qdd = (dict(zip(joints, draw.uniform(-bound, bound, len(joints)))) for bound in (3.0, 3.0, 10.0))
        moved = [
            (ratio * q[leader] + offset, ratio * qd[leader], ratio * qdd[leader])
            for leader, ratio, offset in leaders.values()
        ]
        torques = {}
        for name, peer in peers:
            torques[name] = dict.fromkeys(joints, 0.0)
            for (leader, ratio, _), torque in zip(leaders.values(), peer.torques(*zip(*moved))):
                torques[name][leader] += ratio * torque
        numbers = {"q": q, "qd": qd, "qdd": qdd} | torques
        samples.append({name: list(of_joints.values()) for name, of_joints in numbers.items()})
    return {
        "file": str(file),
        "tip": tip,
        "joints": joints,
        "peers": [name for name, _ in peers],
        "samples": samples,
    }


prefixes = [pathlib.Path(folder) / "cmeel.prefix/share/example-robot-data/robots" for folder in sys.path]
folder = next(prefix for prefix in prefixes if prefix.is_dir())
own, out = map(pathlib.Path, sys.argv[1:])
draw = numpy.random.default_rng(0)
robots = [(folder / file, tip) for file, tip in ROBOTS] + [(own / file, tip) for file, tip in OWN]
out.write_text(json.dumps([of_robot(file, tip, draw) for file, tip in robots]))
