import json
import time
import tomllib
from pathlib import Path

import pytest
import residyn
from conftest import command

SMOKE = Path(__file__).parents[2] / "configs" / "smoke"


def test_a_training_is_that_of_the_command(tmp_path: Path) -> None:
    told: list[tuple[int, int, float]] = []
    recipe = SMOKE / "train-pendulum.toml"
    found = residyn.train(recipe, tmp_path / "ours", seed=3, progress=lambda *at: told.append(at))
    printed = command("train", "--config", recipe, "--out", tmp_path / "theirs", "--seed", "3", "--json")
    wanted = json.loads(printed.stdout)
    assert {**found, "checkpoint": None} == {**wanted, "checkpoint": None}
    assert [epoch for epoch, _, _ in told] == list(range(1, found["epochs"] + 1))
    assert told[-1][2] < told[0][2]


def test_a_dictionary_is_a_recipe(tmp_path: Path) -> None:
    recipe = tomllib.loads((SMOKE / "train-pendulum.toml").read_text())
    recipe["fit"]["epochs"] = 20
    (tmp_path / "recipe.toml").write_text(
        (SMOKE / "train-pendulum.toml").read_text().replace("epochs = 200", "epochs = 20")
    )
    ours = residyn.train(recipe, tmp_path / "ours")
    theirs = residyn.train(tmp_path / "recipe.toml", tmp_path / "theirs")
    assert {**ours, "checkpoint": None} == {**theirs, "checkpoint": None} and ours["epochs"] == 20
    tuned = residyn.tune(tmp_path / "ours", tmp_path / "tuned", config={key: recipe[key] for key in recipe if key != "start"})
    assert tuned["epochs"] == 20
    with pytest.raises(residyn.ResidynError, match="recipe: unknown field `nonsense`"):
        residyn.train({**recipe, "nonsense": 1}, tmp_path / "other")
    with pytest.raises(residyn.ResidynError, match="recipe: missing field"):
        residyn.train({}, tmp_path / "other")


def test_what_is_interrupted_goes_on(tmp_path: Path) -> None:
    def refuse(epoch: int, epochs: int, loss: float) -> None:
        if epoch == 50:
            # A busy machine: the training must not run to its end before it is stopped.
            time.sleep(0.5)
            raise KeyboardInterrupt

    recipe, out = SMOKE / "train-pendulum.toml", tmp_path / "checkpoint"
    with pytest.raises(KeyboardInterrupt):
        residyn.train(recipe, out, progress=refuse)
    told: list[int] = []
    resumed = residyn.train(recipe, out, progress=lambda epoch, *_: told.append(epoch))
    assert 50 <= told[0] - 1 < resumed["epochs"]
    whole = residyn.train(recipe, tmp_path / "whole")
    assert {**resumed, "checkpoint": None} == {**whole, "checkpoint": None}


def test_a_checkpoint_is_tuned(tmp_path: Path) -> None:
    residyn.train(SMOKE / "train-pendulum.toml", tmp_path / "prior")
    found = residyn.tune(tmp_path / "prior", tmp_path / "tuned", config=SMOKE / "tune-pendulum.toml")
    assert found["error"]["after"] < found["error"]["before"]
    with pytest.raises(residyn.ResidynError, match="give either config= or logs="):
        residyn.tune(tmp_path / "prior", tmp_path / "other", config=SMOKE / "tune-pendulum.toml", logs=["run1.csv"])
    with pytest.raises(residyn.ResidynError, match="nothing.toml: cannot be read"):
        residyn.tune(tmp_path / "prior", tmp_path / "other", config=tmp_path / "nothing.toml")
