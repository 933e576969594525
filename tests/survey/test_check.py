"""``pamid check`` and the survey behind it: what is wrong with a log is found, what is right is not called wrong."""

from __future__ import annotations

import json
import re

import numpy as np
import pandas as pd
import pytest

from pamid.bench import BenchParameters, hold, isometric, sealed_hold, simulate, sine, step
from pamid.cli import main
from pamid.errors import EmptyLogError
from pamid.gap.residuals.bench import Evidence
from pamid.survey.answerable import RULES
from pamid.survey.page import survey_html
from pamid.survey.separation import _responses, _told
from pamid.survey.survey import survey
from pamid.survey.words import channel_rows
from pamid.systems.cylinder import Cylinder

BENCH = BenchParameters.for_muscle("B")
TIME = np.arange(0, 6, 0.005)


def run(name: str = "sine-1", w: float = 3.0, noise: float = 0.1, seed: int = 0, **changes) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    x = 0.02 + 0.015 * np.sin(w * TIME)
    P = 4e5 + 5e4 * np.sin(0.7 * w * TIME) + 40.0 * rng.standard_normal(len(TIME))
    F = 1e-3 * P + 5.0 * np.sign(np.cos(w * TIME)) + noise * rng.standard_normal(len(TIME))
    return pd.DataFrame({"trajectory": name, "time": TIME, "x": x, "P": P, "F": F}).assign(**changes)


@pytest.fixture(scope="module")
def log() -> pd.DataFrame:
    return simulate(BENCH, [sine(4, 20, samples=900), step(0, 10, samples=900), sealed_hold(5, samples=900)], seed=0)


def told(found, words: str) -> bool:
    return any(words in text for text in found.warnings)


def answer(found, words: str):
    (one,) = (a for a in found.answers if words in a.question)
    return one


# --- the clock and the channels ---------------------------------------------------------------------------------
def test_a_clean_log_is_not_blamed():
    found = survey(run())
    assert found.warnings == []
    assert found.sampling.rate == pytest.approx(200)
    assert found.sampling.jitter < 1e-6
    (F,) = (c for c in found.channels if c.name == "F")
    assert F.noise == pytest.approx(0.1, rel=0.15)
    assert F.unit == "N"
    assert F.moves


def test_gaps_jitter_and_mixed_rates_are_told():
    rng = np.random.default_rng(0)
    torn = pd.concat([run().iloc[:400], run().iloc[600:]])
    shaky = run().assign(time=TIME + 0.001 * rng.uniform(-1, 1, len(TIME)))
    slow = pd.concat([run("a"), run("b").iloc[::3]])
    assert told(survey(torn), "gap(s) in time, the longest of 1 s")
    assert told(survey(shaky), "sampling period varies")
    assert told(survey(slow), "sampled at different rates")
    assert told(survey(run(w=80.0)), "rates lose their peaks")


def test_a_channel_without_a_reading_and_a_run_of_three_rows_are_put_in_words():
    gone = survey(run(F=np.nan))
    assert next(row for row in channel_rows(gone.channels)[1] if row[0] == "F")[-1] == "100 %"
    short = simulate(BENCH, [sine(3, 12, samples=100)], seed=0).iloc[:3]
    assert not any("nan" in a.why for a in survey(short).answers)


def test_faults_of_sensors_are_told():
    burst, frozen = run(), run()
    burst.loc[100:160, "F"] = np.nan
    frozen.loc[200:500, "F"] = frozen.loc[200, "F"]
    clipped = run().assign(F=lambda d: d["F"].clip(upper=d["F"].quantile(0.8)))
    coarse = run().assign(P=lambda d: 2e4 * np.round(d["P"] / 2e4))
    empty = run(F=np.nan)
    assert told(survey(burst), "F: 5.08 % of the readings are missing, the longest stretch 0.3")
    assert told(survey(frozen), "F stays at one value")
    assert told(survey(clipped), "F piles up at the upper end")
    assert told(survey(coarse), "steps over its range")
    assert told(survey(empty), "F holds no reading")
    (P,) = (c for c in survey(coarse).channels if c.name == "P")
    assert P.step == pytest.approx(2e4)


