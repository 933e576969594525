"""Completion in shells, colours, and the page of the docs that an error names."""

from __future__ import annotations

import inspect
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pamid import errors
from pamid.cli import app, main
from pamid.cli._style import coloured, marked

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = [m.__name__.rpartition(".")[2] for m in app.commands()]
ERRORS = [c for c in vars(errors).values() if inspect.isclass(c) and issubclass(c, errors.PamidError)]


class Terminal:
    encoding = "utf-8"

    def __init__(self) -> None:
        self.text = ""

    def isatty(self) -> bool:
        return True

    def write(self, text: str) -> None:
        self.text += text

    def flush(self) -> None:
        pass


def script(shell: str, capsys) -> str:
    assert main(["completion", shell]) == 0
    return capsys.readouterr().out


# --- completion -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_script_knows_every_command_and_is_sound(shell, capsys, tmp_path):
    text = script(shell, capsys)
    for command in COMMANDS:
        assert command in text
    for option in ("columns", "estimator", "html"):
        assert option in text
    if shutil.which(shell) is None:
        return
    (tmp_path / "script").write_text(text, encoding="utf-8")
    done = subprocess.run([shell, "-n", str(tmp_path / "script")], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (["dia"], "diagnose"),
        (["check", "--na"], "--nan"),
        (["check", "--nan", ""], "raise drop keep"),
        (["completion", "z"], "zsh"),
        (["fit", "--fo"], "--folds"),
    ],
)
def test_bash_completes(words, offered, capsys, tmp_path):
    (tmp_path / "script").write_text(script("bash", capsys))
    line = " ".join(f"'{w}'" for w in ["pamid", *words])
    ask = f". ./script; COMP_WORDS=({line}); COMP_CWORD={len(words)}; _pamid; echo ${{COMPREPLY[@]}}"
    done = subprocess.run(["bash", "-c", ask], capture_output=True, text=True, cwd=tmp_path)
    assert done.stdout.strip() == offered


@pytest.mark.skipif(shutil.which("fish") is None, reason="needs fish")
def test_fish_completes(capsys, tmp_path):
    (tmp_path / "script").write_text(script("fish", capsys))
    ask = "source script; complete -C 'pamid dia'; complete -C 'pamid check --nan '"
    done = subprocess.run(["fish", "-c", ask], capture_output=True, text=True, cwd=tmp_path)
    assert "diagnose" in done.stdout
    assert {"raise", "drop", "keep"} <= set(done.stdout.split())


def test_an_unknown_shell_is_refused(capsys):
    assert main(["completion", "tcsh"]) == 2
    assert "invalid choice: 'tcsh'" in capsys.readouterr().err


# --- colours ----------------------------------------------------------------------------------------------------
def test_colours_reach_a_terminal_and_nothing_else(monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    assert coloured(Terminal())
    assert marked("no", "no", Terminal()).startswith("\x1b[")
    assert not coloured(sys.stdout)
    monkeypatch.setenv("NO_COLOR", "1")
    assert not coloured(Terminal())
    monkeypatch.delenv("NO_COLOR")
    monkeypatch.setenv("TERM", "dumb")
    assert marked("no", "no", Terminal()) == "no"


@pytest.mark.parametrize(("variable", "value"), [("TERM", "xterm"), ("NO_COLOR", "1"), ("TERM", "dumb")])
def test_an_error_on_a_terminal(variable, value, monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv(variable, value)
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    assert main(["check", "there-is-no-such.csv"]) == 2
    assert ("\x1b[31merror:\x1b[0m" in terminal.text) is ((variable, value) == ("TERM", "xterm"))
    assert "See " in terminal.text


# --- pages ------------------------------------------------------------------------------------------------------
@pytest.mark.skipif(not (ROOT / "docs").is_dir(), reason="needs the repository")
@pytest.mark.parametrize("error", ERRORS, ids=lambda c: c.__name__)
def test_every_error_names_a_page_that_is_there(error):
    file, _, anchor = error.page.partition("#")
    page = ROOT / file
    assert page.is_file()
    titles = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    known = {re.sub(r"[^\w\- ]", "", t.lower()).replace(" ", "-") for t in titles}
    assert not anchor or anchor in known


def test_the_command_line_names_the_page(tmp_path, capsys):
    (tmp_path / "log.csv").write_text("time,P\n0,3.1\n0.01,3.2\n0.02,3.1\n")
    assert main(["diagnose", str(tmp_path / "log.csv"), "--sim", "x.toml", "--out", str(tmp_path / "o")]) == 2
    assert " See docs/" in capsys.readouterr().err
    assert main(["evaluate", str(tmp_path / "log.csv"), "--sim", str(tmp_path / "no.toml")]) == 2
    assert "See docs/simulator.md#the-simulator-file." in capsys.readouterr().err
