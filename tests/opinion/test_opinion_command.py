"""The command line: a second opinion with --after, and a passport compared with another rig's log."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support.rail import LIBRARY, log_of, rail

from pamid.cli import main
from pamid.opinion import Passport
from pamid.simulators import page_text


def test_the_command_line_asks_for_an_opinion_and_checks_another_rig(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rail.toml").write_text(page_text(rail()))
    (tmp_path / "fit.json").write_text(json.dumps({"m": 2.02, "c": 4.4}))
    log_of(1.5).to_csv("log.csv", index=False)
    log_of(1.5, seed=3).to_csv("other.csv", index=False)
    words = ["diagnose", "log.csv", "--sim", "rail.toml", "--after", "fit.json", "--effects", ",".join(LIBRARY)]
    assert main([*words, "--out", "opinion", "--quiet"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "c absorbed the missing physics: 4.4 as fitted" in said and "wrote opinion/passport.toml" in said
    words = ["passport", "opinion/passport.toml", "other.csv", "--sim", "opinion/corrected.toml", "--out", "second"]
    assert main([*words, "--quiet"]) == 0
    assert "agrees" in capsys.readouterr().out
    assert Passport.read("second/passport.toml").rigs[0].name == "other"
