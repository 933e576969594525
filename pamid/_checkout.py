"""Find `pamid.estimators` in a checkout, where its folder stands beside the package instead of inside it.

setuptools installs ``estimators/`` as ``pamid/estimators/`` and an editable install maps it, so this is only for Python
that runs in a checkout: no link is needed, which Windows would check out as a text file.
"""

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from os.path import dirname, isdir, isfile, join
from types import ModuleType

_PACKAGE = dirname(__file__)  # noqa: PTH120 - pathlib would double the time of `import pamid`


class _BesideThePackage:
    """Answer to one name; the folder beside a checkout's package belongs to it, whatever else is installed."""

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None = None, target: ModuleType | None = None) -> ModuleSpec | None:
        if name != "pamid.estimators":
            return None
        return PathFinder.find_spec(name, [dirname(_PACKAGE)])  # noqa: PTH120


def find_estimators() -> None:
    """Make `pamid.estimators` importable from a checkout; no effect where it is installed in the package."""
    beside = join(dirname(_PACKAGE), "estimators", "__init__.py")  # noqa: PTH118, PTH120
    if isfile(beside) and not isdir(join(_PACKAGE, "estimators")):  # noqa: PTH112, PTH113, PTH118
        sys.meta_path.insert(0, _BesideThePackage)
