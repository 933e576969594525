"""The command line: ``pamid <command> ...``, one file a command in `pamid.cli.commands`.

Nothing heavy is imported to show a help page; a command imports what it needs when it runs.
"""

from collections.abc import Sequence


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; those of the process by default.

    Returns
    -------
    int
        0 done, 1 an error of pamid itself, 2 wrong use or input, 130 interrupted.

    Examples
    --------
    >>> from pamid.cli import main
    >>> main(["--version"])  # doctest: +ELLIPSIS
    pamid 0.1.0
      python 3...
    0
    """
    from .app import run

    return run(argv)


__all__ = ["main"]
