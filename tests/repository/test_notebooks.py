"""The notebooks run from top to bottom, and are the pages of the tutorials."""

import pytest

from tests.sources import ROOT

jupytext = pytest.importorskip("jupytext")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")

PAGES = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
NOTEBOOKS = ROOT / "examples" / "notebooks"


def cells(notebook):
    return [(cell.cell_type, cell.source) for cell in notebook.cells]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_notebook_is_the_page(page):
    made = jupytext.read(NOTEBOOKS / f"{page.stem}.ipynb")
    kept = f"examples/notebooks/{page.stem}.ipynb"
    again = f"jupytext --to ipynb --output {kept} {page}"
    assert cells(made) == cells(jupytext.read(page)), f"make it again: {again}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_it_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    notebook = jupytext.read(page)
    client = nbclient.NotebookClient(notebook, timeout=240, kernel_name="python3")
    done = client.execute(cwd=str(tmp_path))
    outputs = [out for cell in done.cells for out in cell.get("outputs", ())]
    assert len(outputs) >= 3
    assert all(out.output_type != "error" for out in outputs)
    if page.stem == "diagnose":
        said = "".join(out.get("text", "") for out in outputs)
        assert "joint_damping[elbow]" in said
    if page.stem == "recover":
        assert any("image/png" in out.get("data", {}) for out in outputs), "no figure"
