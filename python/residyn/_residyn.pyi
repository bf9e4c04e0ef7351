import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, final

import numpy
from numpy.typing import ArrayLike, NDArray

from .results import Bounds, Prediction, Step, Torques

_Array = NDArray[numpy.float64]
_Path = str | os.PathLike[str]

__version__: str

__all__ = [
    "Episode",
    "Library",
    "Log",
    "Model",
    "Monitor",
    "Outcome",
    "Parameter",
    "ResidynError",
    "Rig",
    "__version__",
    "close_loop",
    "control",
    "main",
    "names",
    "read_log",
    "simulate",
    "stages",
    "train",
    "tune",
]

class ResidynError(ValueError):
    """An operation that cannot be done: what is wrong, where (file, line, column), and what to do about it.

    If a file is missing or may not be opened, it is also a FileNotFoundError or a PermissionError with its `filename`.
    """

@final
class Library:
    """The effects that a model may lack: `Library()` has the built-in ones.

    A library does not change: `with_folder` and `with_effect` return a new one. `name in library` says whether it has an
    effect, `len(library)` how many it has.
    """

    def __new__(cls) -> Library: ...
    def with_folder(self, path: _Path) -> Library:
        """The library with the effect files of a folder (`*.toml`) as well.

        Args:
            path: the folder. An effect of a known name replaces the known one.

        Returns:
            The larger library.

        Raises:
            ResidynError: a folder that cannot be read, or a file that is not an effect, with line, column and remedy.
        """
    def with_effect(self, text: str) -> Library:
        """The library with one more effect.

        Args:
            text: what an effect file holds. An effect of a known name replaces the known one.

        Returns:
            The larger library.

        Raises:
            ResidynError: a text that is not an effect, with line, column and remedy.
        """
    @property
    def effects(self) -> list[str]:
        """Names of the effects, in alphabetical order."""
    def model(self, path: _Path) -> Model:
        """As `Model.read` with this library.

        Args:
            path: a file, or one of `residyn.names("systems")`.

        Returns:
            The model.

        Raises:
            ResidynError: with file, line and column, what is wrong and what to do.
        """
    def __len__(self) -> int: ...
    def __contains__(self, name: str, /) -> bool: ...

@final
class Log:
    """One trajectory of a rig: what was recorded between switching it on and off.

    Row i's torque, or command, acts from time[i] to time[i + 1]. `log["q1"]` is a column, `len(log)` the number of rows.

    Args:
        time: s, shape (rows,), strictly increasing; irregular sampling is fine.
        q: joint angles in rad (m for sliding joints), shape (rows, joints), or (rows,) for one joint.
        qd: joint velocities in rad/s, of the same shape; without them they are computed from the angles.
        tau: joint torques in N m (N), of the same shape; without torques and commands, the rig is passive.
        cmd: commands of the drives instead of torques: targets of servos, volts, amperes.
        name: what messages and reports call the log.

    Raises:
        ResidynError: arrays of different lengths, numbers that are not finite, or time that does not increase.
    """

    def __new__(
        cls,
        *,
        time: ArrayLike,
        q: ArrayLike,
        qd: ArrayLike | None = None,
        tau: ArrayLike | None = None,
        cmd: ArrayLike | None = None,
        name: str = "log",
    ) -> Log: ...
    @staticmethod
    def from_dataframe(frame: Any, *, model: Model | None = None, name: str = "log") -> Log:
        """A log from a pandas or polars data frame, or from anything else that has `columns` and returns one by name.

        Args:
            frame: with the columns of a log file: time, q1, ..., and qd1, ..., tau1, ... or cmd1, ...; or those that a
                model's `[columns]` name. Others are ignored.
            model: that of the rig; without it, the columns have the standard names and units.
            name: what messages and reports call the log.

        Returns:
            The log.

        Raises:
            ResidynError: a column that is missing, numbers that are missing or not finite, or time that does not increase.
        """
    def to_pandas(self) -> Any:
        """The log as a pandas data frame.

        Returns:
            A pandas.DataFrame with the columns `columns`.

        Raises:
            ImportError: pandas is not installed.
        """
    def to_polars(self) -> Any:
        """The log as a polars data frame.

        Returns:
            A polars.DataFrame with the columns `columns`.

        Raises:
            ImportError: polars is not installed.
        """
    @property
    def columns(self) -> list[str]:
        """Names of the columns: time, q1, ..., qd1, ..., and tau1, ... or cmd1, ..."""
    def __getitem__(self, name: str, /) -> _Array: ...
    @property
    def time(self) -> _Array:
        """Time of each row in s, shape (rows,)."""
    @property
    def q(self) -> _Array:
        """Joint angles in rad (or m), shape (rows, joints)."""
    @property
    def qd(self) -> _Array:
        """Joint velocities in rad/s (or m/s), shape (rows, joints)."""
    @property
    def tau(self) -> _Array | None:
        """Joint torques in N m (or N), shape (rows, joints); None for a log of commands."""
    @property
    def cmd(self) -> _Array | None:
        """Commands of the drives, shape (rows, joints); None for a log of torques."""
    @property
    def joints(self) -> int:
        """The number of joints."""
    @property
    def name(self) -> str:
        """What messages and reports call the log: for a file, its name."""
    @property
    def notes(self) -> list[str]:
        """What a reader of the log should know about how it was read, one sentence each."""
    def leave_out(self, start_s: float, end_s: float) -> Log:
        """The same log without the interval from start_s to end_s, which is neither fitted nor scored.

        Args:
            start_s: start of the interval in s, in the log's own time.
            end_s: end of the interval in s.

        Returns:
            The log; `q` and the other arrays still have all rows.

        Raises:
            ResidynError: an end that does not come after the start.
        """
    def audit(self, model: Model | None = None) -> dict[str, Any]:
        """What the log is good for: sampling, noise, lags, and a list of `findings`, the most serious first.

        Args:
            model: its `[columns]` say what the columns of the file hold.

        Returns:
            As `residyn audit --json` prints it; a finding has a `severity` ("serious", "warning" or "info") and a `text`.
        """
    def write(self, path: _Path) -> None:
        """Write the log as CSV with the columns time, q1, ..., qd1, ..., tau1, ... or cmd1, ...

        Args:
            path: the file; an existing one is replaced.

        Raises:
            ResidynError: a folder that cannot be written.
        """
    def __len__(self) -> int: ...

