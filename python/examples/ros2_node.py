"""A robot on ROS 2 as a plant (docs/plants.md): joint states in, efforts out.

No robot was there to try this example: it shows where things go. Try it in simulation first.

    python ros2_node.py
    python ros2_node.py --tcp 127.0.0.1:4000

Reads sensor_msgs/JointState from /joint_states, and writes std_msgs/Float64MultiArray to /effort_controller/commands, the topic of
an effort controller of ros2_control. That controller holds its last command: let the hardware interface have a watchdog of its own,
for this program or its computer may fail. Needs rclpy.
"""

import sys
import threading

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from residyn.plants import Limits, Plant, PlantError, Row, serve
from residyn.plants.plant import Array

# A state is too old to act on after so many periods.
OLD = 3


class Robot(Plant):
    name = "two joints on ROS 2"
    joints = ["shoulder", "elbow"]
    step_s = 0.01
    clock = "wall"
    limits = Limits(command=[(-5.0, 5.0), (-3.0, 3.0)], speed=[6.0, 6.0], angle=[(-2.0, 2.0), (-2.5, 2.5)])

    def __init__(self) -> None:
        self._node = rclpy.create_node("residyn_plant")
        self._publisher = self._node.create_publisher(Float64MultiArray, "/effort_controller/commands", 1)
        self._node.create_subscription(JointState, "/joint_states", self._note, 1)
        self._newest: JointState | None = None
        self._age = 0
        self._arrived = threading.Event()
        executor = SingleThreadedExecutor()
        executor.add_node(self._node)
        threading.Thread(target=executor.spin, daemon=True).start()

    def reset(self, seed: int, start: Array | None) -> Row:
        if start is not None:
            raise PlantError("this robot begins where it is: reset it without a start")
        self._arrived.clear()
        if not self._arrived.wait(2.0):
            raise PlantError("no joint states for 2 s: is the joint state broadcaster running?")
        return self._row()

    def step(self, command: Array) -> Row:
        # The state comes first: the new command has not acted on it.
        row = self._row()
        self._send(command)
        return row

    def stop(self) -> None:
        self._send([0.0] * len(self.joints))

    def _note(self, state: JointState) -> None:
        self._newest, self._age = state, 0
        self._arrived.set()

    def _row(self) -> Row:
        state, self._age = self._newest, self._age + 1
        if state is None or self._age > OLD:
            raise PlantError(f"no joint states for {OLD} periods")
        # Joint states come in an order of their own.
        places = [state.name.index(joint) for joint in self.joints]
        return Row(q=[state.position[place] for place in places], qd=[state.velocity[place] for place in places])

    def _send(self, efforts: Array | list[float]) -> None:
        self._publisher.publish(Float64MultiArray(data=[float(effort) for effort in efforts]))


def main() -> int:
    # SIGINT is the plant's own business: the robot is stopped while ROS still runs.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        return serve(Robot())
    finally:
        rclpy.shutdown()


if __name__ == "__main__":
    sys.exit(main())
