"""WindScanner files as the public ones of the Kassel campaign are: names that begin with a date, rays whose
header another ray has overwritten, system files with and without GPS.

Source of each quirk: github.com/e-WindLidar/Lidaco, samples/Kassel_Experiment/data (WS1: 8 header fields,
repeated headers, GPS; WS3: 6 fields and 156 turns; WS2: elevations below the horizon; WS7: ranges that come
twice; WS9: a system file without GPS). The files here are made, none is copied.
"""

import numpy as np
import pytest

from geometry.errors import InputError
from reconstruct.formats import Options, read, read_all

START = 3561664800.0  # 2016-11-10 23:20:00 UTC, by the GPS of the same minute


def line(n, *, azimuth=36.92, elevation=9.3, speeds=(1.5, -2.5), ranges=(100, 125), short=False, at=None):
    """One ray a second, 170 counts of the head's log long."""
    begin = START + n if at is None else at
    ids = [1000 + 170 * n, 1000 + 170 * n + 160]
    front = [] if short else [0, 40 + n]
    fields = [*front, *ids, f"{begin:.3f}", f"{begin + 0.95:.3f}", f"{azimuth:.3f}", f"{elevation:.3f}"]
    for range_m, speed in zip(ranges, speeds, strict=True):
        fields += [range_m, speed, -12.5, 0.4]
    return ";".join(map(str, fields))


def put(folder, lines, name="20161110233000_wind.txt"):
    (folder / name).write_text("\n".join([*lines, ""]), encoding="utf-8")
    return folder / name


def test_files_named_by_their_date_are_one_instrument_named_by_the_folder(tmp_path):
    folder = tmp_path / "WS1"
    folder.mkdir()
    put(folder, [line(n) for n in range(5)])
    put(folder, [line(n) for n in range(600, 605)], "20161110234000_wind.txt")
    found = read_all(folder)
    assert [(r.instrument, r.rays) for r in found.records] == [("WS1", 10)]


def test_short_headers_with_many_turns_give_directions(tmp_path):
    lines = [line(n, azimuth=56174.966 + 2 * n, short=True) for n in range(6)]
    records = read(put(tmp_path, lines), options=Options(azimuth="stored"))
    np.testing.assert_allclose(records.azimuth_deg, 14.966 + 2.0 * np.arange(6), atol=1e-6)
    assert str(records.time_utc[0])[:22] == "2016-11-10T23:20:00.47"


def test_elevations_below_the_horizon_and_ranges_that_come_twice_stay(tmp_path):
    lines = [line(n, elevation=-3.2, ranges=(1153, 1158, 1158), speeds=(1, 2, 2)) for n in range(5)]
    records = read(put(tmp_path, lines))
    np.testing.assert_allclose(records.elevation_deg, -3.2)
    np.testing.assert_array_equal(records.range_m, [1153, 1158, 1158])


def test_rays_that_share_a_header_are_left_out_and_copies_kept_once(tmp_path):
    other = line(3, speeds=(9.0, 9.0))
    lines = [line(0), line(1), line(1), line(2), line(3), other, line(4)]
    records = read(put(tmp_path, lines))
    np.testing.assert_array_equal(records.radial_speed_mps[:, 0], [1.5] * 4)
    assert {(loss.line, loss.times, loss.what[:20]) for loss in records.losses} == {
        (3, 1, "a ray that stands in"),
        (5, 2, "a ray with the count"),
    }


def test_a_damaged_range_or_time_loses_its_line_alone(tmp_path):
    lines = [line(n) for n in range(30)]
    lines[4] = line(4, ranges=(100, 725))  # a digit of 125 changed
    lines[9] = line(9, at=START + 9 + 86400)
    lines[12] = lines[12].replace(f"{START + 12:.3f}", f"{START + 14:.3f}")  # ends before it begins
    lines[20] = line(20, ranges=(150, 125))
    records = read(put(tmp_path, lines))
    assert records.rays == 26
    np.testing.assert_array_equal(records.range_m, [100, 125])
    assert sorted(loss.line for loss in records.losses) == [5, 10, 13, 21]


SYSTEM = "{id};101116;{time};512022.0665N;091001.6656E;310.575843;339.30;0.36;0.00;22.70"