@final
class Parameter:
    """A physical parameter of a model, or of one of its effects."""

    @property
    def name(self) -> str:
        """Its name in the equations."""
    @property
    def value(self) -> float:
        """In `unit`."""
    @property
    def unit(self) -> str:
        """SI; empty for a pure number."""
    @property
    def ci95(self) -> tuple[float, float] | None:
        """95 % interval, lower end first, once a fit has found one."""
    @property
    def fixed(self) -> bool:
        """Held at this value in every fit."""

@final
class Model:
    """A dynamics model: equations with parameters, and the effects that were found."""

    @staticmethod
    def read(path: _Path, *, effects: Library | Sequence[_Path] = ...) -> Model:
        """A model file, or a built-in system by its name.

        Args:
            path: a file, or one of `residyn.names("systems")`.
            effects: a `Library`, or folders of your own effect files in addition to the built-in ones; `close_loop`
                then considers them.

        Returns:
            The model.

        Raises:
            ResidynError: with file, line and column, what is wrong and what to do.
        """
    @staticmethod
    def from_text(text: str, *, name: str = "model.toml", effects: Library | Sequence[_Path] = ...) -> Model:
        """The model in the text of a model file.

        Args:
            text: what the file would hold.
            name: what messages call the text.
            effects: as for `read`.

        Returns:
            The model.

        Raises:
            ResidynError: with line and column, what is wrong and what to do.
        """
    @staticmethod
    def from_urdf(
        path: _Path, *, tip: str | None = None, drive: str | None = None, effects: Library | Sequence[_Path] = ...
    ) -> Model:
        """The serial chain of a URDF: every link's inertia is a parameter, declared with its value in the file.

        Args:
            path: the file.
            tip: the last link; without it, the end of the longest branch.
            drive: what drives the joints, if logs hold commands: one of `residyn.names("drives")`.
            effects: as for `read`.

        Returns:
            The model, whose parameters are the masses, centres and inertias of the links.

        Raises:
            ResidynError: a file that cannot be read or holds no serial chain, or an unknown drive.

        Warns:
            UserWarning: about what is read differently or not at all.
        """
    @staticmethod
    def from_mjcf(
        path: _Path, *, tip: str | None = None, drive: str | None = None, effects: Library | Sequence[_Path] = ...
    ) -> Model:
        """The serial chain of a MuJoCo MJCF file: every link's inertia is a parameter; position actuators are adopted.

        Args:
            path: the file.
            tip: the last body; without it, the end of the longest branch.
            drive: what drives the joints, if logs hold commands: one of `residyn.names("drives")`.
            effects: as for `read`.

        Returns:
            The model.

        Raises:
            ResidynError: a file that cannot be read or holds no serial chain, or an unknown drive.

        Warns:
            UserWarning: about what is read differently or not at all.
        """
    @property
    def name(self) -> str:
        """The name of the system."""
    @property
    def joints(self) -> int:
        """The number of joints."""
    @property
    def joint_names(self) -> list[str]:
        """Names of the joints in a URDF or on the rig; empty if they only have numbers."""
    @property
    def parameters(self) -> list[Parameter]:
        """All parameters, those of effects after those of the equations."""
    @property
    def effects(self) -> list[str]:
        """The effects in the model, for people: "coulomb_friction on joint 1"."""
    @property
    def library(self) -> Library:
        """The effects that it may lack, which `close_loop` considers."""
    @property
    def text(self) -> str:
        """The text of the model file."""
    def latex(self) -> list[str]:
        """The declared equations in LaTeX.

        Returns:
            One text per equation; for a chain of bodies, their form.
        """
    def write(self, path: _Path) -> None:
        """Write the model file.

        Args:
            path: the file; an existing one is replaced.

        Raises:
            ResidynError: a folder that cannot be written.
        """
    def read_log(self, path: _Path) -> Log:
        """Read a log of this rig in any supported format, by the model's `[columns]`.

        Args:
            path: the file, or the folder of a LeRobot data set.

        Returns:
            The log.

        Raises:
            ResidynError: with file, line and column, what is wrong and what to do.
        """
    def predict(self, log: Log, horizon_s: float = 1.0) -> list[Prediction]:
        """Predictions of a log, open loop: over consecutive windows of `horizon_s`, the motion from the logged state at the
        start of each, under the logged torques.

        Args:
            log: of a rig with the same number of joints.
            horizon_s: length of a window in s.

        Returns:
            A `Prediction` per window: `time` in s, shape (rows,), and `q`, joint angles in rad (or m),
            shape (rows, joints).

        Raises:
            ResidynError: a log of another rig, or a horizon that is not above zero.
        """
    def torques(self, log: Log) -> Torques:
        """The torques that the logged motion needs according to the model, and the logged ones, both low-passed.

        Args:
            log: of a rig with the same number of joints.

        Returns:
            `Torques`: `time` in s, shape (rows,); `logged` and `needed` in N m (or N), shape (rows, joints).

        Raises:
            ResidynError: a model that gives accelerations, or a log of another rig.
        """
    def evaluate(
        self, logs: Sequence[Log], horizons_s: Sequence[float] = ..., *, torque: bool = False
    ) -> dict[str, Any]:
        """Prediction errors on logs, as `residyn evaluate --json` prints them.

        Args:
            logs: to predict.
            horizons_s: how far ahead, in s.
            torque: compare the torques that the motion needs with the logged ones as well.

        Returns:
            `horizons_s`, and for each horizon, one number per joint: `position_rmse` and `position_median` in rad (or
            m), `velocity_rmse` in rad/s (or m/s); `windows`, `diverged`. With `torque`, `torque`: `rms` of each joint
            in N m (or N) and `relative`.

        Raises:
            ResidynError: logs that are shorter than a horizon.
        """
    def rollout(self, state: ArrayLike, tau: ArrayLike, step_s: float, integrator: str = "rk4") -> _Array:
        """Integrate the model from a state, holding each torque (or command) for `step_s`.

        Args:
            state: positions, then velocities, shape (2 joints,).
            tau: shape (steps, joints), or (steps,) for one joint.
            step_s: how long each torque is held, in s.
            integrator: "rk4", "semi_implicit_euler" or "fine:N" for N substeps.

        Returns:
            The states, the first one included, shape (steps + 1, 2 joints).

        Raises:
            ResidynError: a state or torques of another shape, an integrator that is unknown, or a step that is not above zero.
        """
    def export(self, format: str, path: _Path, *, step_s: float = 0.01, integrator: str = "rk4") -> list[str]:
        """Write the model for other programs.

        Args:
            format: one of `residyn.names("formats")`: "c", "onnx", "fmi3" ...
            path: the file to write; formats with several files put the others next to it.
            step_s: how long a torque is held, in s.
            integrator: "rk4", "semi_implicit_euler" or "fine:N" for N substeps.

        Returns:
            What of the model the format cannot represent, one sentence each.

        Raises:
            ResidynError: a format that is unknown or cannot carry the model, or a folder that cannot be written.
        """

