"""The first hour as a user has it: `pamid init`, then what it prints, then what that prints, without an edit."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import resource
import shlex
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from .cases import Case

INIT = "pamid init log.csv --sim {sim} --yes --out setup"


@dataclass
class Walk:
    """What the commands of one case did.

    Parameters
    ----------
    commands : list of str
        The commands in the order in which they were run: ``init`` and what was printed.
    failed : str
        What the first that failed said; empty where all ran.
    cpu : float
        Processor time of all of them, s.
    before, after : dict of str to float
        Error of each equation before and after the correction, as ``evaluate`` prints it.
    verdict : str
        First line of the diagnosis.
    """

    commands: list[str] = field(default_factory=list)
    failed: str = ""
    cpu: float = 0.0
    before: dict[str, float] = field(default_factory=dict)
    after: dict[str, float] = field(default_factory=dict)
    verdict: str = ""

    @property
    def ran(self) -> bool:
        """Whether all commands ran, a corrected simulator among them."""
        return not self.failed and any("corrected" in c for c in self.commands)


def walk(
    case: Case, folder: Path, limit: float = 900.0, ask: Callable[[str, Path, Walk, float], str] | None = None
) -> Walk:
    """Run ``pamid init`` in the folder of a case, and what is printed: each in a process of its own, or as told."""
    done, waiting = Walk(), [INIT.format(sim=case.sim)]
    while waiting and not done.failed:
        command = waiting.pop(0)
        done.commands.append(command)
        output = (ask or said)(command, folder, done, limit)
        waiting += [c for c in re.findall(r"^next: (pamid .*)$", output, re.M) if c not in done.commands]
        if " evaluate " in f" {command}":
            errors = {
                r[0]: float(r[1]) for r in re.findall(r"^(\S+)\s+(\S+)\s+\S+\s+\S+\s+\S+\s+\S+", output, re.M)[1:]
            }
            (done.after if "corrected" in command else done.before).update(errors)
        if " diagnose " in f" {command}":
            done.verdict = output.partition("\n")[0]
    return done


def said(command: str, folder: Path, done: Walk, limit: float) -> str:
    """Return what a printed command prints."""
    words = shlex.split(command)
    assert words[0] == "pamid"
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        out = subprocess.run(
            [sys.executable, "-m", "pamid", *words[1:]], cwd=folder, capture_output=True, text=True, timeout=limit,
            env={**os.environ, "COLUMNS": "110", "PYTHONIOENCODING": "utf-8"},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        done.failed = f"{command}: longer than {limit:g} s"
        return ""
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    done.cpu += after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    if out.returncode:
        done.failed = f"{command}: {out.stderr.strip()[-600:]}"
    return out.stdout


def signals(case: Case, folder: Path) -> dict:
    """Return what ``pamid init --json`` says of the case."""
    from pamid.cli import main

    words, out = shlex.split(INIT.format(sim=case.sim).replace("--out setup", "--out said --json")), io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        code = main(words[1:])
    return dict(json.loads(out.getvalue())) if code == 0 else {"signals": {}}
