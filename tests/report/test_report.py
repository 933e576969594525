"""The report of a diagnosis: its sentences, its pictures, its page; what it shows, and that text stays text."""

from __future__ import annotations

import html.parser
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.diagnoses import VERDICTS, diagnosis_of

from pamid.errors import OutputError
from pamid.gap.diagnosis.findings import (
    Cause,
    NextExperiment,
    ParameterEstimate,
    Region,
    TrajectoryShare,
)
from pamid.gap.diagnosis.result import Diagnosis
from pamid.report import GapDisplay, answers, report_html, write_report
from pamid.report.causes import cause_names, shown_unit, size
from pamid.report.quantities import (
    amount,
    amount_within,
    at_least,
    error_size,
    interval_of,
    parameter,
    percent,
    share_span,
    span,
)
from pamid.report.sections import Source, all_sections
from pamid.report.sections.which import WhichSection
from pamid.report.sentences import query_words
from pamid.report.words import Words
from pamid.simulators import FunctionSimulator, ModelParameter, Port
from pamid.systems.cylinder import Cylinder


def with_offset(d: Diagnosis, unit: str, value: float, corrected: Any) -> Diagnosis:
    offset = {"offset": ParameterEstimate(value, unit, (0.99 * value, 1.01 * value))}
    return replace(d, causes=[replace(d.causes[0], parameters=offset)], corrected=corrected)


def test_an_offset_of_the_ambient_pressure_is_asked_about_first(material) -> None:
    d = diagnosis_of("cause", material)
    assert not answers(d).where.startswith("Is ")
    for value, asked in ((101_325.0, True), (-95_000.0, True), (60_000.0, False), (120_000.0, False)):
        assert answers(with_offset(d, "Pa", value, d.corrected)).where.startswith("Is gauge pressure") == asked
    cylinder = Cylinder(bore=0.025)  # 491 mm²: 49.7 N
    for off, asked in ((49.7, True), (-47.0, True), (30.0, False)):
        said = answers(replace(d, corrected=cylinder, windows=d.windows.assign(before=off))).where
        assert said.startswith("Is gauge pressure") == asked
        assert ("the ambient pressure on 490.9 mm²" in said) == asked


def test_a_gain_of_a_power_of_ten_is_asked_about_first(material) -> None:
    d = diagnosis_of("cause", material)
    simulated = 300.0 + 30.0 * np.sin(np.arange(len(d.windows)) / 5.0)
    for gain, asked in ((0.1, True), (1 / 9.80665, True), (10.0, True), (1e3, True), (1.0, False), (3.0, False)):
        windows = d.windows.assign(measured=gain * simulated, before=(gain - 1.0) * simulated, equation="force")
        assert answers(replace(d, windows=windows)).where.startswith("Is a unit wrong?") == asked, gain
    rough = 0.1 * simulated * (1.0 + 0.02 * np.cos(np.arange(len(simulated))))
    explained = d.windows.assign(measured=rough, before=rough - simulated, after=0.0, equation="force")
    factor = replace(d.causes[0], parameters={"deviation": ParameterEstimate(-0.9, "-", (-0.91, -0.89))})
    for causes, asked in ((d.causes, False), ([factor], True)):
        assert answers(replace(d, windows=explained, causes=causes)).where.startswith("Is a unit wrong?") == asked


@pytest.fixture(scope="module")
def pages(diagnoses) -> dict[str, str]:
    source = Source("logs/data.parquet", "logs/sim.toml", 5400, 4)
    return {verdict: report_html(d, source) for verdict, d in diagnoses.items()}


