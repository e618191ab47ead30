"""The notebooks run from beginning to end, with their figures, and name no folder of a machine.

``UPDATE_NOTEBOOKS=1`` writes what they gave into the notebooks.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from conftest import ROOT

nbformat = pytest.importorskip("nbformat", reason="SKIPPED: nbformat is not installed")
nbclient = pytest.importorskip("nbclient", reason="SKIPPED: nbclient is not installed")

FOLDER = ROOT / "crates" / "python" / "notebooks"


@pytest.mark.parametrize("name", ["own-powder", "own-simulator"])
def test_a_notebook_runs_and_shows_its_figures(name: str, tmp_path: Path) -> None:
    path = FOLDER / f"{name}.ipynb"
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 2
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        if cell.cell_type == "code":
            # Bars of progress are not what is shown.
            cell.outputs = [output for output in cell.outputs if not output.get("data", {}).keys() & {"application/vnd.jupyter.widget-view+json"} and output.get("name") != "stderr"]
    text = nbformat.writes(notebook)
    for place in (str(tmp_path), str(Path.home()), str(ROOT), "/tmp/", "calibrate-dem"):
        assert place not in text, place
    if os.environ.get("UPDATE_NOTEBOOKS"):
        notebook.metadata.pop("widgets", None)
        notebook.metadata["language_info"] = {"name": "python"}
        nbformat.write(notebook, path)
        return
    # What is committed has figures too, and the words that come out now.
    committed = nbformat.read(path, as_version=4)
    for now, then in zip(notebook.cells, committed.cells, strict=True):
        if now.cell_type == "code":
            words = [[output.get("text") or output.get("data", {}).get("text/plain") for output in cell.outputs] for cell in (now, then)]
            assert words[0] == words[1], f"{name}: run UPDATE_NOTEBOOKS=1 crates/python/test.sh -k notebook\n{now.source}"
            assert ["image/png" in o.get("data", {}) for o in now.outputs] == ["image/png" in o.get("data", {}) for o in then.outputs]
