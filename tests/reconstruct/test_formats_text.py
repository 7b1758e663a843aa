"""Text readers on small files made here: WindScanner, HALO, nacelle lidar, plain CSV, and folders of them."""

import gzip
from dataclasses import replace

import numpy as np
import pytest

from geometry.errors import InputError
from geometry.head import Mounting
from reconstruct.formats import ColumnMap, Options, detect, read, read_all
from reconstruct.formats.hpl import read_hpl
from reconstruct.formats.hpl_write import read_schedule, write_hpl, write_schedule
from reconstruct.formats.nacelle import read_nacelle
from reconstruct.formats.windscanner import read_windscanner
from reconstruct.record_tables import to_long, to_wide
from reconstruct.records import Records

LABVIEW = 3564493200.0  # 2016-12-13 17:00 UTC, by the file names of that campaign and the study's epoch
STEP = 2.0


def wind_line(n, azimuth, elevation=5.0, *, header=8, start=None, speeds=(1.5, -2.5), ranges=(200, 250)):
    """One ray of a wind file; 50 counts of the head's log a second."""
    begin = LABVIEW + n if start is None else start
    front = [0, n] if header == 8 else []
    ids = [1000 + 50 * n, 1000 + 50 * n + 40]
    fields = [*front, *ids, f"{begin:.3f}", f"{begin + 0.8:.3f}", f"{azimuth:.3f}", f"{elevation:.3f}"]
    for range_m, speed in zip(ranges, speeds, strict=True):
        fields += [range_m, speed, -12.5, 0.4]
    return ";".join(map(str, fields))


def sweep_positions(rays):
    """True azimuth of the head at each count while it goes up and down between 0 and 40 degrees, 2 degrees a
    second.
    """
    count = np.arange(1000, 1000 + 50 * rays + 60)
    travelled = (count - 1000) / 50 * STEP
    return count, 10.0 + 40.0 - np.abs(np.mod(travelled, 80.0) - 40.0)


