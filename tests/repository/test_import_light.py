"""`import bns` and `bns --help` are light, and no tree is imported a second time."""

import json

HEAVY = {"torch", "mujoco", "rerun", "matplotlib", "scipy", "pyarrow", "pandas"}
TREES = {"models", "worlds", "gap", "hardware", "viz"}


def loaded(run_python, code, **options) -> set[str]:
    tell = "import json, sys; print('\\n' + json.dumps(sorted(sys.modules)))"
    output = run_python("-c", f"{code}\n{tell}", **options)
    return {name.split(".")[0] for name in json.loads(output.splitlines()[-1])}


def test_import_bns_is_light(run_python):
    assert not loaded(run_python, "import bns") & HEAVY


def test_help_is_light(run_python):
    code = """
import sys
sys.argv = ["bns", "--help"]
from bns.__main__ import main
try:
    main()
except SystemExit as done:
    assert not done.code, done.code
"""
    assert not loaded(run_python, code) & HEAVY


def test_every_module_is_importable_and_no_tree_is_imported_twice(run_python, root):
    from tests.sources import modules

    names = [name for name in sorted(modules()) if not name.endswith("__main__")]
    code = f"from importlib import import_module\nfor name in {names}:\n"
    found = loaded(run_python, code + "    import_module(name)", cwd=root)
    assert "bns" in found
    assert not found & TREES