# --- sentences ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("verdict", "words"),
    [
        ("cause", ("One cause: Coulomb friction", "97 % of the gap is in the force equation", "5.94 N",
                   "5.7 to 6.2 N", "closes 95 % (90 % interval 92 to 97 %)", "error 5.82 N before, 1.43 N after",
                   "of it lies below 2 Hz")),
        ("class", ("cannot tell which: Coulomb friction or hysteresis", "93 % that it is one of them",
                   "a triangle of small amplitude")),
        ("several", ("Two causes: Coulomb friction and leakage", "force (63 %) and flow (33 %)", "88 % or more")),
        ("unknown", ("not in the library", "the best, Coulomb friction, closes 95 %",
                     "depends on contraction and contraction rate", "Nothing is added")),
        ("none", ("No gap", "Nowhere: force, flow, valve and joint agree", "p = 0.41", "nothing to close")),
    ],
)  # fmt: skip
def test_a_verdict_reads_as_sentences(diagnoses, verdict, words):
    told = answers(diagnoses[verdict])
    text = " ".join(told)
    assert [w for w in words if w not in text] == []
    for sentence in told[1:]:
        assert sentence.endswith(".")
        assert not re.search(r"nan|inf\b|_|\{|\}|  |\.\.", sentence), sentence


def test_a_gap_within_the_noise_has_no_share(diagnoses):
    named = diagnoses["cause"]
    noise = max(c.rmse_before for c in named.closure)
    quiet = [replace(c, closed_share=0.0, ci90=(0.0, 1.0), noise_floor=noise) for c in named.closure]
    told = answers(replace(named, closure=quiet)).how_far
    assert "within the noise: error 5.82 N before, 1.43 N after" in told and "%" not in told


def test_what_closes_next_to_nothing_is_no_headline(diagnoses):
    first, second = diagnoses["several"].causes[:2]
    few = replace(diagnoses["several"], causes=[replace(first, share=0.93), replace(second, share=0.012)])
    told = answers(few)
    assert told.verdict == "One cause: Coulomb friction; one more with under 2 % of the gap"
    assert "leakage" in told.which.lower()  # it is still said, and stands in the corrected simulator


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("eps1 > 0.168 and deps1 > 0",
         "where the contraction is above 16.8 % and the muscle shortens"),
        ("(P2 <= 250000.0)", "where the pressure of muscle 2 is below 2.5 bar"),
        ("u1 < 0 and dP1 < 0", "where the muscle is being vented and the muscle loses pressure"),
        ("eps1 > 0.1 and P1 < 2e5 and eps1 <= 0.15",
         "where the contraction is between 10 and 15 % and the pressure is below 2 bar"),
        ("dP1 > 0 and dP1 < 1e5", "where the pressure rate is between 0 and 1 bar/s"),
        ("time > 1.5", "where the time is above 1.5 s"),
        ("deps1 < -0.05", "where the contraction rate is below -5 %/s"),
        ("abs(q) > 0.1", "where abs(q) > 0.1"),
    ],
)  # fmt: skip
def test_a_query_reads_as_words(query, words):
    assert query_words(query) == words


def test_signals_of_ports_have_their_own_names_and_units(material) -> None:
    """What a simulator calls `u` is no valve command, `x` no stroke in mm, and `h1` no signal of a muscle 1."""
    ports = [Port("u", "input", "V"), Port("x", "state", "m"), Port("h1", "state", "m"), Port("dP", "state")]
    query = "u > 1.5 and x < 0.02 and h1 >= 0.1 and dP > 0"
    tank = FunctionSimulator(lambda t, x, u, p: [0.0, 0.0, 0.0], ports)
    d = diagnosis_of("cause", material)
    part = d.equations[0].equation
    region = Region(part, query, 0.9, 0.1)
    d = replace(d, nominal=tank, corrected=None, regions=[region])
    said = "u is above 1.5 V, x is below 0.02 m, h1 is above 0.1 m and dP is above 0"
    assert said in answers(d).where and "u is above 1.5" in report_html(d) and "valve command" not in report_html(d)
    assert "valve command" in query_words("u > 1.5"), "elsewhere it is one"