def test_repeats_are_counted_and_give_the_noise():
    found = survey(pd.concat([run("a", seed=1), run("b", seed=2), run("c", w=5.0, seed=3)]))
    assert found.sampling.repeats == 1
    assert found.sampling.repeat_error["F"] == pytest.approx(0.1, rel=0.2)
    assert answer(found, "repeated runs").answer == "partly"


# --- what can be answered ---------------------------------------------------------------------------------------
def test_answers_follow_the_excitation():
    one_way = run(x=0.02 + 0.001 * TIME)
    assert answer(survey(run()), "friction of any kind").answer == "yes"
    assert answer(survey(one_way), "friction of any kind").answer == "no"
    assert answer(survey(run(P=4e5)), "grows with the pressure").answer == "no"
    assert answer(survey(pd.concat([run(), run("b", P=6e5)])), "grows with the pressure").answer == "yes"


def test_what_is_not_logged_is_said(log):
    found = survey(log.drop(columns=["mdot1", "mdot2"]))
    leak = answer(found, "a leak against")
    assert (leak.answer, leak.why) == ("no", "the log lacks a mass flow")
    assert leak.record in found.record
    assert answer(survey(log), "a leak against").answer != "no"


def test_a_cylinder_is_not_asked_for_a_flow():
    found = survey(run(), Cylinder(bore=0.025))
    assert not any("flow" in a.why for a in found.answers)
    assert told(survey(run().drop(columns="x"), Cylinder(bore=0.025)), "does not suit the simulator file")


def test_rules_name_effects_of_the_library():
    from pamid.effects import all_effects

    assert {name for rule in RULES for name in rule.effects.split()} <= set(all_effects())


def test_the_library_is_tried_on_a_log_of_the_bench(log):
    names, D = _responses(Evidence(log, BENCH))
    by_name = {s.effect: s for s in _told(names, D.T @ D)}
    assert by_name["coulomb_friction"].seen
    assert "mdot1" in log and by_name["leakage"].seen
    without, _ = _responses(Evidence(log.drop(columns=["mdot1", "mdot2", "u1", "u2"]), BENCH))
    assert "leakage" not in without
    assert "coulomb_friction" in without


def test_a_hold_cannot_tell_a_leak_from_a_flow_offset_and_other_pressures_can():
    def seen(*runs):
        return survey(simulate(BENCH, list(runs), seed=0).drop(columns=["u1", "u2", "F1", "F2"]), BENCH)

    still = seen(hold(5, 900))
    assert any({"leakage", "flow_bias"} <= set(group) for group in still.classes())
    assert still.next_run is not None
    assert "leakage" in still.next_run["splits"]
    assert "A run of the kind" in still.record[0]
    moving = seen(hold(5, 900), isometric(5, 3e5, 2000))
    assert not any({"leakage", "flow_bias"} <= set(group) for group in moving.classes())


def test_an_empty_log_is_the_only_failure():
    with pytest.raises(EmptyLogError):
        survey(run().iloc[:0])
    for odd in (run().iloc[:1], run().iloc[:5], run(x=np.nan, P=np.nan), run()[["time", "F"]], run(time=0.0)):
        found = survey(odd)
        assert found.answers
        json.dumps(found.as_dict(), allow_nan=False)
        if len(odd) < 10 or "x" not in odd:
            assert survey_html(found, odd)


# --- the command and its page -----------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def folder(tmp_path_factory, log):
    folder = tmp_path_factory.mktemp("check")
    log.to_parquet(folder / "log.parquet")
    BENCH.to_toml(folder / "bench.toml")
    return folder


def test_the_command_for_people_and_machines(folder, capsys):
    argv = ["check", str(folder / "log.parquet")]
    assert main([*argv, "--sim", str(folder / "bench.toml"), "--quiet"]) == 0
    text = capsys.readouterr().out
    for words in ("2,700 rows in 3 runs", "What this log can tell", "What to record next", "alike"):
        assert words in text
    assert "\x1b" not in text
    assert main([*argv, "--json", "--out", str(folder / "out")]) == 0
    report = json.loads(capsys.readouterr().out)
    assert {"sampling", "channels", "coverage", "answers", "separations", "next_run", "record", "classes"} <= set(
        report
    )
    assert sorted(p.name for p in (folder / "out").iterdir()) == ["check.html", "check.json"]


