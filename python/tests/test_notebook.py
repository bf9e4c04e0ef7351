"""The notebook does what it says, on the measured logs."""

import os
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOK = Path(__file__).parents[1] / "notebooks" / "pendulum.ipynb"


def test_the_notebook_ends_with_a_header(tmp_path: Path) -> None:
    logs = Path(os.environ.get("RESIDYN_DATA", "none")) / "dfki_simple_pendulum"
    if not logs.is_dir():
        assert "RESIDYN_REQUIRE_DATA" not in os.environ, f"{logs} is missing"
        pytest.skip("RESIDYN_DATA names no folder of measured logs")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": tmp_path}}).execute()
    said = "".join(output.get("text", "") for cell in notebook.cells for output in cell.get("outputs", []))
    assert "coulomb_friction on joint 1" in said and "rad in C" in said
    assert "<iframe" in str(notebook) and (tmp_path / "pendulum.h").is_file()