@pytest.mark.parametrize(("coefficient", "names"), [(1.21, 1), (2.4, 2)])
def test_damping_that_is_too_small_is_viscous_friction_and_said_once(coefficient: float, names: int) -> None:
    """Of the same size they are one thing, which the report says in the quantity of the model, beside its own."""
    words = Words(
        ports={"knee": "N m"}, joints=frozenset({"knee"}),
        numbers={"dof_damping.knee": ModelParameter(2.0, 0.1, "N m s/rad")},
    )  # fmt: skip
    off = {"deviation": ParameterEstimate(0.6, "-", (0.55, 0.65))}
    friction = {"coefficient": ParameterEstimate(coefficient, "N m s/rad", (0.9 * coefficient, 1.1 * coefficient))}
    cause = Cause(
        ("parameter_deviation", "viscous_friction"), "knee", 0.5, 0.9, (0.8, 0.95), off,
        where=("dof_damping.knee", "knee"), others=(friction,),
    )  # fmt: skip
    assert cause_names(cause, words) == ["damping of knee", "viscous friction at knee"][:names]
    told = size(cause, words)
    assert told.startswith("3.2 N m s/rad (") and told.endswith("instead of the simulator's 2 N m s/rad")


def test_a_size_at_a_port_without_a_unit_is_no_share() -> None:
    assert shown_unit("actuator_dead_zone", "width", "-", "F") == ""
    assert shown_unit("actuator_dead_zone", "width", "-") == "-"  # that of a bench, in per cent
    assert amount(1.04, "") == "1.04" and amount(1.04, "-") == "104 %"


def test_parameters_of_creep_are_told_in_words() -> None:
    assert parameter("settled") == "relaxed share of the springs at the start of a run"
    assert parameter("unknown") == "unknown share of the initial state"


def test_intervals_that_data_do_not_bound_are_said_to_be_open():
    assert span(1.0, np.inf, "N") == "from 1 N, no upper bound"
    assert span(-np.inf, np.inf, "N") == "not bounded by this log"
    assert span(1e-6, 2e-6, "kg/s") == "1 to 2 mg/s"
    assert span(5.998, 6.003, "N") == "5.998 to 6.003 N"
    assert [share_span(*e) for e in ((1.0, 1.0), (0.9996, 0.9999), (0.991, 0.993), (0.9, 1.0))] == [
        "100 %", "over 99.9 %", "99.1 to 99.3 %", "90 to 100 %",
    ]  # fmt: skip
    assert amount(np.nan, "N") == "unknown"
    assert [percent(s) for s in (0.0, 0.001, 0.5, 0.999, 1.0)] == ["0 %", "under 1 %", "50 %", "over 99 %", "100 %"]
    assert [at_least(s) for s in (0.97, 0.999)] == ["97 % or more", "over 99 %"]


def test_a_value_lies_in_the_interval_printed_beside_it():
    assert interval_of(0.9655, 0.96502, 0.966) == "96.5 % (90 % interval 96.5 to 96.6 %)"
    assert interval_of(0.97, 0.93, 0.98) == "97 % (90 % interval 93 to 98 %)"
    assert interval_of(0.003, 0.0025, 0.0035) == "0.3 % (90 % interval 0.2 to 0.4 %)"
    assert amount_within(0.293061, 0.293055, 0.293067, "N") == "0.29306 N"
    assert amount_within(0.29306, 0.28, 0.31, "N") == amount_within(0.29306, 0.28, np.inf, "N") == "0.293 N"
    rng = np.random.default_rng(0)
    for middle, half in zip(rng.uniform(0.02, 0.98, 300), 10 ** rng.uniform(-5, -2, 300), strict=True):
        low, high = middle - half, middle + half
        for text, ends in (
            (interval_of(middle, low, high), share_span(low, high)),
            (amount_within(middle, low, high), span(low, high)),
        ):
            first, last = (float(end) for end in ends.removesuffix(" %").split(" to "))
            assert first <= float(text.split()[0]) <= last, (middle, low, high)