@final
class Outcome:
    """Everything that closing the loop found out; `residyn.Report` shows it."""

    def json(self) -> str:
        """The report as values.

        Returns:
            The text of report.json.
        """
    def html(self) -> str:
        """The report as a self-contained page for a browser.

        Returns:
            HTML.
        """
    def markdown(self) -> str:
        """The report as Markdown; its pictures are files of `write`.

        Returns:
            Markdown.
        """
    def model(self) -> Model:
        """The declared model with the effects that were found, refitted.

        Returns:
            A model with the library of the declared one.
        """
    def write(self, folder: _Path) -> None:
        """Write report.html, report.md, report.json, model.toml, plots and the network into a folder.

        Args:
            folder: created if it is missing.

        Raises:
            ResidynError: a folder that cannot be written.
        """

@final
class Episode:
    """An episode of a plant under control."""

    @property
    def log(self) -> Log:
        """What the sensors said and what was commanded: one row per step, and one for the end."""
    @property
    def rewards(self) -> _Array:
        """The reward of each step, shape (steps,)."""
    @property
    def total(self) -> float:
        """The sum of the rewards."""
    @property
    def success(self) -> bool:
        """Whether the goal of the task held to the end."""

@final
class Monitor:
    """A watch on a running machine: its rows go in as they come, alarms come out.

    Args:
        model: fitted to the machine when it was well.
        false_alarms_per_hour: over everything that is watched.
        healthy_s: length of the first stretch, in which the machine is well, in s.
        block_s: length of the blocks whose scores are taken as one draw, in s.
        smoothing_s: half the width of the window over which forces are averaged, in s; by default 120 ms, or fifteen steps of
            slower logs.
        payload_at: where a load at the tip is expected in the frame of the last body, in m; by default its centre of mass.

    Raises:
        ResidynError: settings out of their range, or a model that cannot be watched.
    """

    def __new__(
        cls,
        model: Model,
        *,
        false_alarms_per_hour: float = 0.1,
        healthy_s: float = 300.0,
        block_s: float = 1.0,
        smoothing_s: float | None = None,
        payload_at: tuple[float, float, float] | None = None,
    ) -> Monitor: ...
    def update(self, rows: Log | dict[str, ArrayLike]) -> list[dict[str, Any]]:
        """Take the next rows.

        Args:
            rows: a `Log`, or a dictionary of arrays: `time`, shape (rows,), `q` and `tau` or `cmd`, shape (rows, joints), and
                the model's further measured columns by their names, shape (rows,).

        Returns:
            The alarms that they raise, each a dictionary with `time_s`, `since_s`, `kind`, `joint`, `name`, `estimate`, `or`,
            `is_further` and `message`.

        Raises:
            ResidynError: rows out of order, numbers that are not finite, or columns that are missing.
        """
    def summary(self) -> dict[str, Any]:
        """What was seen so far, and how small a change would have been seen within an hour.

        Returns:
            A dictionary with `rows`, `watched_s`, `is_calibrated`, `gaps`, `jumps`, `repeated_rows`, `alarms`, `followed`,
            `disturbances` and `limits`.
        """

