"""A CSV of rays that cannot be read is named, with what is wrong in it and nothing else."""

from pathlib import Path

import pandas as pd
import pytest

from geometry.errors import InputError
from reconstruct.formats.reading import read

HEADER = (
    "ray,gate,time_utc,duration_s,azimuth_deg,elevation_deg,scan_id,sweep_id,range_m,radial_speed_mps,cnr_db"
)
LINES = ["0,0,2024-01-01T00:00:01,1,10,5,0,0,800,4.0,-12", "1,0,2024-01-01T00:00:02,1,12,5,0,0,800,4.1,-12"]


def said(path: Path, data: bytes) -> str:
    path.write_bytes(data)
    with pytest.raises(InputError) as error:
        read(path, kind="csv")
    assert str(path) in str(error.value)
    return str(error.value)


def test_a_header_without_lines(tmp_path: Path) -> None:
    assert "no line of rays follows the header" in said(tmp_path / "a.csv", f"{HEADER}\n".encode())


@pytest.mark.parametrize(("time", "came"), [("", "nothing"), ("noon", "'noon'")])
def test_a_line_without_a_time_is_named(tmp_path: Path, time: str, came: str) -> None:
    broken = LINES[1].replace("2024-01-01T00:00:02", time)
    text = said(tmp_path / "a.csv", "\n".join((HEADER, LINES[0], broken, "")).encode())
    assert f"a.csv:3: {came} came as the time (in all 1 lines" in text


@pytest.mark.parametrize("absent", [["scan_id"], ["ray", "scan_id"], ["gate"]])
def test_only_columns_that_are_absent_are_missed_by_a_long_table(tmp_path: Path, absent: list[str]) -> None:
    table = pd.DataFrame([line.split(",") for line in LINES], columns=HEADER.split(",")).drop(columns=absent)
    text = said(tmp_path / "a.csv", table.to_csv(index=False).encode())
    assert f"lacks {', '.join(absent)}: it needs" in text


def test_bytes_are_not_shown_as_columns(tmp_path: Path) -> None:
    text = said(tmp_path / "a.csv", b"\x7fELF\x02\x01,\x03\n" + bytes(range(1, 256)) * 3)
    assert "a binary file came" in text
    assert text.isprintable()
