"""What MkDocs needs beside docs/: pages made of other files, and the reference.

The pages of the repository link to files outside docs/; on the site they lead to the
repository. The reference has a page for each package, made of the docstrings, and one
for the command line, made of its manuals.
"""

import contextlib
import io
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[1]
TREES = ("models", "worlds", "gap", "hardware", "viz")
BORROWED = {
    "contributing.md": "CONTRIBUTING.md",
    "changelog.md": "CHANGELOG.md",
    "results.md": "bench/results/README.md",
}
"""page of the site -> file of the repository"""
LINK = re.compile(r"(\]\()(?![a-z]+:|#)([^)\s#]+)")
INDEX = (
    "# Python reference\n\nEvery public name, by package. Importing `bns` is light.\n\n"
)


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that are made here."""
    made = {page: (ROOT / file).read_text() for page, file in BORROWED.items()}
    for page, text in [*made.items(), *_reference(), ("reference/commands.md", _cli())]:
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Lead links to files outside the site to the repository."""
    name = page.file.src_uri
    source = ROOT / BORROWED.get(name, f"docs/{name}")

    def led(found: re.Match[str]) -> str:
        """A link of the page, as the site has it."""
        target = (source.parent / found[2]).resolve()
        if not target.is_relative_to(ROOT) or not target.exists():
            return found[0]
        inside = target.relative_to(ROOT).as_posix()
        for borrowed, file in BORROWED.items():
            if inside == file:
                return f"{found[1]}{os.path.relpath(borrowed, Path(name).parent)}"
        if inside.startswith("docs/"):
            return f"{found[1]}{os.path.relpath(inside[5:], Path(name).parent)}"
        kind = "tree" if target.is_dir() else "blob"
        return f"{found[1]}{config.repo_url}/{kind}/main/{inside}"

    return LINK.sub(led, markdown)


def _packages() -> dict[str, list[str]]:
    """Modules by package, as they are imported."""
    found: dict[str, list[str]] = {}
    roots = {"bns": ROOT / "bns", **{f"bns.{tree}": ROOT / tree for tree in TREES}}
    for prefix, root in roots.items():
        for path in sorted(root.rglob("*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            if "templates" in parts or any(part.startswith("_") for part in parts[:-1]):
                continue
            package = ".".join((prefix, *parts[:-1]))
            name = package if parts[-1] == "__init__" else f"{package}.{parts[-1]}"
            if not parts[-1].startswith("_") or parts[-1] == "__init__":
                found.setdefault(package, []).append(name)
    return dict(sorted(found.items()))


def _reference() -> Iterator[tuple[str, str]]:
    lines = []
    for package, modules in _packages().items():
        text = "\n\n".join(f"::: {name}" for name in modules)
        yield f"reference/{package}.md", f"# {package}\n\n{text}\n"
        lines.append(f"- [{package}]({package}.md)")
    yield "reference/index.md", INDEX + "\n".join(lines) + "\n"


def _cli() -> str:
    """The manuals of all verbs, as they print them."""
    os.environ["COLUMNS"] = "88"
    from bns.cli import VERBS

    parts = ["# Command line", _said(["--help"])]
    for verb in VERBS:
        parts += [f"## bns {verb}", _said([verb, "--help"])]
    return "\n\n".join(parts) + "\n"


def _said(words: list[str]) -> str:
    from bns.cli import dispatch

    heard = io.StringIO()
    with contextlib.redirect_stdout(heard), contextlib.suppress(SystemExit):
        dispatch(words)
    return f"```text\n{heard.getvalue().rstrip()}\n```"
