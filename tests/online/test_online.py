"""Streams: estimates follow, alarms name what drifts, and bad samples are survived."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
import threading
import time
from pathlib import Path
from unittest import mock

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import JointPIHM, OnlineAdapter, StaticPIHM
from sklearn.frozen import FrozenEstimator

from pamid import load, save
from pamid.bench import BenchParameters
from pamid.cli import main
from pamid.effects import Signals, make_effect
from pamid.errors import IncompatibleError, LogNotFoundError, MissingColumnError, ParameterError
from pamid.laws.quasi_static import QuasiStaticForce
from pamid.laws.thermodynamic import ThermodynamicFlow
from pamid.online import DriftAlarm, GapMonitor, RecursiveEstimate, StreamedEffect, threshold
from pamid.online.lines import LONGEST_LINE, lines
from pamid.online.stream import HALF_WIDTH, Samples
from pamid.signals.state import State
from pamid.volume import volume_class

BENCH = BenchParameters.for_muscle("B")
PLANT = BENCH.plant()
VOLUME = volume_class("chou_hannaford")(0.2, 0.02, BENCH.muscle.braid_angle)
LAWS = [QuasiStaticForce(0.2), ThermodynamicFlow()]
KINDS = {"leakage": ("mdot", "flow"), "coulomb_friction": ("F", "force"), "viscous_friction": ("F", "force")}


def stream(seconds: float, seed: int = 0, start: float = 0.0) -> pd.DataFrame:
    """A muscle at work whose volume is known, with the noise of the bench's sensors."""
    t = start + np.arange(int(seconds * 1000)) * 1e-3
    rng = np.random.default_rng(seed)
    eps = 0.12 + 0.04 * np.sin(5.0 * t) + 0.02 * np.sin(8.3 * t + 1)
    deps = 0.2 * np.cos(5.0 * t) + 0.166 * np.cos(8.3 * t + 1)
    P, dP = 3e5 + 8e4 * np.sin(3.1 * t), 2.48e5 * np.cos(3.1 * t)
    state = State(eps, deps, P, dP)
    jet = VOLUME.jet(state)
    F, mdot = (law.predict(*jet, state) for law in LAWS)
    return pd.DataFrame(
        {
            **{"time": t, "eps": eps, "deps": deps, "P": P, "dP": dP},
            **{"F": F + rng.normal(0, 0.1, len(t)), "mdot": mdot + rng.normal(0, 3e-6, len(t))},
        }
    )


def broken(table: pd.DataFrame, effect: str, since: float, **values: float) -> pd.DataFrame:
    """The same with an effect since a moment."""
    made, out = make_effect(effect, **values), table.copy()
    column, equation = KINDS[effect]
    s = Signals(*(table[c].to_numpy() for c in ("time", "eps", "deps", "P", "dP")))
    memory = made.trace(s, PLANT, 1e-3, np.zeros(1, dtype=int))
    share = made.force(s, memory, PLANT) if equation == "force" else made.flow(s, memory, PLANT).a
    out[column] += np.where(table["time"] > since, share, 0.0)
    return out


# --- the filter ---------------------------------------------------------------------------------------------
def test_blocks_tell_what_least_squares_tells():
    rng = np.random.default_rng(0)
    H, truth = rng.normal(size=(400, 3)), np.array([1.0, -2.0, 0.5])
    y = H @ truth + rng.normal(0, 0.1, 400)
    estimate = RecursiveEstimate(np.zeros(3), np.full(3, 100.0), np.inf)
    for i in range(0, 400, 7):
        estimate.update(H[i : i + 7], y[i : i + 7], 0.1)
    A = H.T @ H / 0.01 + np.eye(3) / 100.0**2
    assert np.allclose(estimate.value, np.linalg.solve(A, H.T @ y / 0.01), rtol=1e-9)
    assert np.allclose(estimate.covariance, np.linalg.inv(A), rtol=1e-7)


