"""Map the repository's top-level directories onto the one import package `bns`.

The list of packages is computed, so that a new sub-package or robot directory cannot
be missing from the wheel. A new top-level directory is entered in `TREES`;
`tests/test_wheel.py` fails where one is forgotten.
"""

from setuptools import find_namespace_packages, setup

TREES = {
    "bns": "bns",
    "bns.models": "models",
    "bns.worlds": "worlds",
    "bns.gap": "gap",
    "bns.hardware": "hardware",
    "bns.viz": "viz",
}

packages = [
    f"{root}.{sub}" if sub else root
    for root, directory in TREES.items()
    for sub in ["", *find_namespace_packages(directory, exclude=["*__pycache__*"])]
]
setup(packages=packages, package_dir=TREES)
