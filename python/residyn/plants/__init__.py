"""Plants in a process of their own: a rig or a simulator that Residyn drives over lines of JSON (docs/plants.md).

    from residyn.plants import Limits, Plant, Row, serve

    class Motor(Plant):
        name = "motor on the bench"
        joints = ["shaft"]
        step_s = 0.01
        clock = "wall"
        limits = Limits(command=[(-0.2, 0.2)], speed=[40.0])

        def reset(self, seed, start):
            return self.step([0.0])

        def step(self, command):
            angle, speed = board.exchange(command[0])
            return Row(q=[angle], qd=[speed])

        def stop(self):
            board.switch_off()

    serve(Motor())

Needs NumPy alone; `residyn.plants.gymnasium` and `residyn.plants.mujoco` need `pip install residyn[plants]`.
"""

from .limits import Limits
from .plant import Plant, PlantError, Row
from .serve import serve

__all__ = ["Limits", "Plant", "PlantError", "Row", "serve"]
