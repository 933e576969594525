"""A user's function made anew: with other values in place of some that it, and its own modules, ask for."""

from __future__ import annotations

import builtins
import copy
import dis
import functools
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from types import CellType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

_WRAPPED = (staticmethod, classmethod)
_CACHED = type(functools.cache(len))
_GROUPS = (list, tuple, dict)
_PLAIN = {int, float, complex, bool, str, bytes, type(None), np.ndarray, np.float64}


class Used:
    """A function, method or object, and all that it uses of its user's modules."""

    def __init__(self, function: Any) -> None:
        self.function = function
        self.codes: list[CodeType] = []
        """The code of all functions."""
        self.keeps_count = False
        """Whether they set names outside of them, and so say something else the next time."""
        plain = next(_plain(function), None) or next(_calls(type(function)), None)
        self._modules = _Modules(plain.__globals__ if plain else {})
        self.values = dict[int, Any]()
        """All that they are made of and ask for, by its identity."""
        waiting = [function]
        while waiting:
            one = waiting.pop()
            if type(one) not in _PLAIN and id(one) not in self.values:
                self.values[id(one)] = one
                waiting += self._parts(one)

    def within(self, instead: Mapping[int, Any]) -> Any:
        """Return the function with some values, known by their identity, replaced for all that it uses."""
        return _Anew(self._modules, instead).of(self.function)

    def _parts(self, value: Any) -> Iterable[Any]:
        """Return what a value is made of or asks for."""
        if isinstance(value, FunctionType) and self._modules.own(value.__globals__):
            return self._asked_by(value)
        if isinstance(value, type):
            return [one for member in self._modules.members(value).values() for one in _plain(member)]
        if self._modules.has(type(value)):
            return [type(value), *getattr(value, "__dict__", {}).values()]
        return _parts_of(value)

    def _asked_by(self, function: FunctionType) -> Iterator[Any]:
        """Yield what a function asks for, and note what it does."""
        around, free = function.__globals__, function.__code__.co_freevars
        names = set[str]()
        for code in _codes(function.__code__):
            self.codes.append(code)
            names.update(code.co_names)
            for step in dis.get_instructions(code):
                set_outside = step.opname == "STORE_DEREF" and step.argval in free
                self.keeps_count |= set_outside or step.opname in ("STORE_GLOBAL", "DELETE_GLOBAL")
        found = [around.get(name, getattr(builtins, name, sys.modules.get(name))) for name in names]
        for module in found:  # grows on the way: modules of modules
            if isinstance(module, ModuleType) and self._modules.own(vars(module)):
                found += [part for name in names if (part := getattr(module, name, None)) is not module]
                names.discard(module.__name__.rpartition(".")[2])
        yield from found
        yield from _within(function.__closure__ or ())
        yield from [*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values()]


class _Modules:
    """The modules of a function's user: those of its package, or those in its folder and below."""

    def __init__(self, first: Mapping[str, Any]) -> None:
        self._first = first
        self._package = _top(first.get("__package__"))
        self._file = None if self._package else _file(first)
        self._known = dict[int, tuple[Mapping[str, Any], bool]]()

    def own(self, around: Mapping[str, Any]) -> bool:
        """Return whether the names of a module are those of one of them, and not made anew already."""
        if isinstance(around, _Around):
            return False
        if id(around) not in self._known:
            self._known[id(around)] = around, around is self._first or self._is_near(around)
        return self._known[id(around)][1]

    def _is_near(self, around: Mapping[str, Any]) -> bool:
        if self._package:
            return _top(around.get("__name__")) == self._package
        if self._file is None or (path := _file(around)) is None or not path.is_relative_to(self._file.parent):
            return False
        return {"site-packages", "dist-packages"}.isdisjoint(path.relative_to(self._file.parent).parts)

    def has(self, kind: type) -> bool:
        """Return whether a class is one of theirs."""
        return any(True for _ in self._members(kind.__mro__))

    def members(self, kind: type) -> dict[str, Any]:
        """Return a class's functions of theirs, inherited ones, too."""
        return dict(self._members(reversed(kind.__mro__)))

    def members_of_itself(self, kind: type) -> dict[str, Any]:
        """Return those functions that stand in the class itself."""
        return dict(self._members([kind]))

    def _members(self, kinds: Iterable[type]) -> Iterator[tuple[str, Any]]:
        for kind in kinds:
            for name, member in vars(kind).items():
                if any(self.own(one.__globals__) for one in _plain(member)):
                    yield name, member


