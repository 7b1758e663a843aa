"""Damaged and foreign files: every reader says what came and counts what it leaves out, and none gives a number
that the file does not hold.
"""

import random
import sqlite3
from dataclasses import replace

import numpy as np
import pytest

from geometry.errors import InputError
from reconstruct.formats import ColumnMap, Options, detect, read, read_all
from reconstruct.formats.aas_write import write_aas
from reconstruct.formats.time_order import time_order

SEED = 20140430
ROUNDS = 40  # mutations of each kind of file

WIND = "".join(
    f"0;{n};{1000 + 50 * n};{1040 + 50 * n};{3564493200 + n:.3f};{3564493200.8 + n:.3f};{10 + 2 * n}.000;5.000;"
    + ";".join(f"{200 + 50 * g};{n + g / 10:.3f};-12.500;0.400" for g in range(4))
    + "\n"
    for n in range(12)
)
HPL = (
    "System ID:\t96\nNumber of gates:\t4\nRange gate length (m):\t30.0\nGate length (pts):\t10\n"
    "Scan type:\tVAD\nStart time:\t20190308 20:05:03.76\n****\n"
) + "".join(
    f"{20.08 + n / 1000:.6f}  {10 + n}.00  45.00 -0.20 0.10\n"
    + "".join(f"  {g} {n + g / 10:.4f} 1.100000  7.655162E-6\n" for g in range(4))
    for n in range(12)
)
NACELLE = "Timestamp,LOSindex,Distance,RWS,DRWS,CNR,Tilt,Roll,RWSStatus,OverrunStatus\n" + "".join(
    f"2020-09-04T09:00:{n:02d}.547+02:00,2,178,{n}.25,1.22,-3.68,4.99,-0.02,1,1\n" for n in range(12)
)
RAYS = "t;az;el;r;vlos;cnr\n" + "".join(
    f"{1398816000 + n};{10 + 2 * n};1.5;{100 + 50 * g};{n + g / 10};-10\n"
    for n in range(12)
    for g in (0, 1, 2, 3)
)
COLUMNS = ColumnMap(
    names={
        "time_utc": "t",
        "azimuth_deg": "az",
        "elevation_deg": "el",
        "range_m": "r",
        "radial_speed_mps": "vlos",
        "cnr_db": "cnr",
    },
    separator=";",
    time_unit="unix_s",
)
KINDS = {
    "a_wind.txt": (WIND, Options(azimuth="stored")),
    "a.hpl": (HPL, Options()),
    "nacelle.csv": (NACELLE, Options(beam_azimuth_deg={2: 221.8})),
    "rays.csv": (RAYS, Options(columns=COLUMNS)),
}


def damaged_bytes(raw, dice):
    """Some bytes dropped, changed or put in, or the end cut off."""
    out = bytearray(raw)
    for _ in range(dice.choice([1, 2, 5])):
        place = dice.randrange(len(out) + 1)
        match dice.randrange(4):
            case 0:
                del out[place : place + dice.choice([1, 3, 40])]
            case 1:
                out[place : place + 1] = bytes([dice.randrange(256)])
            case 2:
                out[place:place] = bytes(dice.randrange(256) for _ in range(3))
            case 3:
                out = out[: max(place, 10)]
    return bytes(out)


def damaged_lines(text, dice):
    """A line moved, put in again, cut, glued to another, or short of a field.

    Only a line that is gone without a trace, two gate lines of the same number that change places in a .hpl
    file, or a last number that is cut short cannot be noticed: no line is dropped here, lines change places
    with the next one, and no speed is the last number of its line.
    """
    lines = text.splitlines()
    n, other = dice.randrange(1, len(lines)), dice.randrange(1, len(lines))
    match dice.randrange(6):
        case 0:
            lines[n - 1 : n + 1] = lines[n], lines[n - 1]
        case 1:
            lines.insert(n, lines[other])
        case 2:
            lines[n] = lines[n][: dice.randrange(1, len(lines[n]))]
        case 3:
            lines[n] += lines[other]
        case 4:
            separator = next(mark for mark in ";, " if mark in text.splitlines()[-1])
            fields = lines[n].split(separator)
            del fields[dice.randrange(len(fields))]
            lines[n] = separator.join(fields)
        case 5:
            lines[n] = dice.choice(['"', "nan", "1e999", "**", lines[n].replace(".", "_")])
    return "\n".join([*lines, ""])