def test_an_error_of_a_signal_without_a_unit_is_no_share():
    assert error_size(0.0085, "-") == "0.0085" and error_size(0.0085, "K") == "0.0085 K"
    assert amount(0.0085, "-") == "0.85 %"


def test_sentences_survive_a_diagnosis_with_nothing_in_it(diagnoses):
    bare = replace(
        diagnoses["cause"], equations=[], regions=[], bands=[], trajectories=[], candidates=[], closure=[], notes=[],
        windows=diagnoses["cause"].windows.iloc[:0],
    )  # fmt: skip
    for verdict in VERDICTS:
        d = replace(bare, verdict=verdict, causes=diagnoses[verdict].causes, p_value=np.nan)
        assert all(answers(d))
        d = replace(d, nominal=None, corrected=None)  # as of a model that is no bench
        assert "<h1>" in report_html(d)


# --- the page -----------------------------------------------------------------------------------------------
class Reader(html.parser.HTMLParser):
    """Collects what a page asks for and whether its tags close."""

    VOID = ("meta", "br", "path", "use", "image", "rect", "line", "link", "img")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.tags: list[str] = []
        self.text: list[str] = []
        self.charts: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)
        for key, value in attrs:
            if key == "id":
                self.ids.append(value)
            if key in ("href", "src", "xlink:href", "action", "srcset", "poster", "data"):
                self.links.append(value)
            if key == "aria-label" and tag == "svg":
                self.charts.append(value)
            assert not key.startswith("on"), key

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        if tag not in self.VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        if not self.open or self.open[-1] != "style":
            self.text.append(data)


