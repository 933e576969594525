"""Save fitted models to one file and load them again, without pickle.

A model file (``*.pamid``) is a zip archive with the skops schema of the estimator (``schema.json``), its arrays as
``.npy`` entries, and ``pamid.json`` with the format version and what a reader wants to know before loading. Loading
never runs code from the file: every type it names is checked against a closed list before anything is built, and what
was built is checked again, attribute by attribute, before it is given out.
"""

import io
import json
import zipfile
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy

from . import __version__
from ._model_archive import MAX_BYTES, METADATA, SCHEMA, check_arrays, hostile, parse_json, read_archive, unpack
from ._model_audit import audit_schema
from ._model_checks import check_model
from .errors import (
    HostileModelError,
    ModelFileError,
    ModelVersionError,
    ParameterError,
    TruncatedModelError,
)
from .explained import explained_by
from .files import write_whole

FORMAT_VERSION = 3
"""Version of the file format that `save` writes; `load` reads this one and every earlier one."""

Migration = Callable[[dict[str, Any], dict[str, Any]], tuple[dict[str, Any], dict[str, Any]]]
_HEAD = {"pamid": str, "class": str, "steps": list, "columns": list, "units": dict, "created": str, "metadata": dict}
"""What a file says about itself."""
MIGRATIONS: dict[int, Migration] = {}
"""For each earlier version, what turns (metadata, schema) of a file into those of the next version.

A version is raised when a class moves, an attribute is renamed or an entry changes its meaning; `rename_type` and
`rename_attribute` are the usual steps of a migration.
"""

TrustedType = str | type
_PLAINER = "Replace functions and objects of your own by names or numbers, or pass trusted=[type] here and to load."


def save(
    estimator: Any,
    path: str | Path,
    metadata: Mapping[str, Any] | None = None,
    *,
    trusted: Sequence[TrustedType] = (),
) -> Path:
    """Write a fitted estimator, pipeline or search to a file, whole or not at all.

    The file is written beside its destination, flushed to disk and moved into place, so that a crash leaves either
    the old file or the new one. What was written is audited like any foreign file first: `save` never writes what
    `load` refuses.

    Parameters
    ----------
    estimator : estimator
        A scikit-learn estimator, `Pipeline` or search; fitted or not.
    path : path-like
        Where to write; by convention ``*.pamid``. An existing file is replaced.
    metadata : mapping, optional
        What else to keep in the file, as JSON; `inspect` gives it back under ``"metadata"``.
    trusted : sequence of type or str, optional
        Types of your own that the estimator holds; the same must be passed to `load`.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ModelFileError
        The estimator holds something that cannot be saved safely, such as a function.
    OutputError
        The file cannot be written.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from sklearn.linear_model import LinearRegression
    >>> from pamid.persistence import load, save
    >>> model = LinearRegression().fit([[0.0], [1.0]], [0.0, 2.0])
    >>> file = save(model, pathlib.Path(tempfile.mkdtemp()) / "line.pamid", metadata={"unit": "N"})
    >>> round(float(load(file).predict([[2.0]])[0]), 9)
    4.0
    """
    path = Path(path)
    head = _describe(estimator, metadata)
    packed = _pack(estimator, head)
    try:
        _check_own(estimator, packed, trusted)
    except HostileModelError as error:
        raise ModelFileError(
            f"The {type(estimator).__name__} cannot be saved so that it loads again: {error.found}",
            "an estimator made of scikit-learn's and pamid's types, numbers, text and arrays",
            error.remedy if "before saving" in error.remedy else _PLAINER,
        ) from None
    return write_whole(path, packed)


