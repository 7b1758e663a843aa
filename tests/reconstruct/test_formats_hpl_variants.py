"""HALO files as instruments of several years and softwares write them, each made here after a public list.

Sources: [D] github.com/actris-cloudnet/doppy docs/formats-halo.md (headers of 12 variants and their sites),
[H] github.com/actris-cloudnet/halo-reader raw-formats.md and src/haloreader/grammar_header.lark (scan types,
overflow of the hours, wrong gate counts).
"""

import numpy as np
import pytest

from geometry.errors import InputError
from reconstruct.formats import read
from reconstruct.formats.hpl import read_hpl

COMMON = "(range gate + 0.5) * Gate length"


def hpl(
    *,
    gates=4,
    body_gates=None,
    hours=(1.0, 1.001, 1.002),
    start="20221214 01:00:00.99",
    scan="Stare",
    length=30.0,
    points=10,
    measure="Range",
    formula=COMMON,
    count="rays",
    rays=1,
    pitch=True,
    width=False,
    width_said=False,
    ends="\r\n",
    trailing=" ",
    comma=False,
    system="System ID",
):
    """Text of a file; gate g of ray n has the speed n + g / 10 and the intensity 1.1."""
    attitude = "  Pitch (degrees) Roll (degrees)" if pitch else ""
    said = " Spectral Width" if width_said else ""
    lines = [
        "Filename:\tStare_91_20221214_11.hpl",
        f"{system}:\t91",
        f"Number of gates:\t{gates}",
        f"Range gate length (m):\t{length}",
        f"Gate length (pts):\t{points}",
        "Pulses/ray:\t20000",
        f"No. of {count} in file:\t{rays}",
        f"Scan type:\t{scan}",
        "Focus range:\t65535",
        f"Start time:\t{start}",
        "Resolution (m/s):\t0.0382",
        f"{measure} of measurement (center of gate) = {formula}",
        f"Data line 1: Decimal time (hours)  Azimuth (degrees)  Elevation (degrees){attitude}",
        "f9.6,1x,f6.2,1x,f6.2",
        f"Data line 2: Range Gate  Doppler (m/s)  Intensity (SNR + 1)  Beta (m-1 sr-1){said}",
        "i3,1x,f6.4,1x,f8.6,1x,e12.6 - repeat for no. gates",
        "****" + (" Instrument spectral width = 7.796967" if width else ""),
    ]
    for n, hour in enumerate(hours):
        lines.append(f"{hour:.8f} {10.0 * n:6.2f}  45.00" + (" -0.01 -0.20" if pitch else ""))
        wide = " 0.5000" if width else ""
        lines += [
            f"{g:3d} {n + g / 10:.4f} 1.100000  1.569249E-6{wide}{trailing}"
            for g in range(body_gates or gates)
        ]
    text = ends.join([*lines, ""])
    return text.replace(".", ",") if comma else text


def written(folder, name="Stare_91_20221214_01.hpl", **variant):
    path = folder / name
    path.write_bytes(hpl(**variant).encode())
    return path


VARIANTS = {
    "the most common [D]": {"measure": "Altitude"},
    "Range instead of Altitude [D: Granada]": {},
    "waypoints [D: Granada User3]": {"count": "waypoints", "scan": "User file 3 - csm"},
    "width in the body, not in the header [H: Warsaw]": {"width": True},
    "width in both [D: Neumayer]": {"width": True, "width_said": True},
    "without pitch and roll [D: Hyytiala]": {"pitch": False},
    "decimal comma [D: Granada 2023-02]": {"comma": True},
    "decimal comma and width [D: Potenza]": {"comma": True, "width": True, "width_said": True},
    "capitals [D]": {"system": "SYSTEM ID"},
    "Unix line ends, nothing trailing": {"ends": "\n", "trailing": ""},
    "old Mac line ends": {"ends": "\r"},
    "wind profile [H]": {"scan": "Wind profile", "rays": 3},
    "RHI [H]": {"scan": "RHI", "rays": 3},
}


@pytest.mark.parametrize("variant", VARIANTS.values(), ids=VARIANTS)
def test_every_published_header_gives_the_same_rays(tmp_path, variant):
    records = read(written(tmp_path, **variant))
    np.testing.assert_array_equal(records.range_m, [15, 45, 75, 105])
    np.testing.assert_allclose(records.radial_speed_mps[1], [1.0, 1.1, 1.2, 1.3])
    np.testing.assert_allclose(records.cnr_db, -10.0, atol=1e-9)
    np.testing.assert_allclose(records.azimuth_deg, [0, 10, 20])
    assert str(records.time_utc[0]) == "2022-12-14T01:00:00.000000000"
    assert records.instrument == "HALO 91"
    assert (records.spectral_width_mps is None) == ("width" not in variant)
    assert (records.pitch_deg is None) == (not variant.get("pitch", True))
    assert records.losses == ()


OVERLAPS = {
    "by the scan type against the formula [H: Warsaw 2021]": {"scan": "Stare - overlapping"},
    "csm [H]": {"scan": "User file 1 - csm - overlapping"},
    "wind profile [H]": {"scan": "Wind profile - overlapping"},
    "by the formula alone [D: Cluj, Granada User1]": {"formula": "Gate length / 2 + (range gate x 3)"},
}


@pytest.mark.parametrize("variant", OVERLAPS.values(), ids=OVERLAPS)
def test_overlapping_gates_stand_three_metres_apart_however_it_is_said(tmp_path, variant):
    records = read(written(tmp_path, **variant))
    np.testing.assert_allclose(records.range_m, [15, 18, 21, 24])
    assert any("gates overlap: centres at 15 m + 3 m a gate" in note for note in records.notes)


