"""Logs of robots: MCAP, rosbag and ULog, written here and read as one table."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from pamid.errors import LogFormatError, TruncatedLogError
from pamid.signals import read_log

COLUMNS = {
    "signals": {"time": "time", "angle": {"column": "/joint.position[0]"}, "volts": {"column": "/command.volts"}}
}


def mcap_log(path: Path) -> np.ndarray:
    """Write two topics of JSON, one at 100 Hz and one at 20 Hz, from an epoch on; return the times of the first."""
    writer_of = pytest.importorskip("mcap.writer")
    t0, t = 1_760_000_000_000_000_000, np.arange(100) * 10_000_000
    with path.open("wb") as stream:
        writer = writer_of.Writer(stream)
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b"{}")
        joint = writer.register_channel("/joint", "json", schema)
        command = writer.register_channel("/command", "json", schema)
        for k, at in enumerate(t):
            said = {"position": [0.1 * k, 0.0], "name": "elbow"}
            writer.add_message(joint, t0 + int(at), json.dumps(said).encode(), t0 + int(at))
            if k % 5 == 0:
                writer.add_message(command, t0 + int(at), json.dumps({"volts": 2.0 * k}).encode(), t0 + int(at))
        writer.finish()
    return t * 1e-9


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
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC if ros == 1 else typesys.Stores.ROS2_JAZZY)
    joint, number = (store.types[f"{n}"] for n in ("sensor_msgs/msg/JointState", "std_msgs/msg/Float64"))
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    if ros == 1:
        from rosbags.rosbag1 import Writer

        path, opened, pack = tmp_path / "run.bag", Writer(tmp_path / "run.bag"), store.serialize_ros1
    else:
        from rosbags.rosbag2 import Writer

        path, opened, pack = tmp_path / "run" / "run.db3", Writer(tmp_path / "run", version=9), store.serialize_cdr
    with opened as writer:
        ways = [writer.add_connection(n, t, typestore=store) for n, t in (
            ("/joint", joint.__msgtype__), ("/command", number.__msgtype__))]  # fmt: skip
        for k in range(60):
            at, none = 1_760_000_000_000_000_000 + 10_000_000 * k, np.zeros(0)
            head = header(**({"seq": k} if ros == 1 else {}), stamp=stamp(sec=k, nanosec=0), frame_id="")
            said = joint(head, ["elbow"], np.array([0.1 * k]), none, none)
            writer.write(ways[0], at, pack(said, joint.__msgtype__))
            if k % 5 == 0:
                writer.write(ways[1], at, pack(number(2.0 * k), number.__msgtype__))
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


def ulog(path: Path) -> None:
    """Write a ULog by its definition: header, flags, one format, two instances of a topic."""

    def message(kind: bytes, body: bytes) -> bytes:
        return struct.pack("<Hc", len(body), kind) + body

    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message(b"B", bytes(40))]
    parts.append(message(b"F", b"servo:uint64_t timestamp;float angle;int32_t count;"))
    parts += [message(b"A", struct.pack("<BH", k, k) + b"servo") for k in (0, 1)]
    for k in range(50):
        for instance in (0, 1):
            values = struct.pack("<HQfi", instance, 5_000_000 + 10_000 * k, 0.5 * k * (1 + instance), k)
            parts.append(message(b"D", values))
    path.write_bytes(b"".join(parts))


def test_topics_of_a_ulog_become_columns_of_one_table(tmp_path: Path) -> None:
    pytest.importorskip("pyulog")
    ulog(tmp_path / "flight.ulg")
    columns = {"signals": {"time": "time", "one": {"column": "servo.angle"}, "two": {"column": "servo_1.angle"}}}
    log = read_log(tmp_path / "flight.ulg", columns)
    assert np.allclose(log["time"], 0.01 * np.arange(50)) and np.allclose(log["one"], 0.5 * np.arange(50))
    assert np.allclose(log["two"], np.arange(50))
