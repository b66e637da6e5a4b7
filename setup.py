"""Map the repository's top-level directories onto the one import package `bns`.

The list of packages is computed, so that a new sub-package or robot directory can
not be missing from the wheel; `tests/test_wheel.py` compares the two.
"""

from pathlib import Path

from setuptools import find_namespace_packages, setup

TREES = {
    "bns": "bns",
    "bns.models": "models",
    "bns.worlds": "worlds",
    "bns.gap": "gap",
    "bns.hardware": "hardware",
    "bns.viz": "viz",
}
trees = {root: tree for root, tree in TREES.items() if any(Path(tree).glob("*.py"))}

packages = [
    f"{root}.{sub}" if sub else root
    for root, directory in trees.items()
    for sub in ["", *find_namespace_packages(directory, exclude=["*__pycache__*"])]
]
setup(packages=packages, package_dir=trees)