def test_forgetting_follows_and_stays_bounded():
    estimate = RecursiveEstimate([0.0], [3.0], memory=200.0)
    for k in range(100):
        estimate.update(np.ones((20, 1)), np.full(20, 1.0 if k < 50 else 2.0), 0.5)
    assert estimate.value[0] == pytest.approx(2.0, abs=0.02)
    for _ in range(500):
        estimate.update(np.zeros((20, 1)), np.zeros(20), 0.5)  # samples that say nothing
    assert estimate.uncertainty[0] == pytest.approx(3.0)


def test_outliers_are_left_out_and_a_change_is_not():
    estimate = RecursiveEstimate([1.0], [1.0], np.inf)
    estimate.update(np.ones((100, 1)), np.ones(100), 0.1)
    y = np.ones(20)
    y[3], y[7] = 500.0, np.nan
    kept = estimate.update(np.ones((20, 1)), y, 0.1)
    assert kept.tolist() == [k not in (3, 7) for k in range(20)]
    assert estimate.value[0] == pytest.approx(1.0)
    assert estimate.update(np.ones((20, 1)), np.full(20, 9.0), 0.1).all()


def test_a_jump_is_followed_at_once_and_a_disturbance_is_not():
    """Two blocks in a row that say so are a jump, however long the memory; a single one is left out."""
    rng = np.random.default_rng(3)
    estimate = RecursiveEstimate([1.0, 0.0], [0.5, 0.5], memory=1e5)

    def block(value: list[float]) -> None:
        H = rng.normal(size=(20, 2))
        estimate.update(H, H @ value + rng.normal(0.0, 0.1, 20), 0.1)

    for _ in range(200):
        block([1.0, 0.2])
    before = estimate.value
    assert np.allclose(before, [1.0, 0.2], atol=0.01)
    block([1.3, 0.2])
    assert np.array_equal(estimate.value, before)
    block([1.0, 0.2])
    assert np.allclose(estimate.value, before, atol=0.01)
    block([1.3, 0.2])
    block([1.3, 0.2])
    assert np.allclose(estimate.value, [1.3, 0.2], atol=0.08)
    for _ in range(20):
        block([1.3, 0.2])
    assert np.allclose(estimate.value, [1.3, 0.2], atol=0.02)


def test_a_steady_stream_holds_no_jumps():
    """The odds of a jump keep white noise from being one, also where a short stretch tells the noise by half."""
    rng, moved = np.random.default_rng(4), 0
    estimate = RecursiveEstimate([1.0], [0.3], memory=1e4, scatter=np.full(2, 20.0))
    for k in range(2000):
        before = estimate.uncertainty[0]
        estimate.update(np.ones((20, 1)), 1.0 + rng.normal(0.0, 0.1, 20), 0.05)
        moved += k > 10 and estimate.uncertainty[0] > 1.1 * before
    assert moved == 0
    assert estimate.scatter[0] / estimate.scatter[1] == pytest.approx(4.0, rel=0.05)