@final
class Rig:
    """A simulated rig with a task, step by step: `residyn.environment.Environment` makes a Gymnasium environment of it.

    Args:
        plant: a plant or model file, or a built-in plant or system by its name.
        task: a task file, or a built-in task; by default a built-in one of the plant's system.

    Raises:
        ResidynError: files that cannot be read, or a task of another system.
    """

    def __new__(cls, plant: _Path, task: _Path | None = None) -> Rig: ...
    @property
    def joints(self) -> int:
        """The number of joints."""
    @property
    def action_bounds(self) -> Bounds:
        """What may be commanded: `Bounds` with the `low` and `high` torque (N m or N) or command of each joint, each of the
        shape (joints,).
        """
    @property
    def step_s(self) -> float:
        """How long a torque is held, in s."""
    @property
    def episode_steps(self) -> int:
        """How many steps an episode of the task has."""
    def reset(self, seed: int | None = None) -> _Array:
        """Begin an episode, from a start state that is drawn from the task's.

        Args:
            seed: with one, everything random from here on is drawn anew from it.

        Returns:
            The measured state: positions, then velocities, shape (2 joints,).
        """
    def step(self, tau: ArrayLike) -> Step:
        """Hold a torque (or command) for a step.

        Args:
            tau: torque of each joint in N m (or N), shape (joints,).

        Returns:
            `Step`: the measured `state`, shape (2 joints,), and the `reward` of the step by the task.

        Raises:
            ResidynError: before `reset`, a torque of another size, or a plant that diverges.
        """