def load(path: str | Path, *, trusted: Sequence[TrustedType] = (), max_bytes: int = MAX_BYTES) -> Any:
    """Read a model that `save` wrote. Never runs code from the file.

    Parameters
    ----------
    path : path-like
        The model file.
    trusted : sequence of type or str, optional
        Further types that you know to be safe, such as an estimator class of your own.
    max_bytes : int, default=2**29
        Memory limit of loading, in bytes. The contents of the file may be a quarter of it.

    Returns
    -------
    estimator
        The estimator; its predictions equal those of the saved one bit by bit.

    Raises
    ------
    ModelNotFoundError
        There is no such file.
    TruncatedModelError
        The file is not a model file, or is cut off or damaged.
    ModelVersionError
        The file is of a format newer than this version of pamid, or of none.
    HostileModelError
        The file names a type that is not on the allow-list, gives an object an attribute that it may not have, such as
        a path or a function, holds arrays that do not fit together, or takes too much memory.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from pamid import inspect, load, save
    >>> from pamid.estimators import GeometricForce
    >>> import pandas as pd
    >>> X = pd.DataFrame({"eps": [0.05, 0.10, 0.15, 0.2], "P": [3e5, 4e5, 5e5, 3e5]})
    >>> model = GeometricForce().fit(X, [300.0, 350.0, 330.0, 90.0])  # N
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     again = load(save(model, Path(folder) / "force.pamid"))
    >>> bool((again.predict(X) == model.predict(X)).all())
    True
    """
    name = Path(path).name
    entries = read_archive(Path(path), max_bytes)
    head, schema = _read_head(entries, name, max_bytes)
    head, schema = _migrate(head, schema, name)
    types = _audit(entries, schema, name, trusted, max_bytes)
    clean = io.BytesIO()
    with zipfile.ZipFile(clean, "w") as archive:
        for entry, data in entries.items():
            if entry not in (SCHEMA, METADATA):
                archive.writestr(entry, data)
        archive.writestr(SCHEMA, json.dumps(schema))
    del entries  # three copies are enough
    return _construct(clean.getvalue(), name, types, frozenset(_names(trusted)))


@explained_by(load)
def inspect(path: str | Path, *, max_bytes: int = MAX_BYTES) -> dict[str, Any]:
    """Return the description in a model file, without loading the model.

    Returns
    -------
    dict
        ``format``, ``pamid``, ``sklearn``, ``numpy`` (versions), ``class``, ``steps`` of a pipeline, ``columns``,
        ``units``, ``created`` (UTC), ``metadata``.

    Raises
    ------
    ModelFileError
        As for `load`, except that no type is judged.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from pamid import inspect, load, save
    >>> from pamid.estimators import GeometricForce
    >>> import pandas as pd
    >>> X = pd.DataFrame({"eps": [0.05, 0.10, 0.15, 0.2], "P": [3e5, 4e5, 5e5, 3e5]})
    >>> model = GeometricForce().fit(X, [300.0, 350.0, 330.0, 90.0])  # N
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     what = inspect(save(model, Path(folder) / "force.pamid"))
    >>> type(what).__name__
    'dict'
    """
    name = Path(path).name
    return _read_head(read_archive(Path(path), max_bytes), name, max_bytes)[0]


def rename_type(schema: dict[str, Any], old: str, new: str) -> dict[str, Any]:
    """Return a schema in which the type ``old`` is called ``new`` (full names); a step of a migration."""
    old_module, _, old_class = old.rpartition(".")
    new_module, _, new_class = new.rpartition(".")

    def renamed(item: dict[str, Any]) -> dict[str, Any]:
        of_type = item.get("__module__") == old_module and item.get("__class__") == old_class
        return item | {"__module__": new_module, "__class__": new_class} if of_type else item

    return _changed(schema, renamed)


def rename_attribute(schema: dict[str, Any], type_name: str, old: str, new: str | None) -> dict[str, Any]:
    """Return a schema in which objects of a type have the attribute ``old`` under the name ``new``, or not at all."""
    module, _, cls = type_name.rpartition(".")

    def renamed(item: dict[str, Any]) -> dict[str, Any]:
        if item.get("__module__") == module and item.get("__class__") == cls and isinstance(item.get("content"), dict):
            attributes = item["content"].get("content", {})
            item["content"] = item["content"] | {
                "content": {new if key == old else key: x for key, x in attributes.items() if new or key != old}
            }
        return item

    return _changed(schema, renamed)


