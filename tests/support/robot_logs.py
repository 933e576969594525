"""Small logs of robots in each format, and damaged copies of them."""

from __future__ import annotations

import inspect
import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

START = 1_760_000_000_000_000_000
"""When the logs begin, ns."""


class Damaged(NamedTuple):
    """A damaged file: what was done to it, and its path."""

    damage: str
    path: Path


def mcap_log(path: Path, compression: str = "ZSTD") -> np.ndarray:
    """Write two topics of JSON, one at 100 Hz and one at 20 Hz, from an epoch on; return the times of the first."""
    writer_of = pytest.importorskip("mcap.writer")
    t = np.arange(100) * 10_000_000
    with path.open("wb") as stream:
        writer = writer_of.Writer(stream, compression=writer_of.CompressionType[compression], chunk_size=2_000)
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b"{}")
        joint = writer.register_channel("/joint", "json", schema)
        command = writer.register_channel("/command", "json", schema)
        for k, at in enumerate(t):
            said = {"position": [0.1 * k, 0.0], "name": "elbow"}
            writer.add_message(joint, START + int(at), json.dumps(said).encode(), START + int(at))
            if k % 5 == 0:
                writer.add_message(command, START + int(at), json.dumps({"volts": 2.0 * k}).encode(), START + int(at))
        writer.finish()
    return t * 1e-9


def bag(folder: Path, ros: int) -> Path:
    """Write two topics, one at 100 Hz and one at 20 Hz, as ROS 1 or 2 records them; return the file."""
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC if ros == 1 else typesys.Stores.ROS2_HUMBLE)
    joint, number = (store.types[f"{n}"] for n in ("sensor_msgs/msg/JointState", "std_msgs/msg/Float64"))
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    if ros == 1:
        from rosbags.rosbag1 import Writer

        path, opened, pack = folder / "run.bag", Writer(folder / "run.bag"), store.serialize_ros1
    else:
        from rosbags.rosbag2 import Writer

        version = {"version": 9} if "version" in inspect.signature(Writer).parameters else {}  # rosbags 0.10.0 has one
        path, opened, pack = folder / "run" / "run.db3", Writer(folder / "run", **version), store.serialize_cdr
    with opened as writer:
        ways = [writer.add_connection(n, t, typestore=store) for n, t in (
            ("/joint", joint.__msgtype__), ("/command", number.__msgtype__))]  # fmt: skip
        for k in range(60):
            at, none = START + 10_000_000 * k, np.zeros(0)
            head = header(**({"seq": k} if ros == 1 else {}), stamp=stamp(sec=k, nanosec=0), frame_id="")
            said = joint(head, ["elbow"], np.array([0.1 * k]), none, none)
            writer.write(ways[0], at, pack(said, joint.__msgtype__))
            if k % 5 == 0:
                writer.write(ways[1], at, pack(number(2.0 * k), number.__msgtype__))
    return path


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


def damaged(path: Path, number: int, seed: int = 0) -> Iterator[Damaged]:
    """Damage a file in place, one way after the other: cut off, bytes changed, lost, doubled or filled with zeros."""
    whole, rng = path.read_bytes(), np.random.default_rng(seed)
    for k in range(number):
        data = bytearray(whole)
        at = int(rng.integers(8, len(data)))
        some = int(rng.integers(1, 40))
        match k % 6:
            case 0:
                what, data = f"cut off at {at}", data[:at]
            case 1 | 2:
                places = rng.integers(8, len(data), rng.integers(1, 4))
                what = f"bytes changed at {places.tolist()}"
                for place in places:
                    data[place] ^= int(rng.integers(1, 256))
            case 3:
                what = f"{some} bytes lost at {at}"
                del data[at : at + some]
            case 4:
                what = f"{some} bytes doubled at {at}"
                data[at:at] = data[at : at + some]
            case _:
                what = f"zeros for {some} bytes at {at}"
                data[at : at + some] = bytes(len(data[at : at + some]))
        path.write_bytes(bytes(data))
        yield Damaged(what, path)
    path.write_bytes(whole)
