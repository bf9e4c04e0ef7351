"""A motor on a microcontroller behind a serial port, as a plant (docs/plants.md).

No hardware was there to try this example: it shows where things go. Try it with the motor unpowered first.

    python serial_microcontroller.py /dev/ttyACM0
    python serial_microcontroller.py /dev/ttyACM0 --tcp 127.0.0.1:4000

The firmware answers a line "T 0.0500\n", a torque in N m, with a line "1.2345 -0.4200 24.1\n": angle in rad, speed in rad/s and
supply voltage at that moment; and switches the motor off if no line comes for 50 ms. That watchdog is not optional: this program,
its computer or its cable may fail. Needs pyserial.
"""

import sys
from collections.abc import Sequence

import serial

from residyn.plants import Limits, Plant, PlantError, Row, serve
from residyn.plants.plant import Array


class Motor(Plant):
    name = "motor on a microcontroller"
    joints = ["shaft"]
    step_s = 0.01
    clock = "wall"
    limits = Limits(command=[(-0.2, 0.2)], rate=[2.0], speed=[40.0], angle=[(-3.0, 3.0)])
    measured = ["voltage"]

    def __init__(self, port: str) -> None:
        # The timeouts are shorter than a period: a call that waits holds up the watchdog.
        self._port = serial.Serial(port, 115200, timeout=0.005, write_timeout=0.005)

    def reset(self, seed: int, start: Array | None) -> Row:
        if start is not None:
            raise PlantError("this motor begins where it is: reset it without a start")
        self._port.reset_input_buffer()
        return self._exchange(0.0)

    def step(self, command: Array) -> Row:
        return self._exchange(float(command[0]))

    def stop(self) -> None:
        self._port.write(b"T 0\n")

    def _exchange(self, torque: float) -> Row:
        self._port.write(b"T %.4f\n" % torque)
        line = self._port.readline()
        if not line.endswith(b"\n"):
            raise PlantError("the microcontroller did not answer within 5 ms: check power and cable")
        angle, speed, voltage = map(float, line.split())
        return Row(q=[angle], qd=[speed], measured={"voltage": voltage})


def main(arguments: Sequence[str]) -> int:
    port, *options = arguments
    return serve(Motor(port), options)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
