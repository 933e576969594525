"""scikit-learn estimators and transformers for pneumatic artificial muscles.

Every public class is an attribute of this package (``pamid.estimators.MLP``) and is imported when first asked for.
"""

from typing import Any

from pamid._lazy import renamed

from ._registry import all_estimators, checked_instances, class_locations, load_class

_TOOLS = {"all_estimators": all_estimators, "checked_instances": checked_instances}


def _lookup(name: str) -> Any:
    if name == "__all__":
        return sorted({*_TOOLS, *class_locations()})
    if not name.startswith("_") and name in class_locations():
        value = load_class(name)
        globals()[name] = value
        return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


__getattr__ = renamed(__name__, {"Interval": "PredictionInterval"}, _lookup)


def __dir__() -> list[str]:
    return sorted({*_TOOLS, *class_locations()})
