"""Parameters of a constructor as annotated fields, and docstrings that say what is shared once.

``@parameters`` makes a class a dataclass whose fields are the parameters of its constructor. A parameter or an
attribute that its own docstring leaves out is explained by the nearest base that has an entry for it, a parameter of a
function by the functions that ``@explained_by`` names, a field of a record that is ``@explained_fields`` beside its
type; ``default=`` follows from the signature. ``help()`` and the site show the whole.
"""

import ast
import inspect
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import MISSING, dataclass, field
from typing import Any, ForwardRef, Self, TypeVar, dataclass_transform

ORDER = (
    "Parameters", "Attributes", "Methods", "Returns", "Yields", "Raises", "Warns", "Warnings", "See Also", "Notes",
    "References", "Examples",
)  # fmt: skip
"""Sections of a docstring, as numpydoc orders them."""

T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., Any])


@dataclass_transform(eq_default=False, field_specifiers=(field,))
def parameters(cls: type[T]) -> type[T]:
    """Make the annotated fields of a class and its bases the parameters of its constructor, and explain them."""
    made: type[T] = dataclass(eq=False, repr=False)(cls)
    owner = {name: depth for depth, base in enumerate(made.__mro__) for name in _own_fields(base)}
    start: Any = made.__init__
    signature = inspect.signature(start)
    order = sorted(signature.parameters.values(), key=lambda p: (p.kind, owner[p.name] if p.kind > 1 else 0))
    start.__signature__ = signature.replace(parameters=order)
    explain(made)
    return made


def explain(cls: type) -> None:
    """Complete the docstring of a class from those of its bases: entries, and sections that are shared as a whole."""
    doc, bases = Docstring(cls.__doc__), [Docstring(base.__doc__) for base in bases_of(cls)]
    doc.take("Parameters", bases, list(inspect.signature(cls).parameters.values()))
    doc.take("Attributes", bases)
    for section in ("See Also", "References"):
        doc.take_whole(section, bases)
    cls.__doc__ = str(doc)


def explain_methods(cls: type, common: type) -> None:
    """Complete the docstrings of the methods of a class from those of its bases, of its fit, and of common methods."""
    own, every = (Docstring(getattr(c, "fit", None).__doc__) for c in (cls, common))
    own.leave_out("Parameters", every)  # what is said of every fit is said better of each method
    for name, method in vars(cls).items():
        function = method.__func__ if isinstance(method, classmethod) else method
        if name.startswith("_") or not inspect.isfunction(function) or function.__doc__ is None:
            continue
        same = [Docstring(vars(base)[name].__doc__) for base in bases_of(cls) if name in vars(base)]
        shared = [Docstring(vars(common)[name].__doc__)] if name in vars(common) else []
        doc = Docstring(function.__doc__)
        wanted = list(inspect.signature(function).parameters.values())[1:]
        doc.take("Parameters", [*same, own, *shared, every], wanted)
        doc.take_whole("Returns", [*same, *shared])
        function.__doc__ = str(doc)


def explained_by(*others: Any) -> Callable[[F], F]:
    """Make other functions, or classes, explain what the docstring of a function leaves out."""

    def explained(function: F) -> F:
        doc, wanted = Docstring(function.__doc__), list(inspect.signature(function).parameters.values())
        docs = [Docstring(other.__doc__) for other in others]
        doc.take("Parameters", docs, wanted)
        for section in ("Returns", "References"):
            doc.take_whole(section, docs)
        function.__doc__ = str(doc)
        return function

    return explained


def explained_fields(cls: type[T]) -> type[T]:
    """Explain the fields of a record by the text beside their types, ``share: Annotated[float, "Of the gap."]``."""
    known: dict[str, Any] = getattr(cls, "__dataclass_fields__", {})
    start: Any = cls.__init__ if known else cls.__new__
    told = {name: _parted(annotation) for name, annotation in inspect.get_annotations(cls).items()}
    cls.__annotations__ = {name: kind for name, (kind, _) in told.items()}
    start.__annotations__ = {name: _parted(annotation)[0] for name, annotation in start.__annotations__.items()}
    alike: dict[tuple[str, str], list[str]] = {}
    for name, (kind, text) in told.items():
        made = known[name].default_factory if name in known else MISSING
        if name in known:
            known[name].type = kind
        shown = kind if isinstance(kind, str) else re.sub(r"[\w.]+\.(?=\w)", "", inspect.formatannotation(kind))
        if text:
            alike.setdefault((f"{shown}{'' if made is MISSING else ', optional'}", text), []).append(name)
    doc, own = Docstring(cls.__doc__), Docstring(None)
    own.sections["Parameters"] = "\n".join(f"{', '.join(n)} : {kind}\n    {text}" for (kind, text), n in alike.items())
    bases = [Docstring(base.__doc__) for base in bases_of(cls)]
    doc.take("Parameters", [own, *bases], list(inspect.signature(cls).parameters.values()))
    cls.__doc__ = str(doc)
    return cls


