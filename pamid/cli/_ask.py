"""Questions on a terminal; without one, every question is answered by its default."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

from ..errors import PamidError


class Asker:
    """Asks a person, or takes the defaults."""

    def __init__(self, interactive: bool) -> None:
        self.interactive = interactive

    def text(self, question: str, default: str, check: Callable[[str], object] | None = None) -> str:
        """Ask for a text until it passes a check; return the default where nobody answers."""
        while self.interactive:
            sys.stderr.write(f"{question}{f' [{default}]' if default else ''}: ")
            sys.stderr.flush()
            line = sys.stdin.readline()
            if not line:  # the input has ended
                break
            answer = line.strip() or default
            if check is None:
                return answer
            try:
                check(answer)
            except PamidError as error:
                sys.stderr.write(f"  {error}\n")
                continue
            return answer
        return default

    def choice(self, question: str, offered: Sequence[str], default: str) -> str:
        """Ask for one of several words."""

        def known(answer: str) -> None:
            if answer not in offered:
                raise PamidError(f"{answer!r} is not one of them.", ", ".join(offered), "")

        return self.text(f"{question} ({', '.join(offered)})", default, known)
