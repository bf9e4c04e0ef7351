"""What closing the loop found."""

import json
import os
from dataclasses import dataclass
from html import escape
from typing import Any

from ._residyn import Model, Outcome


@dataclass(frozen=True)
class EffectParameter:
    """A parameter of an effect, in its unit, with its 95 % interval (None where it was held)."""

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

    `joint` counts from 1. `error_reduction` is the share of the error that this effect alone takes away, None where the fit
    without it failed.
    """

    name: str
    joint: int
    expression: str
    parameters: tuple[EffectParameter, ...]
    p_value: float
    error_reduction: float | None

    def __str__(self) -> str:
        return f"{self.name} on joint {self.joint}: " + ", ".join(map(str, self.parameters))


class Report:
    """What closing the loop found; in a notebook, the page for a browser."""

    def __init__(self, outcome: Outcome) -> None:
        self._outcome = outcome
        self._found: dict[str, Any] = json.loads(outcome.json())

    @property
    def verdict(self) -> str:
        """explained, partly_explained, unexplained, no_missing_effect or inconclusive."""
        return str(self._found["verdict"])

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
    def errors(self) -> dict[str, Any]:
        """Open-loop prediction errors on the test logs: see `error` in report.json.

        `horizons_s`, and `before`, `after`, `hybrid`, each with `position_rmse` in rad (or m) of each horizon and joint.
        """
        return dict(self._found["error"])

    @property
    def torque(self) -> dict[str, Any] | None:
        """Errors of the torques on the test logs, as_declared, before and after; None for models that give accelerations."""
        found: dict[str, Any] | None = self._found["torque"]
        return found

    @property
    def model(self) -> Model:
        """The declared model with the effects that were found, refitted."""
        return self._outcome.model()

    def to_dict(self) -> dict[str, Any]:
        """All of report.json."""
        return dict(self._found)

    def write(self, folder: str | os.PathLike[str]) -> None:
        """Write report.html, report.md, report.json, model.toml, plots and the network into a folder."""
        self._outcome.write(folder)

    def html(self) -> str:
        """The report as a page for a browser, whole in itself."""
        return self._outcome.html()

    def markdown(self) -> str:
        """The report as Markdown; its pictures are files of `write`."""
        return self._outcome.markdown()

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
