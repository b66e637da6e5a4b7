"""The documentation is true: its links lead somewhere, its Python runs.

So do the examples, and the notebooks, which are the pages of the tutorials.
"""

import re
from pathlib import Path

import pytest

from tests.sources import ROOT

LEFT_OUT = {".venv", ".git", "build", "dist", "runs", "node_modules"}
PAGES = sorted(
    p for p in ROOT.rglob("*.md") if not LEFT_OUT & set(p.relative_to(ROOT).parts)
)
FENCE = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)


def ids(page: Path) -> str:
    return str(page.relative_to(ROOT))


def prose(page: Path) -> str:
    return FENCE.sub("", page.read_text(encoding="utf-8"))


def blocks(page: Path, language: str) -> list[str]:
    found = FENCE.findall(page.read_text(encoding="utf-8"))
    return [text for name, text in found if name == language]


def anchors(page: Path) -> set[str]:
    titles = HEADING.findall(prose(page))
    plain = (re.sub(r"[^\w\- ]", "", title.lower()) for title in titles)
    return {title.strip().replace(" ", "-") for title in plain}


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_links_lead_somewhere(page):
    for link in LINK.findall(prose(page)):
        if re.match(r"[a-z]+:", link):
            continue
        target, _, anchor = link.partition("#")
        path = (page.parent / target) if target else page
        if path.is_relative_to(ROOT / "docs" / "reference"):
            continue  # made of docstrings by .ci/site.py
        assert path.exists(), f"{ids(page)} links to {link}, which is not there"
        if anchor and path.suffix == ".md":
            assert anchor in anchors(path), f"{ids(page)}: no heading for {link}"


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p, "python")], ids=ids)
def test_python_in_the_page_runs(page, run_python, tmp_path):
    script = tmp_path / "page.py"
    script.write_text("\n".join(blocks(page, "python")), encoding="utf-8")
    run_python(script, limit=120)


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p, "toml")], ids=ids)
def test_toml_in_the_page_is_a_configuration(page, tmp_path):
    from bns.experiment import loading

    for number, text in enumerate(blocks(page, "toml")):
        path = tmp_path / f"{number}.toml"
        path.write_text(text, encoding="utf-8")
        loading.from_file(path)


def test_commands_in_the_pages_exist():
    from bench.runner import discover
    from bns.cli import VERBS

    benches = {*discover(), "list", "table", "NAME"}
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        verbs = re.findall(r"(?:^|[`/])bns ([a-z]\w*)", text, re.MULTILINE)
        assert set(verbs) <= set(VERBS), ids(page)
        names = re.findall(r"python -m bench ([\w-]+)", text)
        assert set(names) <= benches, ids(page)


def test_every_page_of_docs_is_in_the_index():
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    for page in (ROOT / "docs").glob("*.md"):
        assert page.name == "index.md" or f"({page.name})" in index, page.name


def test_the_readme_links_to_docs_results_and_the_way_to_contribute():
    links = set(LINK.findall((ROOT / "README.md").read_text(encoding="utf-8")))
    wanted = {"docs/index.md", "CONTRIBUTING.md", "bench/results/README.md", "LICENSE"}
    assert wanted <= links


def test_the_site_has_its_styles():
    import subprocess

    found = re.search(r"extra_css: \[(.+)\]", (ROOT / "mkdocs.yml").read_text())
    assert found
    path = ROOT / "docs" / found[1]
    assert path.is_file()
    if (ROOT / ".git").exists():
        asked = ["git", "check-ignore", str(path)]
        assert subprocess.run(asked, cwd=ROOT, check=False).returncode == 1


EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def test_there_are_examples():
    assert len(EXAMPLES) >= 6


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_and_runs(path, run_python):
    assert len(path.read_text().splitlines()) < 100
    output = run_python(path, "--quick")
    assert output.strip(), "an example says what it found"


def test_examples_come_with_the_package(run_python, tmp_path):
    listed = run_python("-m", "bns", "examples")
    assert all(path.stem in listed for path in EXAMPLES)
    shown = run_python("-m", "bns", "examples", "01_drive_a_robot")
    assert shown == (ROOT / "examples" / "01_drive_a_robot.py").read_text()
    wrong = run_python("-m", "bns", "examples", "01_drive_robot", code=2)
    assert "Did you mean '01_drive_a_robot'?" in wrong
    run_python("-m", "bns", "examples", "--copy", tmp_path / "mine")
    assert (tmp_path / "mine" / "burger" / "robot.toml").is_file()
    again = run_python("-m", "bns", "examples", "--copy", tmp_path / "mine", code=2)
    assert "is not overwritten" in again


TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
NOTEBOOKS = ROOT / "examples" / "notebooks"


@pytest.fixture
def jupytext():
    return pytest.importorskip("jupytext")


def cells(notebook):
    return [(cell.cell_type, cell.source) for cell in notebook.cells]


@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_a_notebook_is_the_page(page, jupytext):
    made = jupytext.read(NOTEBOOKS / f"{page.stem}.ipynb")
    kept = f"examples/notebooks/{page.stem}.ipynb"
    again = f"jupytext --to ipynb --output {kept} {page}"
    assert cells(made) == cells(jupytext.read(page)), f"make it again: {again}"


@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_a_notebook_runs(page, jupytext, tmp_path, monkeypatch):
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
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