def test_false_alarms_keep_to_their_rate():
    """White residuals of an hour of 1 kHz, at a rate at which alarms can be counted."""
    rng, rate = np.random.default_rng(1), 60.0
    alarm = DriftAlarm([False, True], memory=500.0, hold=20, limit=threshold(rate, 0.5, 2))
    H = rng.normal(size=(20, 2))
    alarms, on = 0, False
    for _ in range(3600 * 50 // 4):  # a quarter of an hour
        raised = alarm.update(H, rng.normal(size=20), 1.0) is not None
        alarms, on = alarms + (raised and not on), raised
    assert alarms <= 30


@pytest.mark.parametrize("name", ["coulomb_friction", "hysteresis", "viscous_friction", "heat_transfer", "leakage"])
def test_an_effect_in_blocks_is_the_effect_along_a_log(name):
    table = stream(1.5)
    effect = make_effect(name)
    equation = "force" if "force" in effect.hooks() else "flow"
    values = np.array([effect.values[n] for n in StreamedEffect(effect, equation, PLANT, 1e-3).names])

    def shares(size: int) -> np.ndarray:
        streamed, out = StreamedEffect(effect, equation, PLANT, 1e-3), []
        for i in range(0, len(table), size):
            part = State(*(table[c].to_numpy()[i : i + size] for c in State._fields))
            other = StreamedEffect(effect, equation, PLANT, 1e-3)
            other.recall(streamed.state)
            out.append(other.linearised(part, values)[0])
            streamed = other
        return np.concatenate(out)

    s = Signals(*(table[c].to_numpy() for c in ("time", "eps", "deps", "P", "dP")))
    memory = effect.trace(s, PLANT, 1e-3, np.zeros(1, dtype=int))
    if equation == "force":
        expected = effect.force(s, memory, PLANT)
    else:
        step = effect.flow(s, memory, PLANT)
        expected = step.a + step.b * s.pressure_rate
    assert np.ptp(expected) > 0
    for size in (1500, 64):
        assert np.allclose(shares(size), expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


# --- the monitor --------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def monitor_of():
    healthy = stream(20.0)

    def make(**settings) -> GapMonitor:
        return GapMonitor(VOLUME, LAWS, PLANT, **settings).calibrate(healthy)

    return make


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("leakage", {"conductance": 5e-11}),
        ("coulomb_friction", {"amplitude": 2.0}),
        ("viscous_friction", {"coefficient": 15.0}),
    ],
)
def test_what_appears_is_named_in_time(monitor_of, effect, values):
    table = broken(stream(8.0, seed=1, start=20.0), effect, 23.0, **values)
    monitor = monitor_of()
    found = [f for i in range(0, len(table), 250) for f in monitor.update(table[i : i + 250])]
    assert found
    assert found[0].effect == effect
    assert 23.0 < found[0].time < 25.0
    wanted = next(iter(values.values()))
    assert found[-1].value == pytest.approx(wanted, rel=0.1)
    assert found[-1].effect == effect


def test_a_healthy_stream_is_left_alone(monitor_of):
    monitor = monitor_of()
    assert monitor.update(stream(20.0, seed=3, start=20.0)) == []


def test_bad_samples_raise_no_alarm(monitor_of):
    table = stream(8.0, seed=4, start=20.0)
    table.loc[1000:1300, ["F", "mdot"]] = np.nan
    table.loc[2000:2200, "eps"] = np.nan
    table.loc[[3000, 3500, 4000], "F"] = 1e4
    monitor = monitor_of()
    assert monitor.update(table[:5000]) == []
    monitor.restart()
    assert monitor.update(table[5000:]) == []


@pytest.mark.parametrize("channel", ["F", "mdot", "P", "eps"])
def test_a_stuck_sensor_is_told_and_is_no_finding(monitor_of, channel):
    table = stream(8.0, seed=6, start=20.0)
    if channel in ("eps", "P"):  # a reading has noise, and a rate that belongs to it
        table[channel] += np.random.default_rng(0).normal(0, 1e-9, len(table)) * table[channel].abs().max()
    late = table["time"].between(22.0, 25.0)
    table.loc[late, channel] = table[channel][2000]
    if rate := {"eps": "deps", "P": "dP"}.get(channel):
        table.loc[late, rate] = 0.0
    monitor, stuck = monitor_of(), {}
    for i in range(0, len(table), 100):
        assert monitor.update(table[i : i + 100]) == []
        stuck |= monitor.stuck
    assert list(stuck) == [channel]
    assert stuck[channel] == pytest.approx(22.0, abs=0.021)
    assert monitor.stuck == {}, "it moves again"


def test_what_no_effect_explains_is_unknown(monitor_of):
    table = stream(8.0, seed=5, start=20.0)
    late = table["time"] > 22.0
    table.loc[late, "F"] += 3.0 * np.sign(np.sin(200.0 * table["time"][late]))
    found = monitor_of().update(table)
    assert found
    assert {f.effect for f in found} == {"unknown"}


