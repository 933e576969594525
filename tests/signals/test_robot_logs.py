"""Logs of robots: MCAP, rosbag and ULog, written here and read as one table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.robot_logs import bag, mcap_log, ulog

from pamid.errors import LogFormatError, TruncatedLogError
from pamid.signals import read_log

COLUMNS = {
    "signals": {"time": "time", "angle": {"column": "/joint.position[0]"}, "volts": {"column": "/command.volts"}}
}


def test_topics_of_an_mcap_become_columns_of_one_table(tmp_path: Path) -> None:
    t = mcap_log(tmp_path / "run.mcap")
    log = read_log(tmp_path / "run.mcap", COLUMNS)
    assert np.allclose(log["time"], t[:96], atol=1e-9)  # up to the last message of the slower topic
    assert np.allclose(log["angle"], 0.1 * np.arange(96)) and np.allclose(log["volts"], 2.0 * np.arange(96))
    data = (tmp_path / "run.mcap").read_bytes()
    (tmp_path / "half.mcap").write_bytes(data[: len(data) // 2])
    with pytest.raises(TruncatedLogError):
        read_log(tmp_path / "half.mcap", COLUMNS)


def test_messages_of_ros_2_are_decoded(tmp_path: Path) -> None:
    writer_of = pytest.importorskip("mcap_ros2.writer")
    with (tmp_path / "ros.mcap").open("wb") as stream:
        writer = writer_of.Writer(stream)
        schema = writer.register_msgdef("test_msgs/msg/Joint", "float64 angle\nfloat64[2] effort")
        for k in range(20):
            said = {"angle": 0.1 * k, "effort": [0.0, 3.0 * k]}
            writer.write_message("/joint", schema, said, log_time=10_000_000 * k, publish_time=10_000_000 * k)
        writer.finish()
    columns = {"signals": {"time": "time", "angle": {"column": "/joint.angle"}, "F": {"column": "/joint.effort[1]"}}}
    log = read_log(tmp_path / "ros.mcap", columns)
    assert np.allclose(log["angle"], 0.1 * np.arange(20)) and np.allclose(log["F"], 3.0 * np.arange(20))


@pytest.mark.parametrize("ros", [1, 2])
def test_topics_of_a_rosbag_become_columns_of_one_table(ros: int, tmp_path: Path) -> None:
    path = bag(tmp_path, ros)
    columns = {"signals": COLUMNS["signals"] | {"volts": {"column": "/command.data"}}}
    log = read_log(path, columns)
    assert np.allclose(log["time"], 0.01 * np.arange(56), atol=1e-9)
    assert np.allclose(log["angle"], 0.1 * np.arange(56)) and np.allclose(log["volts"], 2.0 * np.arange(56))
    half = path.with_name("half" + path.suffix)
    half.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    if ros == 2:
        half.replace(path)
        half = path
    with pytest.raises(TruncatedLogError):
        read_log(half, columns)
    (tmp_path / "alone.db3").write_bytes(b"SQLite format 3\0" + bytes(100))
    with pytest.raises(LogFormatError, match="metadata"):
        read_log(tmp_path / "alone.db3", columns)


def test_topics_of_a_ulog_become_columns_of_one_table(tmp_path: Path) -> None:
    pytest.importorskip("pyulog")
    ulog(tmp_path / "flight.ulg")
    columns = {"signals": {"time": "time", "one": {"column": "servo.angle"}, "two": {"column": "servo_1.angle"}}}
    log = read_log(tmp_path / "flight.ulg", columns)
    assert np.allclose(log["time"], 0.01 * np.arange(50)) and np.allclose(log["one"], 0.5 * np.arange(50))
    assert np.allclose(log["two"], np.arange(50))