def read(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    reader.close()
    assert not reader.open
    return reader


@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_page_is_whole_and_asks_for_nothing(pages, diagnoses, verdict):
    page = pages[verdict]
    reader = read(page)
    assert "script" not in reader.tags
    assert all(link.startswith(("#", "data:image/png;base64,")) for link in reader.links)
    assert not re.search(r"https?:|//[a-z]|@import|url\((?!#)", re.sub(r"base64,[\w+/=\s]+", "", page))
    assert len(reader.ids) == len(set(reader.ids))
    targets = {link[1:] for link in reader.links if link.startswith("#")}
    assert targets <= set(reader.ids), "a link that leads nowhere"
    text = " ".join("".join(reader.text).replace("\u00a0", " ").split())
    told = answers(diagnoses[verdict])
    assert told.verdict in text
    assert told.how_far in text
    assert reader.charts
    assert all(reader.charts)
    assert "nan" not in text.lower().split()
    assert 'content="width=device-width' in page
    assert 'lang="en"' in page
    assert page.count('tabindex="0"') == page.count('class="table"'), "what scrolls is reached by keys"


def test_the_page_holds_what_was_asked_for(pages):
    text = "".join(read(pages["class"]).text).replace("\u00a0", " ")
    for word in (
        "Where the gap lies", "eps1 > 0.138 and deps1 > 0", "triangle-4-20", "What to record next", "hysteresis",
        "more candidates that were ruled out", "closes 31 % where the best closes 95 %", "presliding", "no upper bound",
        "The noise floor rests on", "0 to 2", "logs/sim.toml",
    ):  # fmt: skip
        assert word in text, word
    shown = {name for name in re.findall(r'<section id="([\w-]+)"', pages["class"])}
    # Rounds and days are shown where there are several logs.
    assert shown == {s.name for s in all_sections()} - {"logs", "rounds"}
    assert "next" not in re.findall(r'<section id="([\w-]+)"', pages["cause"])


HOSTILE = "<script>alert(1)</script>\"'&$\\frac{x$</svg><!-- --> {{ 7 * 7 }} \u202e"


def test_text_from_logs_and_files_stays_text(diagnoses):
    d = diagnoses["unknown"]
    windows = d.windows.assign(trajectory=d.windows["trajectory"].replace("sine-4-15", HOSTILE))
    bad = replace(
        d,
        windows=windows,
        trajectories=[TrajectoryShare(HOSTILE, 0.9)],
        regions=[Region("force", HOSTILE, 0.9, 0.1)],
        candidates=[replace(d.candidates[0], ruled_out=HOSTILE), *d.candidates[1:]],
        notes=[HOSTILE],
        leftover={"form": HOSTILE, "depends_on": [HOSTILE]},
        next_run=NextExperiment({"kind": HOSTILE, "angle": HOSTILE}, (HOSTILE, "b"), 1.0, HOSTILE),
    )
    page = report_html(bad, Source(HOSTILE, HOSTILE, 1, 1, HOSTILE))
    reader = read(page)
    assert "script" not in reader.tags
    text = "".join(reader.text)
    assert text.count("<script>alert(1)</script>") >= 8
    assert "{{ 7 * 7 }}" in text
    assert "49" not in re.findall(r"\{\{.*?\}\}|\b49\b", text)
    assert "<script" not in page
    shown = GapDisplay(bad)._repr_html_()
    assert "<script" not in shown


def test_the_page_is_the_same_each_time(diagnoses, pages):
    assert report_html(diagnoses["none"], Source("logs/data.parquet", "logs/sim.toml", 5400, 4)) == pages["none"]


def test_an_effect_at_two_ports_is_the_answer_at_one(diagnoses):
    d = diagnoses["cause"]
    [name] = d.causes[0].effects
    candidates = [replace(c, where="knee") if c.effect == name else c for c in d.candidates]
    candidates.append(replace(next(c for c in candidates if c.effect == name), where="hip", confidence=0.01))
    d = replace(d, causes=[replace(d.causes[0], where=("knee",))], candidates=candidates)
    rows = {r["name"]: r["told"] for r in WhichSection(d, Source()).content()["first"]}
    words = name.replace("_", " ")
    told = {k.lower(): v for k, v in rows.items() if words in k.lower()}
    assert told == {f"{words} at knee": True, f"{words} at hip": False}


def test_a_log_with_few_windows_still_gives_a_page(diagnoses):
    d = diagnoses["cause"]
    few = d.windows.groupby("equation").head(3)
    for windows in (d.windows.iloc[:0], few, few.assign(deps=np.nan, P=np.nan).drop(columns=["u", "dP"])):
        read(report_html(replace(d, windows=windows)))


def test_a_report_is_written_whole_or_not_at_all(diagnoses, tmp_path, monkeypatch):
    bare = replace(diagnoses["none"], windows=diagnoses["none"].windows.iloc[:0])
    target = write_report(bare, tmp_path / "report.html")
    before = target.read_text(encoding="utf-8")
    with pytest.raises(OutputError, match="cannot be written"):
        write_report(bare, tmp_path / "nowhere" / "report.html")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.replace", full)
    with pytest.raises(OutputError, match="No space left"):
        write_report(replace(bare, verdict="unknown"), target)
    assert target.read_text(encoding="utf-8") == before
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_a_designed_run_of_a_system_is_said_in_units():
    from pamid.gap import NextExperiment
    from pamid.report.sentences import experiment

    motion = {"kind": "run", "seconds": 80.0, "x": 0.03, "P": 3e5, "P_amplitude": 1e4, "P_frequency": 0.5}
    text = experiment(NextExperiment(motion, ("creep", "directional_friction and maxwell"), 12.0))
    assert "(80 s, stroke held at 30 mm, pressure, absolute 3 bar ± 0.1 bar at 0.5 rad/s)" in text
    assert "distinguishes creep from directional friction and Maxwell" in text


def test_the_report_counts_its_sections(diagnoses: dict[str, Diagnosis]) -> None:
    class Counted(list[str]):
        total = 0

        def __call__(self, name: str) -> None:
            self.append(name)

        def expect(self, total: int) -> None:
            self.total = total

    counted = Counted()
    report_html(diagnoses["cause"], progress=counted)
    assert counted.total == len(counted) > 3 and "answer" in counted