def _changed(item: Any, change: Callable[[dict[str, Any]], dict[str, Any]]) -> Any:
    """Return a schema with every object in it changed, the innermost first."""
    if isinstance(item, list):
        return [_changed(value, change) for value in item]
    return change({key: _changed(value, change) for key, value in item.items()}) if isinstance(item, dict) else item


def _with_placements(head: dict[str, Any], schema: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read a `GapDiagnoser` whose units had a type of their own."""
    schema = rename_type(schema, "pamid.gap.residuals.scaling.Scaling", "pamid.simulators.placement.Scales")
    return head, rename_attribute(schema, "pamid.estimators.gap_diagnoser.GapDiagnoser", "_inward_", None)


def _with_the_next_run(head: dict[str, Any], schema: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read a `GapDiagnoser` whose next run was called an experiment."""
    kind = "pamid.estimators.gap_diagnoser.GapDiagnoser"
    return head, rename_attribute(schema, kind, "next_experiment_", "next_run_")


MIGRATIONS[1] = _with_placements
MIGRATIONS[2] = _with_the_next_run


# --- writing ------------------------------------------------------------------------------------------------
def _check_own(estimator: Any, packed: bytes, trusted: Sequence[TrustedType]) -> None:
    """Refuse what `load` would refuse, however large the model is."""
    what, room = "The model", 2**62
    check_model(estimator, what, frozenset(_names(trusted)))
    entries = unpack(packed, what, room)
    _audit(entries, parse_json(entries[SCHEMA], SCHEMA, what, room), what, trusted, room)


def _describe(estimator: Any, metadata: Mapping[str, Any] | None) -> dict[str, Any]:
    import sklearn
    import skops

    columns = getattr(estimator, "feature_names_in_", None)
    names = [str(column) for column in columns] if columns is not None else []
    head = {
        "format": FORMAT_VERSION,
        "pamid": __version__,
        "sklearn": sklearn.__version__,
        "numpy": numpy.__version__,
        "skops": skops.__version__,
        "class": f"{type(estimator).__module__}.{type(estimator).__qualname__}",
        "steps": [type(step).__name__ for _, step in getattr(estimator, "steps", [])],
        "columns": names,
        "units": _units(names),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "metadata": dict(metadata or {}),
    }
    try:
        json.dumps(head, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ParameterError(
            f"metadata cannot be written as JSON: {error}.",
            "text, finite numbers, lists and mappings",
            "Convert arrays with .tolist() and dates with .isoformat().",
        ) from None
    return head


def _units(columns: list[str]) -> dict[str, str]:
    """Units of the signals of pamid among the columns; all signals are SI."""
    units = {"eps": "1", "deps": "1/s", "P": "Pa", "dP": "Pa/s", "p_gauge": "Pa", "F": "N", "mdot": "kg/s"}
    units |= {"q": "rad", "q_ref": "rad", "u": "1", "time": "s", "V": "m^3"}
    found = {column: units.get(column, units.get(column.rstrip("12"), "")) for column in columns}
    return {column: unit for column, unit in found.items() if unit}


def _pack(estimator: Any, head: dict[str, Any]) -> bytes:
    import skops.io

    try:
        packed = skops.io.dumps(estimator, compression=zipfile.ZIP_DEFLATED)
    except RecursionError:
        raise ModelFileError(
            f"The {type(estimator).__name__} refers to itself.", "an estimator without cycles", "Save its parts."
        ) from None
    except Exception as error:  # skops raises whatever the object's own protocol raises
        raise ModelFileError(
            f"The {type(estimator).__name__} cannot be written without pickle: {error}.",
            "an estimator made of numbers, text, arrays and estimators",
            "Replace the part named in the message.",
        ) from error
    buffer = io.BytesIO(packed)
    with zipfile.ZipFile(buffer, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(METADATA, json.dumps(head, indent=1, ensure_ascii=False))
    return buffer.getvalue()


# --- reading ------------------------------------------------------------------------------------------------
def _read_head(entries: dict[str, bytes], name: str, max_bytes: int) -> tuple[dict[str, Any], dict[str, Any]]:
    for entry in (METADATA, SCHEMA):
        if entry not in entries:
            raise TruncatedModelError(
                f"{name} is a zip archive without {entry}.",
                "a model file written by pamid.persistence.save",
                "Check that this is the right file.",
            )
    head = parse_json(entries[METADATA], METADATA, name)
    version = head.get("format")
    if isinstance(version, bool) or not isinstance(version, int) or version < 1:
        raise ModelVersionError(
            f"{name} states the format {version!r}.", f"a number from 1 to {FORMAT_VERSION}", "Save the model again."
        )
    if version > FORMAT_VERSION:
        raise ModelVersionError(
            f"{name} is of format {version}, written by pamid {head.get('pamid', 'of unknown version')}.",
            f"a format from 1 to {FORMAT_VERSION} (this is pamid {__version__})",
            "Update pamid, or save the model again with this version.",
        )
    for key, kind in _HEAD.items():
        if not isinstance(head.get(key), kind):
            raise TruncatedModelError(
                f"{METADATA} of {name} has {key} = {str(head.get(key))[:60]!r}.",
                "what pamid.persistence.save wrote there",
                "Save the model again.",
            )
    return head, parse_json(entries[SCHEMA], SCHEMA, name, max_bytes)


def _migrate(head: dict[str, Any], schema: dict[str, Any], name: str) -> tuple[dict[str, Any], dict[str, Any]]:
    for version in range(head["format"], FORMAT_VERSION):
        if version not in MIGRATIONS:
            raise ModelVersionError(
                f"{name} is of format {version}, which this version of pamid no longer reads.",
                f"a format that leads to {FORMAT_VERSION}",
                "Load and save it with an earlier version first.",
            )
        try:
            head, schema = MIGRATIONS[version](head, schema)
        except (KeyError, TypeError, AttributeError, ValueError, RecursionError) as error:
            raise TruncatedModelError(
                f"{name} of format {version} cannot be read: {error!r}.", "a whole model file", "Save the model again."
            ) from None
        head = head | {"format": version + 1}
    return head, schema


def _names(trusted: Sequence[TrustedType]) -> list[str]:
    return [t if isinstance(t, str) else f"{t.__module__}.{t.__qualname__}" for t in trusted]


def _audit(
    entries: dict[str, bytes], schema: dict[str, Any], name: str, trusted: Sequence[TrustedType], max_bytes: int
) -> set[str]:
    protocol = schema.get("protocol")
    if isinstance(protocol, bool) or not isinstance(protocol, int) or protocol < 2:
        raise hostile(f"{name} claims the skops protocol {protocol!r}.", "protocol 2 or later")
    if schema.get("__loader__") not in ("ObjectNode", "TreeNode"):
        raise hostile(f"{name} holds a {schema.get('__loader__')!r} at its top.", "an estimator")
    check_arrays(entries, name)
    return audit_schema(schema, entries, name, _names(trusted), max_bytes)


def _construct(packed: bytes, name: str, types: set[str], trusted: frozenset[str]) -> Any:
    import skops.io

    try:
        # skops looks a second time, by its own rules, at everything that the audit let through.
        untrusted = set(skops.io.get_untrusted_types(data=packed))
        if not untrusted <= types:
            raise hostile(
                f"{name} holds {', '.join(sorted(untrusted - types))[:200]}.", "types that the audit has seen"
            )
        model = skops.io.loads(packed, trusted=sorted(untrusted))
        check_model(model, name, trusted)
        if hasattr(model, "get_params"):
            model.get_params()  # an estimator without its own parameters is not one
        return model
    except ModelFileError:
        raise
    except Exception as error:  # a well-formed file whose contents do not fit its types
        raise TruncatedModelError(
            f"{name} does not describe a whole model: {type(error).__name__}: {str(error)[:160]}.",
            "a model file written by pamid.persistence.save",
            "Save the model again; if it comes from a newer scikit-learn, update scikit-learn.",
        ) from None