def read_log(path: _Path) -> Log:
    """Read a log in any supported format, with the standard columns and as many joints as it has.

    If columns have other names or units, the model says so: `Model.read_log`.

    Args:
        path: the file.

    Returns:
        The log.

    Raises:
        ResidynError: with file, line and column, what is wrong and what to do.
    """
def simulate(
    plant: _Path,
    *,
    effects: Mapping[str, float | Mapping[str, float]] = ...,
    seed: int = 0,
    duration_s: float | None = None,
    name: _Path | None = None,
    library: Library | None = None,
) -> Log:
    """The log of a simulated rig.

    Args:
        plant: a plant or model file, or a built-in plant or system by its name.
        effects: what its model does not declare: the value of an effect's first parameter, or of several by their names;
            "coulomb_friction@2" is on joint 2.
        seed: for excitation and noise; the same seed gives the same log.
        duration_s: instead of the plant's own.
        name: what messages and reports call the log; by default the plant's name and the seed.
        library: the effects to choose from; by default the built-in ones.

    Returns:
        The readings of the rig's sensors, and its torques or commands.

    Raises:
        ResidynError: a plant or effect that is unknown, or a rig that diverges.
    """
def control(
    model: Model | _Path, plant: _Path, task: _Path | None = None, *, episodes: int = 1, seed: int = 0
) -> list[Episode]:
    """Control a simulated plant by model-predictive control with a receding horizon.

    Args:
        model: what to plan with: a model, or the folder of a trained model's checkpoint.
        plant: a plant or model file, or a built-in plant or system by its name.
        task: a task file, or a built-in task; by default a built-in one of the plant's system.
        episodes: how many.
        seed: for starts, noise and plans; the same seed gives the same episodes.

    Returns:
        The episodes.

    Raises:
        ResidynError: files that cannot be read, a model of another system, or a plant that diverges.
    """
def train(
    config: _Path | dict[str, Any],
    out: _Path,
    *,
    seed: int = 0,
    progress: Callable[[int, int, float], object] | None = None,
) -> dict[str, Any]:
    """Train a hybrid, physics-only or data-driven model from scratch, on logs or on a simulated plant.

    The same call resumes an interrupted run, and ends with the same numbers.

    Args:
        config: the training recipe: a file, or a dictionary with the keys of one, where paths are relative to the working
            directory.
        out: the folder of the checkpoint.
        seed: of everything random; the same seed gives the same result on the same machine.
        progress: called after each epoch with the number of epochs done, their total, and the loss.

    Returns:
        Errors and parameters before and after, as `residyn train --json` prints them.

    Raises:
        ResidynError: a recipe, model, plant or log that cannot be read, a folder with another run, or a loss that is no longer
            finite.
    """
def tune(
    checkpoint: _Path,
    out: _Path,
    *,
    config: _Path | dict[str, Any] | None = None,
    logs: Sequence[_Path] = ...,
    seed: int = 0,
    progress: Callable[[int, int, float], object] | None = None,
) -> dict[str, Any]:
    """Fine-tune a trained model on new data.

    Args:
        checkpoint: the folder of the trained model.
        out: the folder of the new checkpoint.
        config: a recipe, a file or a dictionary as for `train`; or
        logs: log files, for a recipe that suits most cases.
        seed: of everything random.
        progress: called after each epoch with the number of epochs done, their total, and the loss.

    Returns:
        Errors and parameters before and after, as `train` returns them.

    Raises:
        ResidynError: as `train`, and a checkpoint of another system.
    """
def names(of: str) -> list[str]:
    """Names of what is built in.

    Args:
        of: "systems", "plants", "tasks", "effects", "drives" or "formats".

    Returns:
        The names.

    Raises:
        ResidynError: an unknown kind.
    """
def stages() -> list[str]:
    """The stages of closing the loop.

    Returns:
        Their names in order, as `progress` receives them.
    """
def main(file: _Path, arguments: Sequence[str]) -> int:
    """Run the command line.

    Args:
        file: the file of this module.
        arguments: the words, the name of the program first.

    Returns:
        The exit status.
    """
def close_loop(
    model: Model,
    train: Sequence[Log],
    test: Sequence[Log],
    against: Sequence[tuple[str, Model]],
    seed: int,
    budget_s: float,
    errors: str | None,
    network: bool,
    progress: Callable[[str, str, int | None, int | None], object] | None,
) -> Outcome:
    """See `residyn.close_loop`, which has the same arguments."""
