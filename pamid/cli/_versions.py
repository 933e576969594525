"""What ``pamid --version`` prints: the versions on which results depend, looked up without importing anything heavy."""

import argparse
import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from .. import __version__

DEPENDENCIES = ("numpy", "scipy", "pandas", "scikit-learn", "torch", "pysindy", "mujoco", "fmpy", "onnxruntime")
"""Packages whose version changes results or files; those after pysindy are optional."""


def versions() -> str:
    """Return pamid's version, then Python's, the system's and those of the dependencies, one per line."""
    lines = [f"pamid {__version__}", f"  python {platform.python_version()} ({platform.system()} {platform.machine()})"]
    for name in DEPENDENCIES:
        try:
            lines.append(f"  {name} {version(name)}")
        except PackageNotFoundError:
            lines.append(f"  {name} not installed")
    return "\n".join(lines)


class ShowVersions(argparse.Action):
    """The option ``--version``: look the versions up only when they are asked for."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[Any] | None,
        option_string: str | None = None,
    ) -> None:
        """Print the versions and stop."""
        print(versions())
        parser.exit()
