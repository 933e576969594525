"""Measure the blocks of the page of figures again: ``python benchmarks/_record.py NAME ...``.

Above each block of ``benchmarks/figures.md`` one line names the block, its command, the revision at which it was
measured and the date, and the data that it needs where they are not part of the repository. A block is measured alone:
the others keep their older revisions. ``--list`` shows all of them and how many commits have passed since.

    python benchmarks/_record.py --list
    python benchmarks/_record.py import-time scaling
    python benchmarks/_record.py festo --data ~/festo
"""

from __future__ import annotations

import argparse
import datetime
import os
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "benchmarks" / "figures.md"
LINE = re.compile(
    r"^\*Block (?P<name>[\w-]+): `(?P<command>[^`]+)`, revision (?P<revision>[0-9a-f]{7,40}) of "
    r"(?P<date>\d{4}-\d\d-\d\d)(?:, needs data outside the repository: (?P<data>[^*]+))?\.\*$\n+"
    r"^```text\n(?P<output>.*?)^```$",
    re.M | re.S,
)
"""A block: its line, then its output."""


@dataclass(frozen=True)
class Block:
    """One measured block of the page."""

    name: str
    command: str
    revision: str
    date: str
    data: str | None
    output: str

    @property
    def line(self) -> str:
        """What stands above the output."""
        needs = f", needs data outside the repository: {self.data}" if self.data else ""
        return f"*Block {self.name}: `{self.command}`, revision {self.revision} of {self.date}{needs}.*"

    @property
    def text(self) -> str:
        """The line and the output, as they stand on the page."""
        return f"{self.line}\n\n```text\n{self.output}```"


def blocks(text: str) -> list[Block]:
    """Return the blocks of a page, in order."""
    return [Block(**found.groupdict()) for found in LINE.finditer(text)]


def replaced(text: str, new: Block) -> str:
    """Return the page with one block measured anew."""
    return LINE.sub(lambda found: new.text if found["name"] == new.name else found[0], text)


def git(*words: str) -> str:
    """Return what git answers."""
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


def passed(revision: str) -> str:
    """Return how many commits have passed since a revision; a question mark where this history lacks it."""
    known = subprocess.run(["git", "cat-file", "-e", f"{revision}^{{commit}}"], cwd=ROOT, capture_output=True)
    return git("rev-list", "--count", f"{revision}..HEAD") if known.returncode == 0 else "?"


def matching(pattern: str) -> list[str]:
    """Return the files that a pattern stands for, as a shell does."""
    place = Path(pattern).expanduser()
    return sorted(str(file) for file in place.parent.glob(place.name)) or [pattern]


def measure(block: Block, data: str | None) -> Block:
    """Run the command of a block at the revision that is checked out."""
    if block.data and not data:
        raise SystemExit(f"{block.name} needs {block.data}. Pass the folder with --data.")
    if dirty := git("status", "--porcelain", "--untracked-files=no"):
        raise SystemExit(f"The tree differs from its revision, which the block is to name:\n{dirty}\nCommit first.")
    asked = shlex.split(block.command.replace("DIR", data or "DIR"))
    words = [w for word in asked for w in (matching(word) if "*" in word else [word])]
    words[0] = sys.executable if words[0] == "python" else words[0]
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    done = subprocess.run(words, cwd=ROOT, env=os.environ | {"PATH": path}, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{block.command} ended with {done.returncode}:\n{done.stderr[-2000:]}")
    today = datetime.datetime.now(tz=datetime.UTC).date().isoformat()
    output = "\n".join(line.rstrip() for line in done.stdout.strip("\n").splitlines()) + "\n"
    return Block(block.name, block.command, git("rev-parse", "--short", "HEAD"), today, block.data, output)


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="blocks to measure again")
    parser.add_argument("--list", action="store_true", help="show all blocks and their revisions")
    parser.add_argument("--data", metavar="DIR", help="folder of the data that a block needs")
    args = parser.parse_args()
    known = {b.name: b for b in blocks(PAGE.read_text(encoding="utf-8"))}
    if unknown := [n for n in args.names if n not in known]:
        raise SystemExit(f"There is no block {', '.join(unknown)}. Expected some of {', '.join(known)}.")
    if args.list or not args.names:
        for b in known.values():
            print(f"{b.name:24s} {b.revision} {b.date} {passed(b.revision):>5s} commits ago  {b.data or ''}")
    fresh = [measure(known[name], args.data) for name in args.names]
    for new in fresh:
        PAGE.write_text(replaced(PAGE.read_text(encoding="utf-8"), new), encoding="utf-8")


if __name__ == "__main__":
    main()