def test_doubtful_units_and_clocks_are_told_rather_than_refused(tmp_path, capsys):
    run(P=run()["P"] / 1e5).to_csv(tmp_path / "bar.csv", index=False)
    back = pd.concat([run(), run()])
    back.to_csv(tmp_path / "back.csv", index=False)
    assert main(["check", str(tmp_path / "bar.csv"), "--json"]) == 0
    assert "looks like bar" in json.loads(capsys.readouterr().out)["warnings"][0]
    assert main(["check", str(tmp_path / "back.csv"), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["sampling"]["runs"] == 2
    assert main(["check", str(tmp_path / "sofa.csv")]) == 2
    assert main(["check", str(tmp_path / "bar.csv"), "--html", str(tmp_path / "no" / "x.html")]) == 2


def test_the_page_stands_alone_and_escapes_what_a_log_says(tmp_path):
    evil = run("<script>alert(1)</script>-1").assign(**{"<img src=x>": 1.0})
    evil.to_parquet(tmp_path / "log.parquet")
    assert main(["check", str(tmp_path / "log.parquet"), "--html", str(tmp_path / "check.html"), "--quiet"]) == 0
    text = (tmp_path / "check.html").read_text(encoding="utf-8")
    assert "<script" not in text
    assert "<img" not in text
    assert "&lt;img src=x&gt;" in text
    assert not re.search(r'(?:src|href)="(?!#)', text)
    assert "url(http" not in text
    assert "default-src 'none'" in text
    assert text.count("<svg") == 3
    ids = re.findall(r' id="([^"]+)"', text)
    assert len(ids) == len(set(ids))


# --- runs that are held ------------------------------------------------------------------------------------------
def test_runs_held_at_different_places_are_no_movement():
    t, rng = np.arange(0, 5, 0.002), np.random.default_rng(0)
    runs = []
    for k, eps in enumerate((0.0, 0.05, 0.1, 0.15)):
        P = 2e5 + 8e4 * np.sin(3 * t) + 40 * rng.standard_normal(len(t))
        runs.append(pd.DataFrame({"trajectory": f"held-{k}", "time": t, "eps": eps, "P": P, "F": 1e-3 * (P - 101_325)}))
    found = survey(pd.concat(runs, ignore_index=True))
    assert (found.coverage.up, found.coverage.down, found.coverage.reversals) == (0.0, 0.0, 0)
    assert found.coverage.longest_hold == pytest.approx(5.0, abs=0.01)
    assert found.coverage.held_pressure_moves == pytest.approx(1.6e5, rel=0.05)
    answers = {a.question: a for a in found.answers}
    assert answers["friction of any kind"].answer == "no"
    assert "stands still in every run" in answers["friction of any kind"].why
    assert answers["geometry and elasticity: diameter, braid, threads, bladder"].answer == "yes"
    assert not any("200 Hz" in text for text in found.record)  # it is sampled at 500 Hz


def test_the_command_says_what_comes_next(tmp_path, capsys):
    t = np.arange(0, 3, 0.01)
    log = pd.DataFrame({"time": t, "x": 0.01 * np.sin(t), "P": 3e5 + 1e5 * np.sin(2 * t), "F": 90 + np.cos(t)})
    log.to_csv(tmp_path / "log.csv", index=False)
    (tmp_path / "page.toml").write_text('kind = "cylinder"\n[cylinder]\nbore = "25 mm"\n')
    assert main(["check", str(tmp_path / "log.csv"), "--sim", str(tmp_path / "page.toml")]) == 0
    assert (
        f"next: pamid diagnose {tmp_path}/log.csv --sim {tmp_path}/page.toml --out diagnosis" in capsys.readouterr().out
    )