def test_gates_that_do_not_overlap_say_so_in_the_scan_type_too(tmp_path):
    for scan in ("User file 5 - csm-nonoverlapping", "Stare - non-overlapping", "Stare - non overlapping"):
        np.testing.assert_allclose(read(written(tmp_path, scan=scan)).range_m, [15, 45, 75, 105])


HOURS = {
    "begins again at midnight [H: time overflow]": ((23.99, 23.9999, 0.005), "20221214 23:00:00.00", 15),
    "runs on past 24": ((23.99, 23.9999, 24.005), "20221214 23:00:00.00", 15),
    "starts before midnight, first ray after it": ((0.003, 0.004, 0.005), "20221214 23:59:59.90", 15),
    "starts after midnight, first ray before it": ((23.998, 23.999, 0.005), "20221215 00:00:00.10", 15),
    "a gap of 14 hours": ((1.0, 15.0, 15.005), "20221215 01:00:00.00", 15),
}


@pytest.mark.parametrize(("hours", "start", "day"), HOURS.values(), ids=HOURS)
def test_the_last_ray_falls_on_the_right_day(tmp_path, hours, start, day):
    records = read(written(tmp_path, hours=hours, start=start))
    last = np.datetime64(f"2022-12-{day}") + np.timedelta64(round((hours[-1] % 24) * 3600e3), "ms")
    assert abs(records.time_utc[-1] - last) < np.timedelta64(1, "ms")
    assert records.rays == 3


def test_one_damaged_hour_is_lost_and_moves_no_other_ray(tmp_path):
    hours = [23.5, 23.501, 3.5, 23.502, 23.503, 0.001]
    records = read(written(tmp_path, hours=hours, start="20221214 23:30:00.00"))
    assert [str(t)[8:16] for t in records.time_utc] == ["14T23:30"] * 4 + ["15T00:00"]
    assert [(loss.line, loss.times) for loss in records.losses] == [(28, 1)]


def test_a_clock_that_was_set_back_loses_no_ray_but_is_said(tmp_path):
    hours = [5.0, 5.1, 5.2, 5.3, 5.4, 5.05, 5.15, 5.25, 5.35, 5.45]
    records = read(written(tmp_path, hours=hours, start="20221214 05:00:00.00"))
    assert records.rays == 10
    assert np.all(np.diff(records.time_utc) > np.timedelta64(0))
    assert any("rays sorted into their place" in note for note in records.notes)


def test_the_date_comes_from_the_name_where_the_header_has_none(tmp_path):
    records = read(written(tmp_path, start=""))
    assert str(records.time_utc[0])[:13] == "2022-12-14T01"
    assert any("taken from the file's name" in note for note in records.notes)
    with pytest.raises(InputError, match="the start time is ''"):
        read_hpl(written(tmp_path, name="a.hpl", start=""))
    with pytest.raises(InputError, match="day and time of the calendar"):
        read_hpl(written(tmp_path, start="20221345 01:00:00.00"))


def test_another_number_of_gates_than_the_header_says_is_refused_or_counted(tmp_path):
    """[H]: the number of gates differs from the header or changes in the middle of a file."""
    with pytest.raises(InputError, match=r"4 gate lines are needed.*mostly 3 follow"):
        read(written(tmp_path, body_gates=3))
    longer = read(written(tmp_path, body_gates=5))
    np.testing.assert_allclose(longer.radial_speed_mps[2], [2.0, 2.1, 2.2, 2.3])
    assert [(loss.line, loss.times) for loss in longer.losses] == [(23, 3)]
    path = tmp_path / "b.hpl"
    changed = hpl(body_gates=3, hours=(1.01, 1.02)).partition("****\r\n")[2]
    path.write_text(hpl() + changed, encoding="utf-8", newline="")
    both = read(path)
    assert both.rays == 3
    assert [(loss.line, loss.times) for loss in both.losses] == [(33, 8)]


def test_rays_that_the_header_announces_and_the_file_lacks_are_counted(tmp_path):
    records = read(written(tmp_path, scan="VAD", rays=6))
    assert [(loss.times, loss.what[:28]) for loss in records.losses] == [(3, "rays that the header announc")]


def test_a_gate_without_intensity_in_words_keeps_its_ray(tmp_path):
    path = tmp_path / "a.hpl"
    path.write_text(hpl().replace("  1 1.1000 1.100000", "  1 1.1000 NaN"), encoding="utf-8")
    records = read(path)
    assert records.rays == 3
    assert np.isnan(records.cnr_db[1, 1])
    assert records.losses == ()


def test_a_whole_file_and_one_with_a_damaged_line_agree_in_the_other_rays(tmp_path):
    """The quick way and the way around damage read the same numbers."""
    hours = 1.0 + np.arange(200) / 1000
    whole = read(written(tmp_path, hours=hours))
    path = tmp_path / "b.hpl"
    lines = hpl(hours=hours).split("\r\n")
    lines[17 + 5 * 50 + 2] = "  1 1.#QQ x"
    path.write_text("\r\n".join(lines), encoding="utf-8", newline="")
    hurt = read(path)
    kept = np.arange(200) != 50
    np.testing.assert_array_equal(hurt.radial_speed_mps, whole.radial_speed_mps[kept])
    np.testing.assert_array_equal(hurt.time_utc, whole.time_utc[kept])
    assert [loss.line for loss in hurt.losses] == [270, 268]
