"""What closing the loop found."""

import json
import os
from dataclasses import dataclass
from html import escape
from typing import Any, Literal

import numpy
from numpy.typing import NDArray

from ._residyn import Model, Outcome


@dataclass(frozen=True)
class EffectParameter:
    """A parameter of an effect.

    Attributes:
        name: its name in the equations.
        value: in `unit`.
        ci95: 95 % interval, lower end first; None if the parameter was held.
        unit: SI; empty for a pure number.
    """

    name: str
    value: float
    ci95: tuple[float, float] | None
    unit: str

    def __str__(self) -> str:
        interval = "" if self.ci95 is None else f" ({self.ci95[0]:.4g} to {self.ci95[1]:.4g})"
        return f"{self.name} = {self.value:.4g}{interval} {self.unit}".rstrip()


@dataclass(frozen=True)
class Effect:
    """A physical effect that the declared model lacks.

    Attributes:
        name: as `residyn.names("effects")` has it.
        joint: counted from 1.
        expression: the effect's formula.
        parameters: with values and intervals.
        p_value: how likely the logs are without the effect.
        error_reduction: share of the error that this effect alone removes; None if the fit without it failed.
    """

    name: str
    joint: int
    expression: str
    parameters: tuple[EffectParameter, ...]
    p_value: float
    error_reduction: float | None

    def __str__(self) -> str:
        return f"{self.name} on joint {self.joint}: " + ", ".join(map(str, self.parameters))


@dataclass(frozen=True)
class TorqueErrors:
    """How far the torques that a model needs for the logged motion are from the logged ones, over all test logs.

    Attributes:
        rms: root mean square of the difference in N m (or N), shape (joints,).
        relative: norm of all differences over the norm of all logged torques.
    """

    rms: NDArray[numpy.float64]
    relative: float


@dataclass(frozen=True)
class Errors:
    """How far a model is from the test logs: see "Prediction error" in docs/method.md.

    A row of an array is a horizon of `Report.horizons_s`, a column a joint.

    Attributes:
        position_rmse: root mean square over all rows of all windows in rad (or m), shape (horizons, joints).
        position_median: median over the windows of a window's own root mean square in rad (or m), shape (horizons, joints).
        velocity_rmse: as position_rmse, in rad/s (or m/s).
        windows: windows scored, shape (horizons,).
        diverged: windows in which the model diverged, which count, shape (horizons,).
        torque: errors of the torques; None for models that give accelerations, and for `hybrid`.
    """

    position_rmse: NDArray[numpy.float64]
    position_median: NDArray[numpy.float64]
    velocity_rmse: NDArray[numpy.float64]
    windows: NDArray[numpy.int64]
    diverged: NDArray[numpy.int64]
    torque: TorqueErrors | None


