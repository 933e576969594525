"""Logs of robots as people have them: lists in cells, commands and readings in two files, LeRobot, RTDE, JointState."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.errors import ReadingWarning
from pamid.signals import read_log
from pamid.signals.formats import RawTable
from pamid.signals.formats._lists import unfolded
from pamid.signals.formats._topics import Messages

ARM = {"signals": {"time": {"column": "timestamp", "unit": "us"}} | {
    f"{name}{k}": f"{file}.positions[{k}]" for name, file in (("q", "state"), ("u", "control")) for k in (0, 1)
}}  # fmt: skip
DELAY = 0.09


def wanted(t: np.ndarray) -> np.ndarray:
    """Return what two joints are commanded, shape (n, 2)."""
    return np.stack([0.3 * np.sin(4 * t) + 0.1 * np.sin(11 * t), 0.2 * np.cos(5 * t)], axis=1)


def arm_log(folder: Path, readings_at: float = 0.007) -> Path:
    """Write commands and readings with stamps of their own, in µs; readings follow later."""
    folder.mkdir(parents=True)
    when, t = 0.02 * np.arange(300), readings_at + 0.02 * np.arange(300)
    cells = lambda q: [str([round(float(x), 6) for x in row]) for row in q]  # noqa: E731
    commands = {"type": "CONTROL", "timestamp": 1e6 * when, "positions": cells(wanted(when))}
    state = {"type": "STATE", "timestamp": 1e6 * t, "positions": cells(wanted(t - DELAY)), "torques": cells(wanted(t))}
    pd.DataFrame(commands).to_csv(folder / "control.csv", index=False)
    pd.DataFrame(state).to_csv(folder / "state.csv", index=False)
    (folder / "event.csv").write_text("type,timestamp,event\nEVENT,0,START\nEVENT,5e6,STOP\n")
    (folder / "joint_list.txt").write_text("Rotation\nPitch\n")
    return folder


def test_commands_and_readings_of_two_files_are_one_run_joined_by_time(tmp_path: Path) -> None:
    folder = arm_log(tmp_path / "sines")
    with pytest.warns(
        ReadingWarning, match=r"control is joined with state .* 7 ms old .* lag commands by (89|90|91) ms"
    ):
        log = read_log([folder / "control.csv", folder / "state.csv"], ARM)
    assert list(log["trajectory"].unique()) == ["sines"] and len(log) == 300
    t = log["time"].to_numpy()
    assert np.allclose(log[["u0", "u1"]], wanted(t - 0.007), atol=1e-6), "a command holds until the next"
    assert np.allclose(log[["q0", "q1"]], wanted(t - DELAY), atol=1e-6)


def test_readings_of_another_name_that_follow_the_commands_tell_the_delay(tmp_path: Path) -> None:
    folder = arm_log(tmp_path / "sines")
    state = pd.read_csv(folder / "state.csv").rename(columns={"positions": "measured"})
    state.assign(torques=str([0.1, -0.2])).to_csv(folder / "state.csv", index=False)
    named = {"signals": {"time": {"column": "timestamp", "unit": "us"}, "q0": "measured[0]", "u0": "positions[0]"}}
    with pytest.warns(ReadingWarning, match=r"control is joined with state .* lag commands by (89|90|91) ms"):
        read_log([folder / "control.csv", folder / "state.csv"], named)


def test_folders_are_runs_and_what_is_no_table_of_samples_lies_beside_them(tmp_path: Path) -> None:
    folders = [arm_log(tmp_path / name) for name in ("sines", "steps")]
    with pytest.warns(ReadingWarning, match="in 2 runs"):
        log = read_log(folders, ARM)
    assert list(log["trajectory"].unique()) == ["sines", "steps"] and len(log) == 600


def test_files_of_the_same_columns_stay_runs_of_their_own(tmp_path: Path) -> None:
    t = 0.01 * np.arange(100)
    for name in ("control", "other"):
        pd.DataFrame({"time": t, "q": np.sin(t)}).to_csv(tmp_path / f"{name}.csv", index=False)
    assert sorted(read_log(tmp_path)["trajectory"].unique()) == ["control", "other"]
    pd.DataFrame({"time": t, "q": np.sin(t), "F": t}).to_csv(tmp_path / "another.csv", index=False)
    only = read_log(sorted(tmp_path.glob("*.csv")), {"signals": {"time": "time", "q": "q"}})
    assert only["trajectory"].nunique() == 3, "each file has what the mapping names"


def test_lists_of_uneven_length_or_text_stay_what_they_are() -> None:
    frame = pd.DataFrame({"a": ["[1, 2]", "[1]"], "b": ["[x]", "[y]"], "c": ["(1 2.5)", "(3 4e-1)"]})
    found = unfolded(frame)
    assert list(found.columns) == ["a", "b", "c[0]", "c[1]"]
    assert found["c[1]"].tolist() == [2.5, 0.4]


def test_a_lerobot_data_set_is_read_by_its_folder(tmp_path: Path) -> None:
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    (tmp_path / "meta").mkdir()
    (tmp_path / "data" / "chunk-000").mkdir(parents=True)
    names = {"observation.state": {"names": ["pan.pos", "lift.pos"]}, "action": {"names": {"motors": ["pan", "lift"]}}}
    (tmp_path / "meta" / "info.json").write_text(json.dumps({"features": names}))
    t = np.arange(60) / 30
    for k in range(2):
        lists = pa.FixedSizeListArray.from_arrays(pa.array(wanted(t).ravel()), 2)
        columns = {"action": lists, "observation.state": lists, "timestamp": t, "frame_index": np.arange(60)}
        table = pa.table({**columns, "episode_index": np.full(60, k)})
        pq.write_table(table, tmp_path / "data" / "chunk-000" / f"episode_{k:06d}.parquet")
    log = read_log(tmp_path)
    assert list(log["trajectory"].unique()) == ["0", "1"] and log["time"].max() == pytest.approx(59 / 30)
    assert np.allclose(log["observation.state[lift.pos]"][:60], wanted(t)[:, 1])
    assert np.allclose(log["action[pan]"][60:], wanted(t)[:, 0])


def test_rtde_counts_its_time_in_seconds(tmp_path: Path) -> None:
    rows = [f"{100 + 0.002 * k:.3f} {0.01 * k:.4f} {0.01 * k - 0.1:.4f}" for k in range(50)]
    (tmp_path / "rtde.csv").write_text("\n".join(["timestamp target_q_0 actual_q_0", *rows]))
    log = read_log(tmp_path / "rtde.csv")
    assert log["time"].iloc[-1] - log["time"].iloc[0] == pytest.approx(0.098)
    assert log["actual_q_0"].iloc[0] == pytest.approx(-0.1)


def test_joint_states_go_by_the_names_of_joints_whatever_their_order() -> None:
    found = Messages()
    for k in range(4):
        names = ["elbow", "wrist"] if k % 2 else ["wrist", "elbow"]
        said = {"name": names, "position": [1.0 if n == "elbow" else 2.0 for n in names], "velocity": []}
        found.add("/joint_states", 10_000_000 * k, said)
    fields = found.topics()["/joint_states"][1]
    assert {k: set(v) for k, v in fields.items()} == {"position[elbow]": {1.0}, "position[wrist]": {2.0}}


def test_a_table_of_lists_is_a_raw_table(tmp_path: Path) -> None:
    from pamid.signals.joining import sources
    from pamid.signals.mapping import LogMapping

    folder = arm_log(tmp_path / "sines")
    [(path, [table], zero)] = sources(sorted(folder.iterdir()), LogMapping.load(ARM), 2**30, [])
    assert path == folder and isinstance(table, RawTable) and zero is None
    assert {"state.positions[0]", "control.positions[1]", "torques[1]"} <= set(table.frame.columns)