def write_campaign(folder, *, rays=100, scanner=True, lead_deg=1.8):
    """A back-and-forth sector in a uniform wind, whose stamps lead the middle of the ray by a known angle."""
    count, head = sweep_positions(rays)
    lines = []
    for n in range(rays):
        middle = np.interp(1000 + 50 * n + 20, count, head)
        way = np.sign(np.interp(1000 + 50 * n + 30, count, head) - np.interp(1000 + 50 * n + 10, count, head))
        speeds = [round(float(8 * np.cos(np.radians(middle - 60))), 3)] * 2
        lines.append(wind_line(n, middle + way * lead_deg, speeds=speeds))
    (folder / "WS1_x_wind.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    if scanner:
        text = "".join(f"{c};{a:.6f};5.000000;{c * 2e4:.6f}\n" for c, a in zip(count, head, strict=True))
        (folder / "WS1_x_scanner.txt").write_text(text, encoding="utf-8")
    return folder / "WS1_x_wind.txt"


@pytest.mark.parametrize("header", [6, 8])
def test_six_and_eight_header_fields_are_told_apart(tmp_path, header):
    path = tmp_path / "wind.txt"
    path.write_text("\n".join(wind_line(n, 40.0 + n, header=header) for n in range(5)), encoding="utf-8")
    records = read_windscanner(path)
    assert str(records.time_utc[0]) == "2016-12-13T17:00:00.400000000"
    np.testing.assert_array_equal(records.range_m, [200, 250])
    np.testing.assert_array_equal(records.radial_speed_mps, [[1.5, -2.5]] * 5)
    assert records.losses == ()


def test_turns_and_beams_over_the_top_become_directions(tmp_path):
    path = tmp_path / "wind.txt"
    lines = [wind_line(0, 755.0), wind_line(1, -30.0), wind_line(2, 320.0, elevation=150.0)]
    path.write_text("\n".join(lines), encoding="utf-8")
    records = read(path, options=Options(azimuth="stored", clock_offset_s=-3600.0))
    np.testing.assert_allclose(records.azimuth_deg, [35.0, 330.0, 140.0], atol=1e-9)
    np.testing.assert_allclose(records.elevation_deg, [5.0, 5.0, 30.0], atol=1e-9)
    assert str(records.time_utc[0])[:19] == "2016-12-13T16:00:00"
    assert any("over the top" in note for note in records.notes)


def test_azimuths_come_from_the_scanner_file(tmp_path):
    """A ray from count 1000 + 50 n to 40 later has its middle 0.8 degrees after its start."""
    records = read_windscanner(write_campaign(tmp_path))
    count, head = sweep_positions(100)
    turning = np.array([n % 20 == 19 for n in range(100)])  # rays at the turn hold both ways
    middle = np.interp(1000 + 50 * np.arange(100) + 20, count, head)
    assert np.max(np.abs(records.azimuth_deg - middle)[~turning]) < 0.01
    assert any("lead by 1.80 deg" in note for note in records.notes)


def test_without_a_scanner_file_the_lead_is_estimated_and_taken_off(tmp_path):
    records = read_windscanner(write_campaign(tmp_path, scanner=False))
    count, head = sweep_positions(100)
    middle = np.interp(1000 + 50 * np.arange(100) + 20, count, head)
    inside = (middle > 15) & (middle < 45)
    assert np.max(np.abs(records.azimuth_deg - middle)[inside]) < 0.2
    assert any("there is no scanner file" in note for note in records.notes)
    stored = read_windscanner(tmp_path / "WS1_x_wind.txt", Options(azimuth="stored"))
    assert abs(abs(stored.azimuth_deg - middle)[5] - 1.8) < 0.01
    with pytest.raises(InputError, match="scanner file is missing"):
        read_windscanner(tmp_path / "WS1_x_wind.txt", Options(azimuth="scanner"))


def test_a_head_that_stands_at_the_end_of_its_rays_gives_where_it_stands(tmp_path):
    path = tmp_path / "A_wind.txt"
    points = [40.0, 80.0, 60.0] * 4
    path.write_text("\n".join(wind_line(n, a) for n, a in enumerate(points)), encoding="utf-8")
    rows = []
    for n, azimuth in enumerate(points):
        before = points[n - 1] if n else azimuth
        for k in range(50):
            share = min(k / 20, 1.0)
            rows.append(f"{1000 + 50 * n + k};{before + share * (azimuth - before):.4f};5.0;1.0")
    (tmp_path / "A_scanner.txt").write_text("\n".join(rows), encoding="utf-8")
    records = read_windscanner(path)
    np.testing.assert_allclose(records.azimuth_deg, points, atol=1e-3)
    np.testing.assert_array_equal(records.sweep_id, np.repeat(np.arange(4), 3))


def test_attitude_is_read_where_the_system_file_has_it(tmp_path):
    path = write_campaign(tmp_path, rays=10)
    rows = [f"{1000 + 50 * n};;;;;;319.90;0.10;359.80;18.70" for n in range(10)]
    (tmp_path / "WS1_x_system.txt").write_text("\n".join([*rows, "1500;;;cut"]), encoding="utf-8")
    records = read_windscanner(path)
    np.testing.assert_allclose(records.pitch_deg, 0.1)
    np.testing.assert_allclose(records.roll_deg, -0.2, atol=1e-9)
    assert [(loss.where, loss.line) for loss in records.losses] == [("WS1_x_system.txt", 11)]


def test_damaged_lines_are_named_and_the_others_read(tmp_path):
    lines = [wind_line(n, 40.0 + n) for n in range(6)]
    lines[2] = lines[2][:40]
    lines[4] = lines[4].replace("-2.5", "-2,5x")
    path = tmp_path / "wind.txt"
    path.write_bytes(("\r\n".join(lines) + "\r\n0;7;10").encode("cp1252"))
    records = read_windscanner(path)
    assert records.rays == 4
    assert sorted(loss.line for loss in records.losses) == [3, 5, 7]
    assert any("no number" in loss.what for loss in records.losses)


def test_rays_with_different_ranges_share_one_set_of_gates(tmp_path):
    path = tmp_path / "wind.txt"
    lines = [wind_line(n, 40.0 + n, ranges=(200, 250) if n < 3 else (225, 250)) for n in range(6)]
    path.write_text("\n".join(lines), encoding="utf-8")
    records = read_windscanner(path)
    np.testing.assert_array_equal(records.range_m, [200, 225, 250])
    np.testing.assert_array_equal(
        records.radial_speed_mps[[0, 5]], [[1.5, np.nan, -2.5], [np.nan, 1.5, -2.5]]
    )


HPL = """Filename:\tUser5_96.hpl
System ID:\t96
Number of gates:\t3
Range gate length (m):\t30{point}0
Gate length (pts):\t10
Pulses/ray:\t2000
No. of {rays} in file:\t2
Scan type:\t{scan}
Focus range:\t65535
Start time:\t20190308 23:59:58{point}76
Resolution (m/s):\t0{point}0382
Altitude of measurement (center of gate) = (range gate + 0.5) * Gate length
Data line 1: Decimal time (hours)  Azimuth (degrees)  Elevation (degrees) Pitch (degrees) Roll (degrees)
f9.6,1x,f6.2,1x,f6.2
Data line 2: Range Gate  Doppler (m/s)  Intensity (SNR + 1)  Beta (m-1 sr-1)
i3,1x,f6.4,1x,f8.6,1x,e12.6 - repeat for no. gates
****{tail}
"""
HPL_RAYS = """23{point}999722 360{point}00  45{point}00{attitude}
  0 -0{point}2173 1{point}100000  7{point}655162E-6{width}
  1 15{point}1091 0{point}990000  7{point}154400E-6{width}
  2 1{point}0000 2{point}000000  6{point}572640E-6{width}
 0{point}000278 320{point}19 142{point}47{attitude}
  0 -1{point}0000 1{point}010000  7{point}655162E-6{width}
  1 -1{point}0000 1{point}010000  7{point}154400E-6{width}
  2 -1{point}0000 1{point}010000  6{point}572640E-6{width}
"""


def hpl_text(point=".", rays="rays", scan="User file 5 - stepped", attitude=" -0.20 0.10", width="", tail=""):
    text = (
        HPL.replace("{point}", point).replace("{rays}", rays).replace("{scan}", scan).replace("{tail}", tail)
    )
    body = HPL_RAYS.replace("{width}", width).replace("{attitude}", attitude).replace("{point}", point)
    return text + body


@pytest.mark.parametrize(
    "variant",
    [
        {},
        {"point": ",", "attitude": " -0,20 0,10"},
        {"rays": "waypoints"},
        {"attitude": ""},
        {"width": " 6.1917", "tail": " Instrument spectral width = 5.656623"},
    ],
    ids=["plain", "decimal comma", "waypoints", "no attitude", "spectral width"],
)
def test_every_header_variant_of_halo_gives_the_same_rays(tmp_path, variant):
    path = tmp_path / "a.hpl"
    path.write_text(hpl_text(**variant), encoding="utf-8")
    records = read(path)
    np.testing.assert_array_equal(records.range_m, [15, 45, 75])
    np.testing.assert_allclose(records.azimuth_deg, [0.0, 140.19])
    np.testing.assert_allclose(records.elevation_deg, [45.0, 37.53])
    np.testing.assert_allclose(records.cnr_db[0], [-10.0, np.nan, 0.0], atol=1e-9)
    np.testing.assert_allclose(records.radial_speed_mps[0], [-0.2173, 15.1091, 1.0])
    assert str(records.time_utc[1])[:19] == "2019-03-09T00:00:01"
    assert (records.spectral_width_mps is None) == ("width" not in variant)
    assert (records.pitch_deg is None) == (variant.get("attitude") == "")


def test_overlapping_gates_stand_one_sample_apart(tmp_path):
    path = tmp_path / "a.hpl"
    path.write_text(hpl_text(scan="User file 5 - csm-overlapping"), encoding="utf-8")
    np.testing.assert_allclose(read_hpl(path).range_m, [15, 18, 21])
    path.write_text(hpl_text(scan="User file 5 - csm-nonoverlapping"), encoding="utf-8")
    np.testing.assert_allclose(read_hpl(path).range_m, [15, 45, 75])


def test_a_halo_ray_that_is_cut_off_is_lost_and_said_to_be(tmp_path):
    path = tmp_path / "a.hpl"
    path.write_text(hpl_text()[:-30], encoding="utf-8")
    records = read_hpl(path)
    assert records.rays == 1
    assert records.losses[0].line == 22
    path.write_text(hpl_text()[:300], encoding="utf-8")
    with pytest.raises(InputError, match=r"\*\*\*\*"):
        read_hpl(path)


def test_pulses_and_their_rate_give_a_duration(tmp_path):
    path = tmp_path / "a.hpl"
    path.write_text(hpl_text(), encoding="utf-8")
    ends = read_hpl(path, Options(pulse_repetition_hz=10_000.0, stamp="end"))
    np.testing.assert_allclose(ends.duration_s, 0.2)
    assert (read_hpl(path).time_utc[0] - ends.time_utc[0]) / np.timedelta64(1, "ms") == 100


def test_halo_files_and_schedules_are_written_as_they_are_read(tmp_path):
    (tmp_path / "a.hpl").write_text(hpl_text(), encoding="utf-8")
    first = read_hpl(tmp_path / "a.hpl")
    (tmp_path / "b.hpl").write_text(write_hpl(first), encoding="utf-8")
    again = read_hpl(tmp_path / "b.hpl")
    np.testing.assert_allclose(again.radial_speed_mps, first.radial_speed_mps)
    np.testing.assert_allclose(again.cnr_db, first.cnr_db, atol=1e-3)
    assert np.max(np.abs(again.time_utc - first.time_utc)) < np.timedelta64(1, "ms")
    (tmp_path / "s.txt").write_text(write_schedule([39.806, 0.0], [14.363, 180.0]), encoding="utf-8")
    np.testing.assert_array_equal(read_schedule(tmp_path / "s.txt"), [[39.806, 0.0], [14.363, 180.0]])
    assert detect(tmp_path / "s.txt") == "companion"
    (tmp_path / "s.txt").write_text("039.806014.363\n39.8\n", encoding="utf-8")
    with pytest.raises(InputError, match="line 2"):
        read_schedule(tmp_path / "s.txt")


NACELLE = """\ufeffTimestamp,LOSindex,Distance,RWS,DRWS,CNR,Tilt,Roll,RWSStatus,OverrunStatus
2020-09-04T09:00:01.547+02:00,2,178,8.01,1.22,-3.68,4.99,-0.02,1,1
2020-09-04T09:00:05.547+02:00,2,178,7.06,1.18,-4.34,4.99,0.05,0,1
2020-09-04T09:00:09.547+02:00,2,178,6.70,1.19,-4.55,5,77,1,1
9999,9999,9999,9999,9999,9999,9999,9999,9999,9999
2020-09-04T09:00:13.547+02:00,2,178,6.72,1.15
2020-09-04T09:00:17.547+02:00,2,178,7.14,1.08,-4.62,5,-0.03,1,1
"""


def test_nacelle_speeds_are_turned_and_every_dropped_row_is_counted(tmp_path):
    path = tmp_path / "los2.csv"
    path.write_text(NACELLE, encoding="utf-8")
    records = read_nacelle(path, Options(beam_azimuth_deg={2: 221.8}))
    np.testing.assert_allclose(records.radial_speed_mps[:, 0], [-8.01, -7.14])
    np.testing.assert_allclose(records.azimuth_deg, 221.8)
    assert str(records.time_utc[0]) == "2020-09-04T07:00:01.547000000"
    assert {loss.what.split(":")[0]: loss.times for loss in records.losses} == {
        "another number of fields than the 10 of the header": 1,
        "no time, line of sight or distance": 1,
        "RWSStatus is not 1": 1,
        "Roll is beyond 45 degrees": 1,
    }
    with pytest.raises(InputError, match="line of sight 2 looks"):
        read(path)
    path.write_text("Timestamp,LOSindex,RWS\n1,2,3\n", encoding="utf-8")
    with pytest.raises(InputError, match="column Distance is missing"):
        read_nacelle(path, Options(beam_azimuth_deg={2: 221.8}))


def test_a_column_map_turns_any_csv_into_rays(tmp_path):
    path = tmp_path / "rays.csv"
    rows = ["t;az;el;r;vlos;snr"]
    rows += [
        f"{1398816000 + n};{10 + 2 * n};1,5;{100 + 50 * g};{3 + g},25;{-9999 if g else -10}"
        for n in range(4)
        for g in (0, 1)
    ]
    path.write_text("\n".join([*rows, "x;10;1,5;100;2;1"]), encoding="utf-8")
    names = {
        "time_utc": "t",
        "azimuth_deg": "az",
        "elevation_deg": "el",
        "range_m": "r",
        "radial_speed_mps": "vlos",
        "cnr_db": "snr",
    }
    columns = ColumnMap(
        names=names,
        speed_positive="toward",
        separator=";",
        decimal=",",
        time_unit="unix_s",
        constants={"duration_s": 0.5},
    )
    records = read(
        path,
        kind="csv",
        options=Options(columns=columns, stamp="end", mounting=Mounting(azimuth_offset_deg=5.0)),
    )
    assert str(records.time_utc[0]) == "2014-04-29T23:59:59.750000000"
    np.testing.assert_allclose(records.azimuth_deg, [15, 17, 19, 21])
    np.testing.assert_allclose(records.radial_speed_mps[0], [-3.25, -4.25])
    np.testing.assert_allclose(records.cnr_db[0], [-10, np.nan])
    assert sum(loss.times for loss in records.losses) == 1
    unknown = Options(columns=replace(columns, constants={}), stamp="end")
    kept = read(path, kind="csv", options=unknown)
    assert str(kept.time_utc[0]) == "2014-04-30T00:00:00.000000000"
    assert "4 of 4 rays have no duration_s: their times stay at the end of the ray" in kept.notes
    with pytest.raises(InputError, match="no column for cnr_db"):
        read(
            path, kind="csv", options=Options(columns=replace(columns, names={**names, "cnr_db": "nothing"}))
        )
    with pytest.raises(InputError, match="no header of columns"):
        read(path, kind="csv")


def test_cells_that_are_no_numbers_are_counted_at_their_line_of_the_file(tmp_path):
    """After a blank and a cut line; few of them, or most of a column."""
    own = ("time_utc", "azimuth_deg", "elevation_deg", "range_m", "radial_speed_mps", "cnr_db")
    rows = [
        f"2020-01-01T00:00:0{n},{n},0,100,{'fast' if n == 3 else n},{'-9' if n == 3 else '?'}"
        for n in range(6)
    ]
    path = tmp_path / "rays.csv"
    path.write_text("\n".join(["t,a,e,r,v,c", "", "cut,off", *rows]), encoding="utf-8")
    columns = ColumnMap(names=dict(zip(own, "taervc", strict=True)))
    records = read(path, kind="csv", options=Options(columns=columns))
    assert records.rays == 6
    assert {loss.what.split(":")[0]: (loss.line, loss.times) for loss in records.losses} == {
        "another number of fields than the 6 of the header": (3, 1),
        "'fast' in v is no number": (7, 1),
        "no number in c": (4, 5),
    }


def test_our_own_tables_need_no_column_map(tmp_path):
    path = write_campaign(tmp_path, rays=12, scanner=False)
    records = read_windscanner(path, Options(azimuth="stored"))
    for name, table in (("long.csv", to_long(records)), ("wide.csv", to_wide(records))):
        table.to_csv(tmp_path / name, index=False)
        again = read(tmp_path / name)
        assert isinstance(again, Records)
        np.testing.assert_array_equal(again.time_utc, records.time_utc)
        np.testing.assert_allclose(again.radial_speed_mps, records.radial_speed_mps)


def test_a_bad_file_of_a_folder_is_named_and_the_rest_is_read(tmp_path):
    write_campaign(tmp_path, rays=30)
    later = [wind_line(n, 40.0, start=LABVIEW + 60 + n) for n in range(3)]
    (tmp_path / "WS1_y_wind.txt.gz").write_bytes(gzip.compress("\n".join(later).encode()))
    (tmp_path / "empty.txt").write_bytes(b"")
    (tmp_path / "broken.nc").write_bytes(b"CDF\x01 this is no netCDF")
    (tmp_path / "notes.md").write_text("a walk by the sea", encoding="utf-8")
    found = read_all(tmp_path)
    assert [records.rays for records in found.records] == [33]
    lost = {loss.where: loss.what for loss in found.losses}
    assert lost["empty.txt"] == "the file is empty"
    assert "cannot be read as netCDF" in lost["broken.nc"]
    assert "of no kind that is known" in lost["notes.md"]
    assert read(tmp_path).losses == found.losses


def test_nothing_that_can_be_read_is_an_error_that_says_why(tmp_path):
    with pytest.raises(InputError, match="it is empty"):
        read(tmp_path)
    with pytest.raises(InputError, match="no such file"):
        read(tmp_path / "absent.txt")
    (tmp_path / "scanner.txt").write_text("1;2.0;3.0;4.0\n" * 3, encoding="utf-8")
    with pytest.raises(InputError, match="holds no rays: it is a WindScanner scanner"):
        read(tmp_path / "scanner.txt")
    with pytest.raises(InputError, match="there is no kind of file"):
        read(tmp_path / "scanner.txt", kind="magic")