def test_a_monitor_says_what_it_needs():
    monitor = GapMonitor(VOLUME, LAWS, PLANT)
    with pytest.raises(ParameterError, match="not calibrated"):
        monitor.update(stream(1.0))
    with pytest.raises(MissingColumnError, match="mdot"):
        monitor.calibrate(stream(2.0).drop(columns="mdot"))
    with pytest.raises(IncompatibleError, match="adds nothing to the force"):
        StreamedEffect(make_effect("valve_lag"), "force", PLANT, 1e-3)


# --- the adapter --------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def source():
    table = stream(12.0)
    model = StaticPIHM(hidden_layer_sizes=(8,), max_iter=20, random_state=0)
    return FrozenEstimator(model.fit(table[list(State._fields)][::20], table["F"][::20]))


def test_the_adapter_follows_ages_and_tells_which(source, tmp_path):
    effects = ("viscous_friction", ("coulomb_friction", {"presliding": 3e-4}))
    X, healthy = list(State._fields), stream(15.0)
    online = OnlineAdapter(source, effects, plant=PLANT, forgetting_time=3.0).fit(healthy[X], healthy["F"])
    assert online.parameter_names_[:3] == ["scale", "viscous_friction.coefficient", "coulomb_friction.amplitude"]
    assert online.values_[0] == pytest.approx(1.0, abs=0.01)
    assert 0.08 < online.noise_ < 0.6, "the noise of the sensor and what the model leaves"
    calm = stream(5.0, seed=1, start=15.0)
    online.partial_fit(calm[X], calm["F"])
    assert online.alarms_ == []
    table = broken(stream(12.0, seed=2, start=20.0), "coulomb_friction", 21.0, amplitude=3.0)
    again = load(save(online, tmp_path / "online.pamid"))
    for i in range(0, len(table), 500):
        for model in (online, again):
            model.partial_fit(table[X][i : i + 500], table["F"][i : i + 500])
    assert np.array_equal(online.values_, again.values_), "a saved adapter goes on as the one that was saved"
    assert online.alarms_[0]["parameter"] == "coulomb_friction.amplitude"
    assert online.alarms_[0]["time"] - 6.0 < 2.0
    assert online.values_[2] == pytest.approx(3.0, abs=0.3)
    assert online.uncertainty_[2] < 0.5
    late = table[-4000:]
    error = online.predict(late[X]) - late["F"]
    assert np.sqrt(np.mean(error[500:] ** 2)) < 1.6 * online.noise_, (
        "the bristles' state at its beginning is not known to a prediction"
    )


def test_a_stuck_sensor_and_gaps_are_left_out(source):
    X, healthy = list(State._fields), stream(10.0)
    online = OnlineAdapter(source, forgetting_time=2.0).fit(healthy[X], healthy["F"])
    table = stream(4.0, seed=1, start=10.0)
    F = table["F"].to_numpy().copy()
    F[1000:2000] = F[1000]
    F[2500:2600] = np.nan
    before = online.values_.copy()
    online.partial_fit(table[X], F)
    assert online.n_samples_seen_ == 4000
    assert 1000 <= online.n_rejected_ <= 1200
    assert np.allclose(online.values_, before, atol=0.01)
    assert online.alarms_ == []


def test_the_state_does_not_grow(source):
    X, table = list(State._fields), stream(4.0)
    online = OnlineAdapter(source, ("coulomb_friction",), plant=PLANT).fit(table[X], table["F"])

    def size() -> int:
        return sum(np.asarray(v).size for v in vars(online).values() if not isinstance(v, (str, type(None))))

    online.partial_fit(table[X], table["F"])
    first = size()
    for _ in range(5):
        online.partial_fit(table[X], table["F"])
    assert size() == first