@pytest.mark.parametrize("name", KINDS)
def test_no_mutation_brings_a_reader_to_anything_but_an_input_error(tmp_path, name):
    text, options = KINDS[name]
    dice, path, read_well = random.Random(SEED), tmp_path / name, 0
    for _ in range(ROUNDS):
        path.write_bytes(damaged_bytes(text.encode(), dice))
        try:
            records = read(path, options=options)
        except InputError as error:
            assert str(path) in str(error)
        else:
            assert np.isfinite(records.azimuth_deg).all()
            read_well += 1
    assert read_well > ROUNDS / 3  # damage is mostly local


@pytest.mark.parametrize("name", KINDS)
def test_broken_lines_never_give_a_speed_that_is_not_the_ray_s_own(tmp_path, name):
    text, options = KINDS[name]
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    whole = read(path, options=options)
    rays = {int(t): n for n, t in enumerate(whole.time_utc.astype("int64"))}
    dice = random.Random(SEED)
    for _ in range(ROUNDS):
        path.write_text(damaged_lines(text, dice), encoding="utf-8", newline="")
        try:
            hurt = read(path, options=options)
        except InputError:
            continue
        np.testing.assert_array_equal(hurt.range_m, whole.range_m)
        own = whole.radial_speed_mps[[rays[int(t)] for t in hurt.time_utc.astype("int64")]]
        right = (hurt.radial_speed_mps == own) | np.isnan(hurt.radial_speed_mps)
        assert right.all()
        assert len(hurt.losses) or hurt.rays == whole.rays


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "cp1252"])
def test_every_text_is_read_in_every_encoding_and_line_end(tmp_path, name, encoding):
    text, options = KINDS[name]
    path = tmp_path / name
    path.write_bytes(text.replace("\n", "\r\n").encode(encoding))
    records = read(path, options=options)
    assert records.rays == 12
    assert records.losses == ()


@pytest.mark.parametrize("name", KINDS)
def test_a_header_alone_and_an_empty_file_name_the_file(tmp_path, name):
    text, options = KINDS[name]
    path = tmp_path / name
    first = text.index("****\n") + 5 if name.endswith("hpl") else text.index("\n") + 1
    path.write_text("\n" if name == "a_wind.txt" else text[:first], encoding="utf-8")
    with pytest.raises(InputError, match=name.replace(".", r"\.")):
        read(path, options=options)
    path.write_bytes(b"\x00" * 50)
    with pytest.raises(InputError, match="the file is empty"):
        read(path, options=options)


def test_the_message_says_which_line_and_what_came(tmp_path):
    path = tmp_path / "a_wind.txt"
    lines = WIND.splitlines()
    lines[6] = lines[6].replace("5.000", "5.00O")
    path.write_text("\n".join(lines), encoding="utf-8")
    (loss,) = read(path).losses
    assert str(loss).startswith("a_wind.txt, line 7: '0;6;1300;1340;")
    assert "no number" in loss.what