class _Around(dict[str, Any]):
    """The names of a module as they are when one is asked for, their values made anew."""

    def __init__(self, around: dict[str, Any], anew: _Anew) -> None:
        super().__init__({**around, "__builtins__": anew.builtins})
        self._around, self._anew = around, anew

    def __getitem__(self, name: str) -> Any:
        return self._anew.of(self._around[name])


class _Anew:
    """What a user's modules have, with other values in it."""

    def __init__(self, modules: _Modules, instead: Mapping[int, Any]) -> None:
        self._modules, self._instead = modules, instead
        self._done = dict[int, tuple[Any, Any]]()
        self._names = dict[int, _Around]()
        self._open = set[int]()
        self.builtins = {name: instead.get(id(value), value) for name, value in vars(builtins).items()}
        self.builtins["__import__"] = lambda *given, **named: self.of(builtins.__import__(*given, **named))

    def of(self, value: Any) -> Any:
        """Return a function, class, object or module of the user's made anew, or with such in it; all else as it is."""
        if type(value) in _PLAIN:
            return value
        if id(value) in self._done:
            return self._done[id(value)][1]
        if id(value) in self._instead:
            return self._instead[id(value)]
        if isinstance(value, FunctionType):
            return self._function(value) if self._modules.own(value.__globals__) else value
        if isinstance(value, MethodType):
            return MethodType(self.of(value.__func__), self.of(value.__self__))
        if isinstance(value, functools.partial):
            keywords = {name: self.of(one) for name, one in value.keywords.items()}
            return functools.partial(self.of(value.func), *map(self.of, value.args), **keywords)
        if isinstance(value, _CACHED):
            plain = value.__wrapped__
            return value if (made := self.of(plain)) is plain else made
        if type(value) in _GROUPS:
            return self._group(value)
        if isinstance(value, ModuleType):
            return self._keep(value, _Module(value, self)) if self._modules.own(vars(value)) else value
        if isinstance(value, type):
            return self._class(value) if self._modules.has(value) else value
        return self._object(value) if self._modules.has(type(value)) else value

    def _keep(self, value: Any, made: Any) -> Any:
        self._done[id(value)] = value, made
        self._done[id(made)] = made, made
        return made

    def _group(self, value: Any) -> Any:
        some = value.values() if isinstance(value, dict) else value
        if id(value) in self._open or _PLAIN.issuperset(map(type, some)):
            return value
        self._open.add(id(value))
        made = list(map(self.of, some))
        self._open.discard(id(value))
        if all(new is old for new, old in zip(made, some, strict=True)):
            return value
        return dict(zip(value, made, strict=True)) if isinstance(value, dict) else type(value)(made)

    def _function(self, function: FunctionType) -> FunctionType:
        around = function.__globals__
        if id(around) not in self._names:
            self._names[id(around)] = _Around(around, self)
        old, cells = function.__closure__ or (), [CellType() for _ in function.__closure__ or ()]
        names = self._names[id(around)]
        out = FunctionType(function.__code__, names, function.__name__, None, tuple(cells) or None)
        self._keep(function, out)
        for cell, made, name in zip(old, cells, function.__code__.co_freevars, strict=True):
            for held in _within([cell]):
                made.cell_contents = held if name == "__class__" else self.of(held)
        out.__defaults__ = self.of(function.__defaults__)
        out.__kwdefaults__ = self.of(function.__kwdefaults__)
        out.__qualname__, out.__module__ = function.__qualname__, function.__module__
        return out

    def _class(self, kind: type) -> type:
        """Return a class that differs in its functions alone, so that objects can change to it."""
        bases = tuple(base for base in map(self.of, kind.__bases__) if base not in kind.__bases__)
        read: Any = kind.__getattribute__
        found: dict[str, Any] = {"__slots__": (), "__module__": kind.__module__, "__qualname__": kind.__qualname__}
        found["__getattribute__"] = lambda this, name: self._read(read(this, name), name)
        try:
            made = self._keep(kind, type(kind)(kind.__name__, (kind, *bases), found))
            for name, member in self._modules.members_of_itself(kind).items():
                type.__setattr__(made, name, self._member(member))
        except Exception:  # an enumeration, say, has no further ones
            return self._keep(kind, kind)
        return made

    def _read(self, value: Any, name: str) -> Any:
        return value if name.startswith("__") else self.of(value)

    def _member(self, member: Any) -> Any:
        if isinstance(member, property):
            return property(*(self.of(one) for one in (member.fget, member.fset, member.fdel)))
        return type(member)(self.of(member.__func__)) if isinstance(member, _WRAPPED) else self.of(member)

    def _object(self, value: Any) -> Any:
        """Return an object of the class made anew that shares what the other holds; itself where there is none."""
        kind = self.of(type(value))
        frozen = getattr(getattr(value, "__dataclass_params__", None), "frozen", isinstance(value, tuple))
        held = getattr(value, "__dict__", None)
        if kind is type(value) or not (frozen or held is not None):
            return value
        try:
            twin = copy.copy(value)
            object.__setattr__(twin, "__class__", kind)
            if held is not None:  # what is set on the one later holds for the other
                object.__setattr__(twin, "__dict__", held)
        except Exception:  # whatever a user's class does when it is copied
            return value
        return self._keep(value, twin)


