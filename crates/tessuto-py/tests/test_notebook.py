"""The notebook runs, and shows what it says."""

from __future__ import annotations

import os
import sysconfig
from pathlib import Path

import pytest

nbclient = pytest.importorskip("nbclient", reason="NOT TESTED: nbclient is not installed")
import nbformat  # noqa: E402

NOTEBOOK = Path(__file__).parents[1] / "examples/quickstart.ipynb"


@pytest.mark.filterwarnings("default")
def test_the_notebook_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", os.pathsep.join([sysconfig.get_path("scripts"), os.environ["PATH"]]))
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    assert all(not cell.get("outputs") for cell in notebook.cells), "commit it without outputs"
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    shown = [output["data"] for output in outputs if "data" in output]
    assert any("<iframe" in data.get("text/html", "") for data in shown)
    assert any("<tessuto.Scene" in data["text/plain"] for data in shown)
    said = "".join(output.get("text", "") for output in outputs)
    assert "found to" in said and "effective stiffness" in said and "(4, 96, 96, 3)" in said
