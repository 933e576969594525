"""The first hour of an arm and an FMU: the page has the commands that are printed, and they close the gap."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from pathlib import Path

import pytest

from pamid.cli import main

PAGE = Path(__file__).resolve().parents[2] / "docs" / "first_hour.md"
if not PAGE.is_file():
    pytest.skip("needs the repository", allow_module_level=True)


def section() -> tuple[list[str], list[list[str]]]:
    """Return the Python and the commands of the section on simulators of one's own."""
    text = PAGE.read_text(encoding="utf-8")
    own = text[text.index("## A robot, an FMU") :]
    return (re.findall(r"```python\n(.*?)```", own, re.S),
            [block.splitlines() for block in re.findall(r"```console\n(.*?)```", own, re.S)])  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("k", [0, 1], ids=["arm", "fmu"])
def test_printed_commands_alone_lead_from_a_raw_log_to_a_correction_that_runs(
    k: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("mujoco" if k == 0 else "fmpy")
    if k == 1 and not (shutil.which("cc") or shutil.which("gcc")):
        pytest.skip("needs a C compiler")
    monkeypatch.chdir(tmp_path)
    code, commands = section()
    exec("import numpy as np\nimport pandas as pd\nrng = np.random.default_rng(0)\n" + code[k], {})
    said, printed, errors = "", [], {}
    for command in commands[k]:
        assert not said or command in printed, f"{command} is not in {printed}"
        assert main(shlex.split(command)[1:]) == 0, capsys.readouterr().err
        said = capsys.readouterr().out
        printed += re.findall(r"^next: (.*)$", said, re.M)
        if " evaluate " in command:
            errors["corrected" in command] = max(
                float(r) for r in re.findall(r"^\w+ +\S+ +\S+ +\S+ +\S+ +(\S+) ", said, re.M)[1:]
            )
    folder = ("arm", "motor")[k]
    assert set(printed) == {*commands[k][1:], f"pamid next {folder}/diagnosis{' --trust' * k}"}
    found = json.loads((tmp_path / folder / "diagnosis" / "diagnosis.json").read_text())
    assert [c["effects"][0] for c in found["causes"]] == ["viscous_friction"]
    assert errors[True] < 0.2 * errors[False]