def test_an_adapter_says_what_it_needs(source):
    table = stream(2.0)
    X = table[list(State._fields)]
    with pytest.raises(ParameterError, match="no plant"):
        OnlineAdapter(source, ("leakage",)).fit(X, table["F"])
    with pytest.raises(ParameterError, match="forgetting_time=-1"):
        OnlineAdapter(source, forgetting_time=-1).fit(X, table["F"])
    both = JointPIHM(hidden_layer_sizes=(4,), max_iter=2, random_state=0, validation_fraction=0)
    both.fit(X[::20], table[["F", "mdot"]].to_numpy()[::20])
    with pytest.raises(IncompatibleError, match="force and flow together"):
        OnlineAdapter(FrozenEstimator(both)).fit(X, table["F"])


# --- the stream ---------------------------------------------------------------------------------------------
def as_lines(table: pd.DataFrame, columns=("time", "eps", "P", "F", "mdot")) -> list[bytes]:
    return [json.dumps(row).encode() for row in table[list(columns)].to_dict("records")]


def test_samples_come_out_as_they_went_in():
    table = stream(1.0)
    samples = Samples(("eps", "P", "F"))
    blocks = [b for line in as_lines(table) for b in samples.take(line)] + samples.end()
    got = {k: np.concatenate([t[k] for _, t in blocks]) for k in blocks[0][1]}
    inner = slice(HALF_WIDTH, -HALF_WIDTH)
    for name in ("time", "eps", "P", "F"):
        assert np.array_equal(got[name], table[name][inner])
    for name in ("deps", "dP"):
        assert np.allclose(got[name], table[name][inner], atol=2e-3 * np.abs(table[name]).max())
    assert [begins for begins, _ in blocks] == [True] + [False] * (len(blocks) - 1)
    assert not any(samples.problems.values())


def test_bad_lines_are_counted_and_survived():
    rows = as_lines(stream(2.0))
    rows[100] = rows[100][:-7]  # cut off
    rows[200] = b"[1, 2]"
    rows[300] = b'{"time": "now", "eps": 0.1}'
    rows[301] = b"\xff\xfe"
    rows[400], rows[401] = rows[401], rows[400]  # out of order
    rows[500] = json.dumps({**json.loads(rows[500]), "F": None}).encode()
    del rows[600:650]
    samples = Samples(("eps", "P", "F"))
    blocks = [b for line in rows for b in samples.take(line)] + samples.end()
    counts = {"malformed": 4, "late": 1, "gap": 1, "restart": 0, "missing": 1, "lost": 5, "glitch": 0}
    assert samples.problems == counts
    for _, table in blocks:
        assert np.allclose(np.diff(table["time"]), 1e-3, atol=1e-9), "no block crosses a gap, and none has a hole"
    again = samples.take(rows[0])  # the logger was started anew
    assert samples.problems["restart"] == 1
    assert again == []


def test_a_line_that_is_being_written_is_not_read(tmp_path):
    file = tmp_path / "grows.jsonl"
    file.write_bytes(b'{"time": 0}\n{"ti')
    seen: list[bytes] = []

    def read() -> None:
        seen.extend(line for line in lines(file, follow=True, poll=0.01, patience=2.0) if line is not None)

    reader = threading.Thread(target=read)
    reader.start()
    for _ in range(150):
        if seen:
            break
        time.sleep(0.01)
    assert seen == [b'{"time": 0}']
    with file.open("ab") as stream_:
        stream_.write(b'me": 1}\n')
    reader.join(timeout=10)
    assert seen == [b'{"time": 0}', b'{"time": 1}']
    with pytest.raises(LogNotFoundError):
        next(lines(tmp_path / "none.jsonl"))
    (tmp_path / "long").write_bytes(b"x" * 3_000_000 + b'\n{"time": 2}\n')
    cut, whole = list(lines(tmp_path / "long"))
    assert len(cut) <= LONGEST_LINE
    assert whole == b'{"time": 2}'


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("watch")
    table = broken(stream(16.0), "leakage", 12.0, conductance=1e-10)
    rows = as_lines(table)
    rows[11_000] = b"{"
    (folder / "samples.jsonl").write_bytes(b"\n".join(rows) + b"\n")
    BENCH.to_toml(folder / "sim.toml")
    return folder / "samples.jsonl", folder / "sim.toml"


