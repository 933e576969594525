"""The sections of the page, one small class and one template each."""

from ..._discovery import modules
from .base import Picture, Section, Source

__all__ = ["Picture", "Section", "Source", "all_sections"]


def all_sections() -> list[type[Section]]:
    """Return the sections in the order of the page.

    Returns
    -------
    list of class
        Every `Section` that a module of this package defines.

    Examples
    --------
    >>> from pamid.report.sections import all_sections
    >>> [cls.name for cls in all_sections()][:2]
    ['answer', 'where']
    """
    modules(__name__)
    return sorted(Section.__subclasses__(), key=lambda section: section.rank)
