"""A user's function made anew with other names around it, together with all of its module that it uses."""

from __future__ import annotations

import copy
import dis
from collections.abc import Iterator, Mapping
from types import CodeType, FunctionType, MethodType
from typing import Any

_WRAPPED = (staticmethod, classmethod)


class Used:
    """A function or method, and the functions, classes and objects of its module that it uses."""

    def __init__(self, function: FunctionType | MethodType) -> None:
        self.function = function
        plain = function.__func__ if isinstance(function, MethodType) else function
        self.around: dict[str, Any] = plain.__globals__
        self.codes: list[CodeType] = []
        """The code of all of them."""
        self._own: dict[str, Any] = {}
        waiting, seen = list(self._functions_of(function)), set[int]()
        while waiting:
            one = waiting.pop()
            if id(one) in seen:
                continue
            seen.add(id(one))
            for code in _codes(one.__code__):
                self.codes.append(code)
                for name in code.co_names:
                    if name not in self._own and (found := list(self._functions_of(self.around.get(name)))):
                        self._own[name] = self.around[name]
                        waiting += found

    @property
    def names(self) -> set[str]:
        """What they ask for by name."""
        return {name for code in self.codes for name in code.co_names}

    @property
    def keeps_count(self) -> bool:
        """Whether they set names of their module, and so say something else the next time."""
        return any(s.opname in ("STORE_GLOBAL", "DELETE_GLOBAL") for c in self.codes for s in dis.get_instructions(c))

    def within(self, names: Mapping[str, Any]) -> Any:
        """Return the function with some names replaced, for it and for all that it uses."""
        return _Anew(self, names).of(self.function)

    # --- what belongs to the module ----------------------------------------------------------------------------
    def has(self, kind: type) -> bool:
        """Return whether a class is one of the module's."""
        return any(True for _ in self._members(kind))

    def members(self, kind: type) -> dict[str, Any]:
        """Return a class's functions of the module, inherited ones, too, as they stand in it."""
        return dict(self._members(kind))

    def _members(self, kind: type) -> Iterator[tuple[str, Any]]:
        for base in reversed(kind.__mro__):
            for name, member in vars(base).items():
                if any(one.__globals__ is self.around for one in _plain(member)):
                    yield name, member

    def _functions_of(self, value: Any, known: set[int] | None = None) -> Iterator[FunctionType]:
        known = set() if known is None else known
        if isinstance(value, FunctionType):
            yield from [value] if value.__globals__ is self.around else []
        elif isinstance(value, MethodType):
            yield from [value.__func__] if isinstance(value.__func__, FunctionType) else []
            yield from self._functions_of(value.__self__, known)
        elif isinstance(value, type):
            yield from (one for member in self.members(value).values() for one in _plain(member))
        elif id(value) not in known and self.has(type(value)):
            known.add(id(value))
            yield from self._functions_of(type(value))
            for part in getattr(value, "__dict__", {}).values():
                yield from self._functions_of(part, known)


class _Anew:
    """What a module has, with other names around it."""

    def __init__(self, used: Used, names: Mapping[str, Any]) -> None:
        self._used, self._done = used, dict[int, Any]()
        self._names = {**used.around, **names}
        self._names |= {name: self.of(value) for name, value in used._own.items()}

    def of(self, value: Any) -> Any:
        """Return a function, method, class or object of the module made anew; anything else as it is."""
        if id(value) in self._done:
            return self._done[id(value)]
        if isinstance(value, MethodType):
            return MethodType(self.of(value.__func__), self.of(value.__self__))
        if isinstance(value, FunctionType) and value.__globals__ is self._used.around:
            made: Any = self._function(value)
        elif isinstance(value, type) and self._used.has(value):
            made = self._class(value)
        elif not isinstance(value, type) and self._used.has(type(value)):
            return self._object(value)
        else:
            return value
        self._done[id(value)] = made
        return made

    def _function(self, function: FunctionType) -> FunctionType:
        out = FunctionType(
            function.__code__, self._names, function.__name__, function.__defaults__, function.__closure__
        )
        out.__kwdefaults__ = function.__kwdefaults__
        return out

    def _class(self, kind: type) -> type:
        """Return a class that differs in its functions alone, so that objects can change to it."""
        found = {name: self._member(member) for name, member in self._used.members(kind).items()}
        try:
            return type(kind)(kind.__name__, (kind,), {**found, "__slots__": (), "__module__": kind.__module__})
        except Exception:  # an enumeration, say, has no further ones
            return kind

    def _member(self, member: Any) -> Any:
        if isinstance(member, property):
            return property(*(self.of(one) for one in (member.fget, member.fset, member.fdel)))
        return type(member)(self.of(member.__func__)) if isinstance(member, _WRAPPED) else self.of(member)

    def _object(self, value: Any) -> Any:
        """Return a copy of an object, of a class made anew; the object itself where it has none."""
        try:
            twin = copy.copy(value)
            object.__setattr__(twin, "__class__", self.of(type(value)))
        except Exception:  # whatever a user's class does when it is copied
            return value
        self._done[id(value)] = twin
        held = getattr(value, "__dict__", {})
        parts = {k: v for k, v in held.items() if not isinstance(v, type) and self._used.has(type(v))}
        if held and not parts:  # what is set on the one later holds for the other
            object.__setattr__(twin, "__dict__", held)
        for name, part in parts.items():
            object.__setattr__(twin, name, self.of(part))
        return twin


def _plain(member: Any) -> list[FunctionType]:
    """Return the functions behind what stands in a class."""
    if isinstance(member, property):
        some = [member.fget, member.fset, member.fdel]
    else:
        some = [member.__func__ if isinstance(member, _WRAPPED) else member]
    return [one for one in some if isinstance(one, FunctionType)]


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Yield the code of a function and of all that is defined in it."""
    yield code
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _codes(inner)