def test_watch_names_the_leak(recorded, capsys):
    file, sim = recorded
    assert main(["watch", str(file), "--sim", str(sim), "--learn", "10", "--json"]) == 0
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [e["event"] for e in events][:2] == ["learnt", "finding"]
    found = [e for e in events if e["event"] == "finding"]
    assert found[0]["effect"] == "leakage"
    assert 12.0 < found[0]["time"] < 14.0
    assert found[0]["confirm"]
    assert found[0]["run"]["seconds"] > 0.0
    assert events[-1]["problems"] == {"malformed": 1, "lost": 1}


def test_watch_says_once_what_goes_on_in_two_equations(recorded, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("pamid.gap.design.confirm.confirming", lambda *args, **options: None)  # takes most of the time
    table = broken(stream(16.0), "leakage", 12.0, conductance=1e-10)
    table.loc[table["time"] > 12.0, "F"] *= 1.2
    (tmp_path / "samples.jsonl").write_bytes(b"\n".join(as_lines(table)) + b"\n")
    assert main(["watch", str(tmp_path / "samples.jsonl"), "--sim", str(recorded[1]), "--learn", "10", "--json"]) == 0
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    said = [(e["equation"], e["effect"]) for e in events if e["event"] == "finding"]
    assert {equation for equation, _ in said} == {"force", "flow"}
    assert len(said) == len(set(said))


def test_watch_tells_a_stuck_sensor(recorded, tmp_path, capsys):
    table = stream(6.0)
    table.loc[table["time"] > 4.0, "F"] = table["F"][4000]
    (tmp_path / "samples.jsonl").write_bytes(b"\n".join(as_lines(table)) + b"\n")
    assert main(["watch", str(tmp_path / "samples.jsonl"), "--sim", str(recorded[1]), "--learn", "3"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert next(line for line in said if "sensor of F is stuck" in line).split()[0] in ("4.00", "4.01", "4.02")
    assert said[-1].startswith("end: 5980 samples, findings: 0")


def test_watch_reads_a_pipe_and_says_what_is_wrong(recorded, capsys):
    file, sim = recorded
    head = b"".join(line + b"\n" for line in file.read_bytes().splitlines()[:3000])
    with mock.patch.object(sys, "stdin", mock.Mock(buffer=io.BytesIO(head))):
        assert main(["watch", "-", "--sim", str(sim), "--learn", "2"]) == 0
    said = capsys.readouterr().out
    assert "learnt from" in said
    assert said.splitlines()[-1].startswith("end: 2980 samples, findings: 0")
    assert main(["watch", "nowhere.jsonl", "--sim", str(sim)]) == 2
    assert "There is no file" in capsys.readouterr().err


def test_a_watch_that_is_killed_leaves_nothing(recorded, tmp_path):
    file, sim = recorded
    call = "from pamid.cli import main; main()"
    command = [sys.executable, "-c", call, "watch", str(file), "--sim", str(sim), "--learn", "10", "--follow"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as watcher:
        assert watcher.stdout is not None
        assert b"learnt" in watcher.stdout.readline()
        watcher.kill()
    assert not list(tmp_path.iterdir())


def test_every_partial_fit_has_a_meaning():
    from pamid.estimators import all_estimators

    docs = Path(__file__).resolve().parents[2] / "docs"
    if not docs.is_dir():
        pytest.skip("needs the repository")
    page = (docs / "streaming.md").read_text(encoding="utf-8")
    explained = re.findall(r"^\| (\w+) \| ", page[page.index("## What `partial_fit` means") :], re.M)
    table = re.findall(r"^\| `(\w+)` \|.*\| (\w+) \| [^|]*\|$", (docs / "models.md").read_text(encoding="utf-8"), re.M)
    said = dict(table)
    assert set(said.values()) == set(explained) - {"guarantee"}
    assert [n for n, c in all_estimators() if hasattr(c, "partial_fit") and n not in said] == []
    assert (said["PolynomialForce"], said["Recurrent"], said["QAdapter"]) == ("exact", "runs", "source")
