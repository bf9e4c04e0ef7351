"""Shards on a Dask cluster end with the results of one machine, also where a worker is killed."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import residyn
from conftest import command
from dask.distributed import LocalCluster
from residyn.shards import run_shard

ROOT = Path(__file__).parents[2]
SMALL = ROOT / "configs" / "smoke" / "physics-prior-pendulum.toml"


@pytest.fixture
def experiment(tmp_path: Path) -> list[str]:
    """The small experiment, with enough work for a worker to be killed in the middle."""
    config = tmp_path / "experiment.toml"
    text = SMALL.read_text()
    for few, more in [("rounds = 4", "rounds = 30"), ("rounds = 3\n", "rounds = 30\n"), ("epochs = 300", "epochs = 3000")]:
        assert few in text
        text = text.replace(few, more)
    config.write_text(text)
    return ["experiment", "physics-prior", "--config", str(config)]


def files(folder: Path) -> dict[str, bytes]:
    """What is in a folder, but for what says when and for how long it was computed."""
    paths = [path for path in folder.rglob("*") if path.is_file() and not path.name.startswith(".")]
    found = {str(path.relative_to(folder)): path.read_bytes() for path in paths}
    del found["report.html"]
    results = json.loads(found["results.json"])
    del results["wall_s"], results["command"]
    return {**found, "results.json": json.dumps(results).encode()}


def owner(lock: Path) -> str:
    """The process that works in a folder, by its lock."""
    try:
        return lock.read_text()
    except FileNotFoundError:
        return ""


def test_a_worker_is_killed_and_the_results_are_those_of_one_machine(tmp_path: Path, experiment: list[str]) -> None:
    out, whole = tmp_path / "out", tmp_path / "whole"
    example = [sys.executable, ROOT / "python" / "examples" / "dask_shards.py", "4", out, *experiment]
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        scheduler = {**os.environ, "DASK_SCHEDULER_ADDRESS": cluster.scheduler_address}
        dask = subprocess.Popen(example, env=scheduler, stderr=subprocess.PIPE, text=True)
        shards = [tmp_path / f"out.parts/{k}/runs" for k in (1, 2)]
        while not all(list(shard.glob("*/rounds.jsonl")) for shard in shards):
            assert dask.poll() is None, dask.communicate()
            time.sleep(0.01)
        working = {lock: owner(lock) for lock in tmp_path.glob("out.parts/.*.lock")}
        assert len(working) == 2
        os.kill(cluster.workers[0].pid, signal.SIGKILL)
        while all(owner(lock) in ("", process) for lock, process in working.items()):
            assert dask.poll() is None, "no shard was begun again"
            time.sleep(0.01)
        assert dask.wait() == 0, dask.communicate()
    assert command(*experiment, "--out", whole).returncode == 0
    assert files(out) == files(whole)


def test_what_cannot_be_done_is_raised(tmp_path: Path) -> None:
    with pytest.raises(residyn.ResidynError, match="K is 3 and N is 2"):
        run_shard(["bench", "effects"], tmp_path / "out", 3, 2)


def test_a_build_is_known_by_the_file_of_the_module(tmp_path: Path) -> None:
    words = ["residyn", "bench", "effects", "--shard", "1/2", "--out", str(tmp_path / "out")]
    code = f"from residyn import _residyn; _residyn.main('/no/such/module', {words})"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=ROOT).stderr
    assert "the program cannot read itself" in said
