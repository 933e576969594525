"""The walk through a model file's schema, before anything of it is built: what is not on the allow-list is refused."""

import sys
from collections.abc import Iterable, Mapping
from typing import Any

from ._model_archive import COPIES, MAX_BYTES, hostile, json_cost
from ._model_types import FILE_ENDINGS, MAX_DEPTH, PLACES, allowed
from .errors import HostileModelError

_SKIPPED = {"__id__", "file"}


def audit_schema(
    schema: dict[str, Any],
    files: Mapping[str, bytes],
    name: str,
    trusted: Iterable[str] = (),
    max_bytes: int = MAX_BYTES,
) -> set[str]:
    """Walk the whole schema and refuse every class, module or loader that is not on the allow-list."""
    audit = _Audit(files, name, frozenset(trusted), max_bytes)
    limit = sys.getrecursionlimit()
    try:
        sys.setrecursionlimit(max(limit, 4 * MAX_DEPTH + 1000))
        audit.walk(schema)
    except RecursionError:
        raise hostile(f"{name} nests its objects without end.", "a shallow model") from None
    finally:
        sys.setrecursionlimit(limit)
    return audit.types


class _Audit:
    """One walk: the types met, the memory that the objects may take, and what each id stands for."""

    def __init__(self, files: Mapping[str, bytes], name: str, trusted: frozenset[str], max_bytes: int) -> None:
        self.files, self.name, self.trusted, self.most = files, name, trusted, max_bytes // COPIES
        self.types: set[str] = set()
        self._contents: dict[Any, int] = {}
        self._read: set[tuple[Any, str]] = set()
        self._depth = self._spent = 0

    def walk(self, item: Any) -> int:
        """Check an item of the schema and all within; return a digest of its content."""
        if not isinstance(item, (dict, list)):
            return hash(repr(item))
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise hostile(f"{self.name} nests its objects more than {MAX_DEPTH} levels deep.", "a shallow model")
        digest = self._mapping(item) if isinstance(item, dict) else hash(tuple(self.walk(value) for value in item))
        self._depth -= 1
        return digest

    def _mapping(self, item: dict[str, Any]) -> int:
        node = bool({"__class__", "__module__", "__loader__"} & item.keys())
        if node:
            self._check_node(item)
        digest = hash(tuple((hash(key), self.walk(value)) for key, value in item.items() if key not in _SKIPPED))
        if node and "file" in item:  # one object written twice has two files of one content
            digest = hash((digest, self.files[item["file"]]))
        # The loader builds each id once and reuses it: a second, different content would never be looked at.
        if node and "__id__" in item and self._contents.setdefault(item["__id__"], digest) != digest:
            raise hostile(f"{self.name} uses the object id {item['__id__']} for two contents.", "one content an id")
        return digest

    def _check_node(self, node: dict[str, Any]) -> None:
        loader, module, cls = (node.get(key) for key in ("__loader__", "__module__", "__class__"))
        if not all(isinstance(part, str) for part in (loader, module, cls)):
            raise hostile(
                f"{self.name} holds a node of {module!r}, {cls!r}, {loader!r}.", "names of a type and a loader"
            )
        full = f"{module}.{cls}"
        if not allowed(str(loader), str(module), str(cls), self.trusted):
            raise HostileModelError(
                f"{self.name} asks for {full[:120]} by {str(loader)[:60]}, which no model of pamid needs.",
                "only scikit-learn's and pamid's own types, arrays and plain containers",
                "Do not load this file. If it is your own and holds a type of yours, pass trusted=[that type].",
            )
        if "__id__" in node and (isinstance(node["__id__"], bool) or not isinstance(node["__id__"], int)):
            raise hostile(f"{self.name} holds a node with the id {node['__id__']!r}.", "a number")
        if "file" in node:
            self._check_file(node, str(loader), full)
        self._check_places(node, full)
        if loader == "JsonNode":
            self._spend(json_cost(str(node.get("content")).encode("utf-8", "replace")))
        else:  # a JsonNode's class says nothing: its content is plain data
            self.types.add(full)

    def _check_file(self, node: dict[str, Any], loader: str, full: str) -> None:
        ending = FILE_ENDINGS.get(loader, "?")
        file = str(node["file"])
        if file != node["file"] or file not in self.files or not file.endswith(ending):
            raise hostile(f"{self.name} reads {file[:80]!r} for {full}.", "the array or bytes of an entry of the file")
        # Each object that reads an array has a copy of it, unless it is the same object once more.
        if (key := (node.get("__id__"), file)) not in self._read or key[0] is None:
            self._read.add(key)
            self._spend(len(self.files[file]))

    def _check_places(self, node: dict[str, Any], full: str) -> None:
        """Refuse a place where it stands in plain sight; where it hides is seen once the objects are built."""
        content = node.get("content")
        attributes = content.get("content") if isinstance(content, dict) else None
        if node["__loader__"] != "ObjectNode" or not isinstance(attributes, dict):
            return
        for key in PLACES & attributes.keys():
            if not isinstance(attributes[key], dict) or attributes[key].get("content") != "null":
                raise HostileModelError(
                    f"{self.name} gives {full} a place or cache ({key}), which a fit would read or write.",
                    f"{key}=None",
                    f"Set {key}=None before saving; choose one again after loading.",
                )

    def _spend(self, size: int) -> None:
        self._spent += size
        if self._spent > self.most:
            raise hostile(f"{self.name} describes objects of more than {self.most} bytes.", "fewer or smaller ones")
