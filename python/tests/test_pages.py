"""The Python of the pages for readers does what it says."""

import re
from pathlib import Path

import pytest
import residyn

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("page", ["README.md", "docs/python.md", "python/README.md"])
def test_the_code_of_a_page_runs(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, logs: list[residyn.Log]
) -> None:
    monkeypatch.chdir(tmp_path)
    for number, log in enumerate(logs, start=1):
        log.write(f"run{number}.csv")
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)
    assert blocks
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, page, "exec"), names)
    assert isinstance(names["report"], residyn.Report) and (tmp_path / "pendulum.h").is_file()
