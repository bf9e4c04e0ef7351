"""Write one trajectory as recordings of robots, with the libraries that people use.

Arguments: a CSV file with the columns time, q1, q2, qd1, qd2, tau1, tau2, and the folder to write into. The joints are
called elbow and wrist, and messages name them in the other order.
"""

import csv
import io
import json
import pathlib
import shutil
import sys
from types import SimpleNamespace as Message

import mcap.writer
import mcap_ros2.writer
import numpy
from mcap.writer import CompressionType, IndexType
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

source, folder = (pathlib.Path(argument) for argument in sys.argv[1:])
with open(source, newline="") as file:
    _, *rows = list(csv.reader(file))
rows = numpy.array(rows, dtype=float)
BEGIN = 1_700_000_000_000_000_000
stamps = [BEGIN + round(1e9 * time) for time in rows[:, 0]]
positions, velocities, efforts = (numpy.ascontiguousarray(rows[:, columns]) for columns in ([2, 1], [4, 3], [6, 5]))
JOINTS = ["wrist", "elbow"]
LATE = 2_000_000  # a message is recorded after it was stamped

types = get_typestore(Stores.ROS2_HUMBLE).types
Time, Header = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
JointState = types["sensor_msgs/msg/JointState"]


def header(stamp):
    return Header(Time(stamp // 10**9, stamp % 10**9), "base")


def state(row, stamp, joints=JOINTS):
    return JointState(header(stamp), joints, positions[row], velocities[row], efforts[row])


def bag(name, storage, mode=None):
    """A folder of rosbag2."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    writer = Writer(folder / name, version=9, storage_plugin=storage)
    if mode:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        channel = writer.add_connection("/joint_states", JointState.__msgtype__, typestore=store)
        for row, stamp in enumerate(stamps):
            data = store.serialize_cdr(state(row, stamp), JointState.__msgtype__)
            writer.write(channel, stamp + LATE, data)


bag("sqlite", StoragePlugin.SQLITE3)
bag("messages_packed", StoragePlugin.SQLITE3, CompressionMode.MESSAGE)
bag("file_packed", StoragePlugin.SQLITE3, CompressionMode.FILE)
bag("rosbag_mcap", StoragePlugin.MCAP)
(folder / "without_metadata").mkdir()
for name in ("alone.db3", "without_metadata/run_0.db3"):
    shutil.copy(folder / "sqlite/sqlite.db3", folder / name)

RULE = "\n" + 80 * "=" + "\n"
HEADER = "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id" + RULE
HEADER += "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec"
DEFINITIONS = {
    "sensor_msgs/msg/JointState": "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
    "float64[] effort" + RULE + HEADER,
    "std_msgs/msg/Float64MultiArray": "std_msgs/MultiArrayLayout layout\nfloat64[] data" + RULE
    + "MSG: std_msgs/MultiArrayLayout\nstd_msgs/MultiArrayDimension[] dim\nuint32 data_offset" + RULE
    + "MSG: std_msgs/MultiArrayDimension\nstring label\nuint32 size\nuint32 stride",
    "std_msgs/msg/String": "string data",
}


def joint_state(row, stamp, names=JOINTS, of=(positions, velocities, efforts)):
    time = Message(sec=stamp // 10**9, nanosec=stamp % 10**9)
    arrays = zip(("position", "velocity", "effort"), (list(channel[row]) if channel is not None else [] for channel in of))
    return Message(header=Message(stamp=time, frame_id=""), name=names, **dict(arrays))


def states(**how):
    """Messages of the joints: time of recording, type, message."""
    return [(stamp + LATE, "sensor_msgs/msg/JointState", joint_state(row, stamp, **how)) for row, stamp in enumerate(stamps)]


def commands(every=3, first=2):
    """Torques in the order elbow, wrist, at fewer times than the joints' states, and from a later one on."""
    data = [(stamps[row] + LATE, list(efforts[row, ::-1])) for row in range(first, len(stamps), every)]
    layout = Message(dim=[], data_offset=0)
    return [(time, "std_msgs/msg/Float64MultiArray", Message(layout=layout, data=values)) for time, values in data]


def record(name, topics, compression=CompressionType.ZSTD, chunk_size=4096, **options):
    """An MCAP file of ROS 2 messages by topic."""
    with open(folder / name, "wb") as file:
        writer = mcap_ros2.writer.Writer(io.BytesIO() if options else file, chunk_size=chunk_size, compression=compression)
        if options:  # which the writer of messages does not pass on
            writer._writer = mcap.writer.Writer(file, **options)
            writer._writer.start(profile="ros2", library="")
        schemas = {kind: writer.register_msgdef(kind, text) for kind, text in DEFINITIONS.items()}
        every = sorted((time, topic, kind, message) for topic, of in topics.items() for time, kind, message in of)
        for time, topic, kind, message in every:
            writer.write_message(topic, schemas[kind], message, log_time=time, publish_time=time)
        writer.finish()


record("zstd.mcap", {"/joint_states": states()})
record("lz4.mcap", {"/joint_states": states()}, CompressionType.LZ4)
record("plain.mcap", {"/joint_states": states()}, CompressionType.NONE)
record("loose.mcap", {"/joint_states": states()}, use_chunking=False, index_types=IndexType.NONE, use_statistics=False,
       use_summary_offsets=False, repeat_channels=False, repeat_schemas=False)
whole = (folder / "zstd.mcap").read_bytes()
(folder / "cut.mcap").write_bytes(whole[: len(whole) // 2])

unstamped = [(time, kind, Message(**{**vars(message), "header": Message(stamp=Message(sec=0, nanosec=0), frame_id="")}))
             for time, kind, message in states()]
record("unstamped.mcap", {"/joint_states": unstamped})
fingers = [(time, kind, joint_state(0, time, ["left", "right"])) for time, kind, _ in states()[::5]]
record("gripper.mcap", {"/joint_states": states(), "/gripper/joint_states": fingers})
shared = sorted(states() + [(time + 1, kind, message) for time, kind, message in fingers], key=lambda entry: entry[0])
record("shared_topic.mcap", {"/joint_states": shared})
text = [(BEGIN, "std_msgs/msg/String", Message(data="begun"))]
record("two_arms.mcap", {"/left/joint_states": states(), "/right/joint_states": states()[:30], "/said": text})
record("angles.mcap", {"/joint_states": states(of=(positions, None, None))})
record("commands.mcap", {"/joint_states": states(of=(positions, velocities, None)), "/effort_controller/commands": commands()})
record("text.mcap", {"/said": text})
record("lengths.mcap", {"/joint_states": states()[:20] + [(stamps[20], "sensor_msgs/msg/JointState", joint_state(
    20, stamps[20], ["wrist", "elbow", "hand"]))]})


def record_json(name, schema, topic, message):
    """An MCAP file of messages in JSON."""
    with open(folder / name, "wb") as file:
        writer = mcap.writer.Writer(file)
        writer.start()
        kind = writer.register_schema(schema, "jsonschema", b"{}")
        channel = writer.register_channel(topic, "json", kind)
        for row, stamp in enumerate(stamps):
            data = json.dumps(message(row, stamp)).encode()
            writer.add_message(channel, stamp + LATE, data, stamp + LATE)
        writer.add_metadata("run", {"kp": "40", "site": "lab"})
        writer.finish()


def as_ros(row, stamp):
    stamp = {"sec": stamp // 10**9, "nanosec": stamp % 10**9}
    return {"header": {"stamp": stamp}, "name": JOINTS, "position": list(positions[row]),
            "velocity": list(velocities[row]), "effort": list(efforts[row])}


def as_foxglove(row, stamp):
    of_joint = zip(JOINTS, positions[row], velocities[row], efforts[row])
    joints = [dict(zip(("name", "position", "velocity", "effort"), values)) for values in of_joint]
    return {"timestamp": {"sec": stamp // 10**9, "nsec": stamp % 10**9}, "joints": joints}


record_json("ros_json.mcap", "sensor_msgs/JointState", "/joint_states", as_ros)
record_json("foxglove.mcap", "foxglove.JointStates", "/joints", as_foxglove)
record_json("no_cdr.mcap", "sensor_msgs/JointState", "/joint_states", lambda row, stamp: {"name": row})
