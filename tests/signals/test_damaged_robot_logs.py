"""Logs of robots that were cut off or damaged: refused or told, never an error inside pamid, never rows lost unsaid."""

from __future__ import annotations

import shutil
import struct
import warnings
from pathlib import Path

import pytest
from support.robot_logs import START, Damaged, bag, damaged, mcap_log, ulog

from pamid.cli import main
from pamid.errors import PamidError, PamidWarning, ReadingWarning
from pamid.signals import read_log

CHECKED = ("mcap",)
"""Formats whose chunks carry a checksum; a number that is changed in the others cannot be told from one recorded."""
FEW = 20
"""Cells that three changed bytes can reach without checksums: a number, and what is interpolated from it."""


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("robots")
    for name, compression in (("zstd", "ZSTD"), ("lz4", "LZ4"), ("plain", "NONE")):
        mcap_log(folder / f"{name}.mcap", compression)
    pytest.importorskip("pyulog")
    ulog(folder / "flight.ulg")
    mcaps = {f"mcap {n}": folder / f"{n}.mcap" for n in ("zstd", "lz4", "plain")}
    return {**mcaps, "ulog": folder / "flight.ulg", "bag": bag(folder, 1), "db3": bag(folder, 2)}


def outcome(path: Path, whole) -> str:
    """Read a damaged log and say what became of it; an error that is not pamid's own passes."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            found = read_log(path, nan="keep")
        except PamidError as error:
            assert error.found and error.expected and error.remedy
            return "refused"
    if found.equals(whole):
        return "same"
    if any(issubclass(w.category, PamidWarning) for w in caught):
        return "told"
    if list(found.columns) != list(whole.columns) or len(found) != len(whole):
        return "rows or columns lost"
    return "numbers" if (found != whole).to_numpy().sum() <= FEW else "many numbers"


def unsaid(name: str, file: Path, number: int, seed: int, capsys) -> list[Damaged]:
    whole = read_log(file, nan="keep")
    passes = ("refused", "told", "same") if name.startswith(CHECKED) else ("refused", "told", "same", "numbers")
    found = [d for d in damaged(file, number, seed) if outcome(d.path, whole) not in passes and not at_an_end(d)]
    assert capsys.readouterr().out == "", "readers of other people print into the answer"
    return found


def at_an_end(damage: Damaged) -> bool:
    """Return whether a ULog was cut exactly between two messages: it is then a whole, shorter one."""
    data = damage.path.read_bytes()
    if not (damage.damage.startswith("cut off") and data.startswith(b"ULog")):
        return False
    at = 16
    while at < len(data) - 2:
        at += 3 + struct.unpack_from("<H", data, at)[0]
    return at == len(data)


NAMES = ("mcap zstd", "mcap lz4", "mcap plain", "ulog", "bag", "db3")


@pytest.mark.parametrize("name", NAMES)
def test_damage_is_refused_or_told(name: str, logs: dict[str, Path], capsys) -> None:
    assert unsaid(name, logs[name], 24, 0, capsys) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_much_damage_is_refused_or_told(name: str, logs: dict[str, Path], capsys) -> None:
    assert unsaid(name, logs[name], 240, 1, capsys) == []


def test_what_a_cut_has_taken_is_told(logs: dict[str, Path], tmp_path: Path, capsys) -> None:
    whole = logs["ulog"].read_bytes()
    (tmp_path / "cut.ulg").write_bytes(whole[: len(whole) // 2 + 9])
    with pytest.warns(ReadingWarning, match=r"cut.ulg: its last message is cut off"):
        assert 2 < len(read_log(tmp_path / "cut.ulg", nan="keep")) < 50
    assert main(["check", str(tmp_path / "cut.ulg")]) == 0
    assert "its last message is cut off" in " ".join(capsys.readouterr().out.split())


def test_messages_that_a_recorder_dropped_are_told(logs: dict[str, Path], tmp_path: Path) -> None:
    (tmp_path / "dropped.ulg").write_bytes(logs["ulog"].read_bytes() + struct.pack("<HcH", 2, b"O", 120))
    with pytest.warns(ReadingWarning, match=r"recorder dropped messages 1 times, for 120 ms"):
        read_log(tmp_path / "dropped.ulg", nan="keep")


def test_messages_that_the_index_does_not_know_are_missed(logs: dict[str, Path], tmp_path: Path) -> None:
    """The metadata of a recording count its messages: a database with fewer is not whole."""
    import sqlite3

    shutil.copytree(logs["db3"].parent, tmp_path / "run")
    with sqlite3.connect(tmp_path / "run" / "run.db3") as database:
        database.execute("DELETE FROM messages WHERE id > 40")
    database.close()
    with pytest.raises(PamidError, match=r"it declares 72 messages, of which 40 can be read"):
        read_log(tmp_path / "run" / "run.db3")


def test_stamps_that_go_back_and_numbers_that_are_lacking_are_told(tmp_path: Path) -> None:
    from pamid.signals.formats._topics import Messages, joined
    from pamid.signals.mapping import LogMapping

    found = Messages()
    for k, at in enumerate((0, 1, 2, 2, 4, 3, 5)):
        found.add("/a", START + 10_000_000 * at, {"x": k} if k != 1 else {"y": 1})
    lost = "; ".join(joined(found.topics(), LogMapping(), tmp_path / "a.mcap", 2**20).lost)
    for words in ("1 messages of /a repeat the time stamp", "go backwards 1 times", "up to 6 of /a.y"):
        assert words in lost
