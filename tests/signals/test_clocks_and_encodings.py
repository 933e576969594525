"""Remarks, clocks of other kinds, encodings, and a sampling rate beside the table: read, and told where assumed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main
from pamid.errors import MappingError, ReadingWarning
from pamid.signals import read_log
from pamid.signals.formats._encoding import encoding_of

T = 0.01 * np.arange(100)
X = 0.1 * np.sin(5 * T)
DAY = pd.to_datetime("2024-05-01 23:59:59.5")


@pytest.mark.parametrize("remarks", [["ok"] * 99 + ["stopped, here"], [""] * 99 + ["end"], [""] * 50 + ["knock"] * 50])
def test_remarks_are_left_out_with_a_note(remarks: list[str], tmp_path: Path) -> None:
    pd.DataFrame({"time": T, "q": X, "remark": remarks}).to_csv(tmp_path / "log.csv", index=False)
    with pytest.warns(ReadingWarning, match=r"log\.csv: 'remark' left out \(text, not numbers\)"):
        assert list(read_log(tmp_path / "log.csv")) == ["trajectory", "time", "q"]


@pytest.mark.parametrize("kind", ["datetime", "zone", "timedelta", "iso", "iso with zone"])
def test_clocks_of_dates_are_seconds(kind: str, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    stamps = pd.Series(DAY + pd.to_timedelta(T, unit="s"))
    clock = {
        "datetime": stamps, "zone": stamps.dt.tz_localize("Europe/Berlin"), "timedelta": pd.to_timedelta(T, unit="s"),
        "iso": stamps.dt.strftime("%Y-%m-%dT%H:%M:%S.%f"), "iso with zone": stamps.dt.strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
    }[kind]  # fmt: skip
    pd.DataFrame({"time": clock, "q": X}).to_parquet(tmp_path / "log.parquet")
    assert np.allclose(read_log(tmp_path / "log.parquet")["time"], T)


TEXT = "时间 [s],位置 [mm],备注\n" + "".join(f"{t:.2f},{1e3 * x:.3f},好\n" for t, x in zip(T, X, strict=True))
COLUMNS = {"signals": {"time": "时间 [s]", "x": {"column": "位置 [mm]", "unit": "mm"}}}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "gb18030", "gb2312", "utf-16", "utf-16-le", "utf-16-be"])
def test_an_encoding_that_shows_itself_is_found(encoding: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_bytes(TEXT.encode(encoding))
    assert np.allclose(read_log(tmp_path / "log.csv", COLUMNS)["x"], X, atol=1e-6)


@pytest.mark.parametrize("name", ["Länge", "Größe", "déplacement", "Ångström °"])
def test_latin_letters_stay_latin(name: str, tmp_path: Path) -> None:
    text = f"time,{name} [mm]\n" + "".join(f"{t:.2f},{1e3 * x:.3f}\n" for t, x in zip(T, X, strict=True))
    (tmp_path / "log.csv").write_bytes(text.encode("latin-1"))
    columns = {"signals": {"time": "time", "x": {"column": f"{name} [mm]", "unit": "mm"}}}
    assert np.allclose(read_log(tmp_path / "log.csv", columns)["x"], X, atol=1e-6)


def test_another_encoding_is_given(tmp_path: Path, capsys) -> None:
    text = TEXT.replace("时间", "time").replace("位置", "位置").replace("备注", "備註")
    (tmp_path / "log.csv").write_bytes(text.replace("time [s]", "time").replace("位置 [mm]", "q").encode("big5"))
    assert np.allclose(read_log(tmp_path / "log.csv", encoding="big5", check_units=False)["time"], T)
    with pytest.raises(MappingError, match="encoding is 'nosuch'"):
        read_log(tmp_path / "log.csv", encoding="nosuch")
    with pytest.raises(MappingError, match="encoding is 'hex'"):
        read_log(tmp_path / "log.csv", {"encoding": "hex"})
    assert main(["check", str(tmp_path / "log.csv"), "--encoding", "big5"]) == 0
    assert "備註" in capsys.readouterr().out


@pytest.mark.parametrize(("name", "value"), [("fs", 100.0), ("Ts", 0.01), ("sampling_rate", 100.0), ("dt", 0.01)])
def test_a_sampling_rate_beside_a_table_is_its_clock(name: str, value: float, tmp_path: Path) -> None:
    import scipy.io

    scipy.io.savemat(tmp_path / "log.mat", {name: value, "q": X, "F": 10 * X})
    with pytest.warns(ReadingWarning, match=f"counted from {name} = {value:g}, 0.01 s per row"):
        assert np.allclose(read_log(tmp_path / "log.mat")["time"], T)


@pytest.mark.parametrize(
    "header",
    [
        "时间,位置,压力",
        "時間,長度 [mm],壓力",
        "軸位置(mm),關節角度,轉矩",
        "t,电压V,电流A",
        "鎔值,囧值,力",
        "𠀀值,位移,力",
    ],
)
def test_chinese_beyond_gb2312_and_beside_latin_letters_is_found_unaided(header: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_bytes((header + "\n" + "1.0,2.0,3.0\n" * 50).encode("gb18030"))
    assert encoding_of(tmp_path / "log.csv") == "gb18030"


@pytest.mark.parametrize(
    "header", ["Zeit,Länge,Überdruck", "Größe,Übergrößen,Maß", "vitesse mesurée,créée,°", "Länge [µm],Fläche [m²],°C",
               "posición,ángulo,presión", "åäö,öåä,naïve"]
)  # fmt: skip
def test_western_letters_stay_latin(header: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_bytes((header + "\n" + "1.0,2.0,3.0\n" * 50).encode("latin-1"))
    assert encoding_of(tmp_path / "log.csv") == "latin-1"