def _parted(annotation: Any) -> tuple[Any, str]:
    """Return the type that an annotation states, and the text beside it."""
    annotation = annotation.__forward_arg__ if isinstance(annotation, ForwardRef) else annotation
    if not isinstance(annotation, str):
        beside = getattr(annotation, "__metadata__", ())
        return (annotation.__origin__, beside[0]) if beside else (annotation, "")
    if not annotation.startswith("Annotated["):
        return annotation, ""
    both: Any = ast.parse(annotation, mode="eval").body
    kind, text = both.slice.elts
    return ast.unparse(kind), str(ast.literal_eval(text))


def bases_of(cls: type) -> list[type]:
    """Return the bases of a class, those of other libraries left out."""
    return [base for base in cls.__mro__[1:] if base.__module__.partition(".")[0] not in ("sklearn", "builtins")]


def _own_fields(cls: type) -> Iterable[str]:
    """Return the parameters that a class declares itself."""
    known = cls.__dict__.get("__dataclass_fields__", {})
    return [name for name in inspect.get_annotations(cls) if name in known and known[name].init]


class Docstring:
    """A docstring as its sections, and the entries of these."""

    def __init__(self, text: str | None) -> None:
        self.head, *parts = re.split(r"\n\n(?=[A-Z][\w ]+\n-{3,}\n)", inspect.cleandoc(text or ""))
        self.sections = {title: body for title, _, body in (part.split("\n", 2) for part in parts)}

    def __str__(self) -> str:
        titles = sorted(self.sections, key=ORDER.index)
        parts = [f"{title}\n{'-' * len(title)}\n{self.sections[title]}" for title in titles]
        return "\n\n".join([self.head, *parts])

    def entries(self, section: str) -> list[str]:
        """Return the entries of a section, each with the lines below it."""
        return re.split(r"\n(?=\S)", self.sections[section]) if self.sections.get(section) else []

    def leave_out(self, section: str, other: Self) -> None:
        """Remove the entries of a section whose text another docstring has too."""
        known = {entry.partition("\n")[2] for entry in other.entries(section)}
        left = [entry for entry in self.entries(section) if entry.partition("\n")[2] not in known]
        self.sections[section] = "\n".join(left)

    def take_whole(self, section: str, others: Sequence[Self]) -> None:
        """Add a section that is missing here as the first of others has it."""
        for other in others:
            if section not in self.sections and section in other.sections:
                self.sections[section] = other.sections[section]

    def take(self, section: str, others: Sequence[Self], wanted: Sequence[inspect.Parameter] | None = None) -> None:
        """Add entries of others for what has none here: for the parameters wanted in their order, or for all."""
        own = {name: entry for entry in self.entries(section) for name in _names(entry)}
        known = dict(own)
        for entry in (entry for other in others for entry in other.entries(section)):
            known |= {name: entry for name in _names(entry) if name not in known}
        if wanted is not None:
            told = {p.name: _with_default(known[p.name], p) for p in wanted if p.name in known}
            # Those of its own stand as they are; what explains the parameters of subclasses alone comes last.
            known = {name: own.get(name, entry) for name, entry in told.items()} | own
        if known:
            self.sections[section] = "\n".join(dict.fromkeys(known.values()))


def _names(entry: str) -> list[str]:
    return [name.strip() for name in entry.partition("\n")[0].partition(" : ")[0].split(",")]


def _with_default(entry: str, parameter: inspect.Parameter) -> str:
    """Return an entry of a base with the default that its parameter has here."""
    head, _, text = entry.partition("\n")
    if " : " not in head or "optional" in head or parameter.default is parameter.empty:
        return entry
    value, head = parameter.default, re.sub(", default=.*", "", head)
    shown = f"{value:.10g}".replace("e-0", "e-") if isinstance(value, float) else repr(value).replace("'", '"')
    return f"{head}, {'optional' if value is None else f'default={shown}'}\n{text}"