FOREIGN = {
    "Background_140920-100003.txt": ("\r\n".join(["12.345678"] * 50), "companion", "HALO background"),
    "Background_glued.txt": ("1234567.123456" * 30, "companion", "HALO background"),
    "system_parameters_46_202304.txt": (
        "04/01/2023 12:00:10 AM\t25.3\t22.1\t24.0\t40.2\t-0.10\t0.20\r\n" * 3,
        "companion",
        "HALO system parameters",
    ),
    "Processed_Wind_Profile_77_20260919_121707.hpl": (
        "5\r\n" + "9.0  270.10  5.20\r\n" * 5,
        None,
        "a profile that HALO has computed",
    ),
    "WLS7-164_2016_11_24__00_00_00.sta": (
        "HeaderLength=41\r\nVersion=1.1.14.b\r\nID System=WLS7-164\r\nAvailability threshold=0\r\n",
        None,
        "ten-minute means of a WindCube profiler",
    ),
    "WLS866-14_2016_12_06__00_00_00.rtd": (
        "HeaderSize=40\r\nVersion=2.1.8\r\nIDSystem=WLS866-14\r\nScanAngle (°)=28\r\n",
        None,
        "a WindCube profiler",
    ),
    "notes.md": ("a walk by the sea\n", None, "of no kind that is known"),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_files_without_rays_are_named_for_what_they_are(tmp_path, name):
    """Sources: doppy src/doppy/raw/halo_bg.py and halo_sys_params.py; Lidaco readers Windcubev1 and v2."""
    text, rank, said = FOREIGN[name]
    path = tmp_path / name
    path.write_text(text, encoding="utf-8", newline="")
    assert detect(path) == rank
    with pytest.raises(InputError, match=said):
        read(path)


def test_a_folder_of_mixed_instruments_gives_a_table_each_and_counts_the_rest(tmp_path):
    for name, (text, _) in KINDS.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    for name, (text, _, _) in FOREIGN.items():
        (tmp_path / name).write_text(text, encoding="utf-8", newline="")
    found = read_all(tmp_path, options=Options(beam_azimuth_deg={2: 221.8}))
    assert sorted(r.instrument for r in found.records) == ["HALO 96", "a", "nacelle lidar"]
    others = {name for name, (_, rank, _) in FOREIGN.items() if rank is None}
    assert {loss.where for loss in found.losses} == {*others, "rays.csv"}
    only = read_all(tmp_path, kind="hpl")
    assert [r.instrument for r in only.records] == ["HALO 96"]


def test_what_a_file_was_taken_for_is_said_with_the_way_to_overrule_it(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text(HPL, encoding="utf-8")
    assert read(path).notes[0] == "recognised as a HALO StreamLine .hpl file: `kind` overrules"
    assert read(path, kind="hpl").notes[0] == "read, as asked, as a HALO StreamLine .hpl file"


@pytest.mark.parametrize(
    ("header", "separator"),
    [
        ("Timestamp,LOS index,Distance [m],RWS (m/s),DRWS,CNR,Tilt,Roll,RWS Status,OverrunStatus", ","),
        ("Date and time;LOS_index;distance;rws;drws;cnr;tilt;roll;rwsstatus;overrunstatus", ";"),
    ],
)
def test_other_spellings_of_a_nacelle_lidar_s_columns_are_known(tmp_path, header, separator):
    body = NACELLE.partition("\n")[2].replace(",", separator)
    (tmp_path / "a.csv").write_text(f"{header}\n{body}", encoding="utf-8")
    records = read(tmp_path / "a.csv", options=Options(beam_azimuth_deg={2: 221.8}))
    np.testing.assert_array_equal(records.radial_speed_mps[:, 0], -(np.arange(12) + 0.25))


@pytest.mark.parametrize("name", ["nacelle.csv", "rays.csv"])
def test_rows_that_come_twice_are_counted(tmp_path, name):
    text, options = KINDS[name]
    lines = text.splitlines()
    (tmp_path / name).write_text("\n".join([*lines, lines[5], lines[7]]), encoding="utf-8")
    records = read(tmp_path / name, options=options)
    assert records.rays == 12
    assert [(loss.times, "twice" in loss.what) for loss in records.losses] == [(2, True)]


def test_a_header_that_names_a_column_twice_is_refused(tmp_path):
    (tmp_path / "a.csv").write_text(NACELLE.replace("DRWS", "RWS"), encoding="utf-8")
    with pytest.raises(InputError, match="names the column 'RWS' twice"):
        read(tmp_path / "a.csv", options=Options(beam_azimuth_deg={2: 221.8}))


def test_a_lone_stamp_is_lost_on_either_side_and_a_set_back_clock_is_sorted():
    """Longest series that runs forward: by hand in each case."""
    base = np.datetime64("2020-01-01", "ns")
    for seconds, kept, sorted_ in (
        ([0, 1, 2, 3], [0, 1, 2, 3], False),
        ([0, 1, 90, 3, 4], [0, 1, 3, 4], False),
        ([10, 11, 2, 13, 14], [0, 1, 3, 4], False),
        ([0, 2, 4, 6, 8, 1, 3, 5, 7], [0, 5, 1, 6, 2, 7, 3, 8, 4], True),
    ):
        found = time_order(base + np.array(seconds) * np.timedelta64(1, "s"), "a")
        assert found.order.tolist() == kept
        assert bool(found.notes) == sorted_
        assert sum(loss.times for loss in found.losses) == len(seconds) - len(kept)


DATABASE = {
    "no start": ("UPDATE control SET dt_start = NULL WHERE rowid = 5", 11, 1),
    "a text for an angle": ("UPDATE control SET azim = 'abc' WHERE rowid = 5", 11, 1),
    "a time that is none": ("UPDATE control SET dt_start = 1e18, dt_stop = 1e18 WHERE rowid = 5", 11, 1),
    "ends before it begins": ("UPDATE control SET dt_stop = dt_start - 100 WHERE rowid = 5", 11, 1),
    "a day ahead": (
        "UPDATE control SET dt_start = dt_start + 86400, dt_stop = dt_stop + 86400 WHERE rowid = 5",
        11,
        1,
    ),
    "no gw_id": ("UPDATE control SET gw_id = NULL WHERE rowid = 5", 11, 1),
    "a ray twice": ("INSERT INTO control SELECT * FROM control WHERE rowid = 7", 12, 1),
    "a value twice": ("INSERT INTO measurement SELECT * FROM measurement WHERE rowid = 7", 12, 1),
    "no distance": ("UPDATE measurement SET dist = NULL WHERE rowid = 7", 12, 1),
    "behind the lidar": ("UPDATE measurement SET dist = -5 WHERE rowid = 7", 12, 1),
    "no measurement": ("DELETE FROM measurement WHERE gw_id = (SELECT gw_id FROM control LIMIT 1)", 11, 1),
    "a text for a speed": ("UPDATE measurement SET radSpeed = 'abc' WHERE rowid = 7", 12, 1),
    "a value without gw_id": ("UPDATE measurement SET gw_id = NULL WHERE rowid = 7", 12, 1),
    "an endless speed": ("UPDATE measurement SET radSpeed = 9e999 WHERE rowid = 7", 12, 1),
    "no speed": ("UPDATE measurement SET radSpeed = NULL WHERE rowid = 7", 12, 0),
    "a text in the log": ("UPDATE system SET pitch = 'x' WHERE rowid = 2", 12, 0),
}


@pytest.mark.parametrize(("statement", "rays", "lost"), DATABASE.values(), ids=DATABASE)
def test_a_damaged_row_of_the_database_costs_no_other(tmp_path, statement, rays, lost):
    pytest.importorskip("sqlalchemy", reason="the extra 'db' is not installed")
    (tmp_path / "a_wind.txt").write_text(WIND, encoding="utf-8")
    whole = read(tmp_path / "a_wind.txt", options=KINDS["a_wind.txt"][1])
    attitude = {name: np.zeros(12) for name in ("heading_deg", "pitch_deg", "roll_deg")}
    place = tmp_path / "study.sqlite"
    write_aas(replace(whole, **attitude), place)
    with sqlite3.connect(place) as connection:
        connection.execute(statement)
    connection.close()
    records = read(place)
    assert records.rays == rays
    assert sum(loss.times for loss in records.losses) == lost
    by_time = {
        int(t): speeds
        for t, speeds in zip(whole.time_utc.astype("int64") // 1000, whole.radial_speed_mps, strict=True)
    }
    for time, speeds in zip(records.time_utc.astype("int64") // 1000, records.radial_speed_mps, strict=True):
        assert np.all((speeds == by_time[int(time)]) | np.isnan(speeds))


def test_a_database_without_a_usable_ray_says_what_it_lost(tmp_path):
    pytest.importorskip("sqlalchemy", reason="the extra 'db' is not installed")
    (tmp_path / "a_wind.txt").write_text(WIND, encoding="utf-8")
    place = tmp_path / "study.sqlite"
    write_aas(read(tmp_path / "a_wind.txt", options=KINDS["a_wind.txt"][1]), place)
    with sqlite3.connect(place) as connection:
        connection.execute("UPDATE control SET azim = NULL")
    connection.close()
    with pytest.raises(InputError, match=r"a ray without time, angles or measurement \(12 times\)"):
        read(place)


def test_rays_lost_in_a_scenario_of_their_own_are_counted_with_the_others(tmp_path):
    pytest.importorskip("sqlalchemy", reason="the extra 'db' is not installed")
    (tmp_path / "a_wind.txt").write_text(WIND, encoding="utf-8")
    place = tmp_path / "study.sqlite"
    write_aas(read(tmp_path / "a_wind.txt", options=KINDS["a_wind.txt"][1]), place)
    with sqlite3.connect(place) as connection:
        connection.execute("UPDATE control SET scn_id = 1000000, azim = NULL WHERE rowid > 7")
    connection.close()
    records = read(place)
    assert records.rays == 7
    assert sum(loss.times for loss in records.losses) == 5