class _Module:
    """A module of the user's, its values made anew."""

    def __init__(self, module: ModuleType, anew: _Anew) -> None:
        for name, value in (("_module", module), ("_anew", anew)):
            object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        return self._anew.of(getattr(self._module, name))

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._module, name, value)


def _parts_of(value: Any) -> list[Any]:
    """Return what stands in a value that is nobody's."""
    if isinstance(value, MethodType):
        return [value.__func__, value.__self__]
    if isinstance(value, functools.partial):
        return [value.func, *value.args, *value.keywords.values()]
    if isinstance(value, _CACHED):
        return [value.__wrapped__]
    return list(value.values() if isinstance(value, dict) else value) if type(value) in _GROUPS else []


def _plain(member: Any) -> Iterator[FunctionType]:
    """Yield the functions behind a value, or behind what stands in a class."""
    if isinstance(member, property):
        some: list[Any] = [member.fget, member.fset, member.fdel]
    elif isinstance(member, (*_WRAPPED, MethodType)):
        some = [member.__func__]
    elif isinstance(member, functools.partial):
        some = list(_plain(member.func))
    else:
        some = [getattr(member, "__wrapped__", member) if isinstance(member, _CACHED) else member]
    yield from (one for one in some if isinstance(one, FunctionType))


def _calls(kind: type) -> Iterator[FunctionType]:
    """Yield the functions that calling an object of a class calls, the class's own first."""
    for base in kind.__mro__:
        yield from _plain(vars(base).get("__call__"))


def _within(cells: Iterable[CellType]) -> Iterator[Any]:
    """Yield what stands in the cells of a function; one that is not set yet is empty."""
    for cell in cells:
        try:
            yield cell.cell_contents
        except ValueError:
            continue


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Yield the code of a function and of all that is defined in it."""
    yield code
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _codes(inner)


def _top(name: Any) -> str:
    return str(name or "").partition(".")[0]


def _file(around: Mapping[str, Any]) -> Path | None:
    return Path(found).resolve() if (found := around.get("__file__")) else None