@pytest.mark.parametrize(("ahead_s", "said"), [(0, "ahead of"), (3600, "a clock offset of 3600.0 s")])
def test_the_gps_of_the_system_file_tells_how_far_the_clock_is_off(tmp_path, ahead_s, said):
    path = put(tmp_path, [line(n) for n in range(20)])
    hour = 23 if ahead_s == 0 else 24
    rows = [SYSTEM.format(id=1000 + 170 * n, time=f"{hour:02d}20{n:02d}.00") for n in range(20)]
    if ahead_s:
        rows = [row.replace(";101116;24", ";111116;00") for row in rows]
    (tmp_path / "20161110233000_system.txt").write_text("\n".join(rows), encoding="utf-8")
    notes = [note for note in read(path).notes if "GPS" in note]
    assert len(notes) == 1
    assert said in notes[0]
    assert f"{float(ahead_s):.1f} s" in notes[0]


def test_a_system_file_without_gps_gives_the_attitude_alone(tmp_path):
    path = put(tmp_path, [line(n) for n in range(20)])
    rows = [f"{1000 + 170 * n};;;;;;319.90;0.10;-0.20;18.70" for n in range(20)]
    (tmp_path / "20161110233000_system.txt").write_text("\n".join(rows), encoding="utf-8")
    records = read(path)
    np.testing.assert_allclose(records.roll_deg, -0.2)
    assert not any("GPS" in note for note in records.notes)


def test_a_companion_that_cannot_be_read_is_a_loss_and_the_rays_are_read(tmp_path):
    path = put(tmp_path, [line(n) for n in range(20)])
    for kind in ("scanner", "system"):
        (tmp_path / f"20161110233000_{kind}.txt").write_bytes(b"")
    records = read(path)
    assert records.rays == 20
    assert {loss.where for loss in records.losses} == {
        "20161110233000_scanner.txt",
        "20161110233000_system.txt",
    }
    with pytest.raises(InputError, match="scanner file is missing"):
        read(path, options=Options(azimuth="scanner"))


def test_one_damaged_position_of_the_head_turns_no_ray(tmp_path):
    path = put(tmp_path, [line(n, azimuth=10 + 2.0 * n) for n in range(20)])
    counts = range(1000, 1000 + 170 * 21)
    rows = [f"{count};{10 + 2 * (count - 1080) / 170:.4f};9.3;1.0" for count in counts]
    rows[1750] = rows[1750].replace(";", ";4", 1)  # 400 degrees further
    (tmp_path / "20161110233000_scanner.txt").write_text("\n".join(rows), encoding="utf-8")
    records = read(path)
    np.testing.assert_allclose(records.azimuth_deg, 10 + 2.0 * np.arange(20), atol=1e-3)
    assert [loss.times for loss in records.losses] == [1]


def test_a_counter_that_begins_again_gives_no_ray_the_position_of_another_time(tmp_path):
    """The first 12 rays look to 10, 12, ... and the 8 after the restart to 100, 102, ... degrees."""
    turned = [10 + 2.0 * n for n in range(12)] + [100 + 2.0 * n for n in range(8)]
    lines = [line(n, azimuth=a) for n, a in enumerate(turned)]
    for n in range(12, 20):
        fields = lines[n].split(";")
        fields[2:4] = [str(1000 + 170 * (n - 12)), str(1000 + 170 * (n - 12) + 160)]
        lines[n] = ";".join(fields)
    path = put(tmp_path, lines)
    log = [(1000 + 10 * k, 10 + 2 * (10 * k - 80) / 170) for k in range(17 * 12)]
    log += [(1000 + 10 * k, 100 + 2 * (10 * k - 80) / 170) for k in range(17 * 8)]
    text = "\n".join(f"{count};{azimuth:.4f};9.3;1.0" for count, azimuth in log)
    (tmp_path / "20161110233000_scanner.txt").write_text(text, encoding="utf-8")
    records = read(path)
    np.testing.assert_allclose(records.azimuth_deg, turned, atol=1e-3)
    assert any(loss.what == "a position whose counter runs backwards" for loss in records.losses)