class Report:
    """What closing the loop found; in a notebook, the page for a browser."""

    # The values are those of report.json and nothing else: one description (docs/report.schema.json) of the file and of what
    # Python sees, so that neither can have what the other lacks.

    def __init__(self, outcome: Outcome) -> None:
        self._outcome = outcome
        self._found: dict[str, Any] = json.loads(outcome.json())

    @property
    def verdict(self) -> Literal["explained", "partly_explained", "unexplained", "no_missing_effect", "inconclusive"]:
        """The answer in a word.

        "explained": effects were found and nothing significant is left. "partly_explained": effects were found, and something
        significant is left. "unexplained": a significant residual, and no effect that can be named. "no_missing_effect": the
        declared model is enough for these logs. "inconclusive": too little or too poor data; `reason` says why.
        """
        verdict: Literal["explained", "partly_explained", "unexplained", "no_missing_effect", "inconclusive"]
        verdict = self._found["verdict"]
        return verdict

    @property
    def headline(self) -> str:
        """The answer in a sentence."""
        return str(self._found["headline"])

    @property
    def reason(self) -> str:
        """Why, in a sentence."""
        return str(self._found["reason"])

    @property
    def effects(self) -> list[Effect]:
        """What the model lacks: the effects that are established."""
        return [_effect(entry) for entry in self._found["effects"]]

    @property
    def supported(self) -> list[Effect]:
        """Effects that lower the error without being established: do not rely on their names."""
        return [_effect(entry) for entry in self._found["supported"]]

    @property
    def horizons_s(self) -> NDArray[numpy.float64]:
        """How far ahead the errors are, in s, shape (horizons,)."""
        return numpy.array(self._found["error"]["horizons_s"])

    @property
    def declared(self) -> Errors:
        """Errors on the test logs of the declared model with the values in its file."""
        return self._errors("declared", "as_declared")

    @property
    def before(self) -> Errors:
        """Errors on the test logs of the declared model, fitted to the training logs."""
        return self._errors("before", "before")

    @property
    def with_friction(self) -> Errors | None:
        """As `before`, with viscous and Coulomb friction on every joint, fitted; None if the model has both."""
        return self._errors_where_there("with_friction", "with_friction")

    @property
    def after(self) -> Errors:
        """Errors on the test logs of the declared model with the effects that were found, refitted."""
        return self._errors("after", "after")

    @property
    def hybrid(self) -> Errors | None:
        """As `after`, with a network trained on what is left; None if none was trained."""
        return self._errors_where_there("hybrid", "hybrid")

    @property
    def reduction_ci95(self) -> tuple[float, float] | None:
        """95 % interval of the relative reduction of the position error, before to after; None for too few logs."""
        found = self._found["error"]["reduction_ci95"]
        return None if found is None else (found[0], found[1])

    @property
    def model(self) -> Model:
        """The declared model with the effects that were found, refitted."""
        return self._outcome.model()

    def to_dict(self) -> dict[str, Any]:
        """All of report.json, as docs/report.schema.json describes it."""
        return dict(self._found)

    def write(self, folder: str | os.PathLike[str]) -> None:
        """Write report.html, report.md, report.json, model.toml, plots and the network into a folder.

        Args:
            folder: created if it is missing.

        Raises:
            ResidynError: a folder that cannot be written.
        """
        self._outcome.write(folder)

    def html(self) -> str:
        """The report as a self-contained page for a browser."""
        return self._outcome.html()

    def markdown(self) -> str:
        """The report as Markdown; its pictures are files of `write`."""
        return self._outcome.markdown()

    def _errors_where_there(self, model: str, torque: str) -> Errors | None:
        return None if self._found["error"][model] is None else self._errors(model, torque)

    def _errors(self, model: str, torque: str) -> Errors:
        found = self._found["error"][model]
        torques = (self._found["torque"] or {}).get(torque)
        return Errors(
            position_rmse=numpy.array(found["position_rmse"]),
            position_median=numpy.array(found["position_median"]),
            velocity_rmse=numpy.array(found["velocity_rmse"]),
            windows=numpy.array(found["windows"]),
            diverged=numpy.array(found["diverged"]),
            torque=None if torques is None else TorqueErrors(numpy.array(torques["rms"]), torques["relative"]),
        )

    def _repr_html_(self) -> str:
        # In a frame of its own: the page's styles and scripts stay with it.
        style = "width: 100%; height: 40em; border: 1px solid #8888"
        return f'<iframe title="{escape(self.headline)}" style="{style}" srcdoc="{escape(self.html())}"></iframe>'

    def __str__(self) -> str:
        return "\n".join([f"{self.headline}: {self.reason}", *(f"  {effect}" for effect in self.effects)])

    def __repr__(self) -> str:
        return f"<residyn.Report {self.verdict}: {self.headline}>"


def _effect(entry: dict[str, Any]) -> Effect:
    parameters = (
        EffectParameter(
            name=parameter["name"],
            value=parameter["value"],
            ci95=None if parameter["ci95"] is None else (parameter["ci95"][0], parameter["ci95"][1]),
            unit=parameter["unit"],
        )
        for parameter in entry["parameters"]
    )
    return Effect(
        name=entry["name"],
        joint=entry["joint"],
        expression=entry["expression"],
        parameters=tuple(parameters),
        p_value=entry["p_value"],
        error_reduction=entry["error_reduction"],
    )
