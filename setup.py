"""Map the repository's top-level directories onto the one import package `bns`."""

from setuptools import find_namespace_packages, setup

TREES = {
    "bns": "bns",
    "bns.models": "models",
    "bns.worlds": "worlds",
    "bns.gap": "gap",
    "bns.viz": "viz",
}

packages = [
    f"{root}.{sub}" if sub else root
    for root, directory in TREES.items()
    for sub in ["", *find_namespace_packages(directory, exclude=["*__pycache__*"])]
]
setup(packages=packages, package_dir=TREES)
