"""The study's four tables in SQLite, and in MariaDB where a server is told of."""

import os
import sqlite3
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from geometry.errors import InputError, UnavailableError
from reconstruct.formats import Options, read
from reconstruct.formats.aas_database import aas_chunks, read_aas
from reconstruct.formats.aas_write import write_aas
from reconstruct.records import Records

sa = pytest.importorskip("sqlalchemy", reason="the extra 'db' is not installed")

SERVER = "LIDARPLAN_TEST_MARIADB"


def campaign(rays=120, gates=4, scan_id=7):
    """Back-and-forth sweeps of 30 rays."""
    rng = np.random.default_rng(0)
    up = np.arange(150.0, 210.0, 2.0)
    azimuth = np.tile(np.concatenate([up, up[::-1]]), rays // 60 + 1)[:rays]
    speed = np.round(rng.normal(size=(rays, gates)), 3)
    speed[5, 2] = np.nan
    return Records(
        time_utc=np.datetime64("2014-05-01T00:00:00", "ns")
        + (400 * np.arange(rays)).astype("timedelta64[ms]"),
        duration_s=np.full(rays, 0.4),
        azimuth_deg=azimuth,
        elevation_deg=np.full(rays, 5.96),
        scan_id=np.full(rays, scan_id),
        sweep_id=np.arange(rays) // 30,
        range_m=666 + 25.0 * np.arange(gates),
        radial_speed_mps=speed,
        cnr_db=np.round(rng.normal(-15, 3, size=(rays, gates)), 3),
        heading_deg=np.full(rays, 3.0),
        pitch_deg=np.full(rays, 0.1),
        roll_deg=np.full(rays, -0.2),
    )


@pytest.fixture(params=["sqlite", "mariadb"])
def place(request, tmp_path):
    """An empty database."""
    if request.param == "sqlite":
        yield tmp_path / "study.sqlite"
        return
    url = os.environ.get(SERVER)
    if not url:
        pytest.skip(f"no MariaDB server: set {SERVER} to its SQLAlchemy URL")
    engine = sa.create_engine(url)
    for when in ("before", "after"):
        with engine.begin() as connection:
            for table in ("scenario", "system", "control", "measurement"):
                connection.exec_driver_sql(f"DROP TABLE IF EXISTS `{table}`")
        if when == "before":
            yield url
    engine.dispose()


def test_what_is_written_is_read_back(place):
    first = campaign()
    write_aas(first, place)
    again = read(str(place) if "://" in str(place) else place)
    for name in (
        "azimuth_deg",
        "elevation_deg",
        "scan_id",
        "sweep_id",
        "radial_speed_mps",
        "cnr_db",
        "roll_deg",
    ):
        np.testing.assert_allclose(getattr(again, name), getattr(first, name), atol=1e-9, err_msg=name)
    np.testing.assert_allclose(again.range_m, first.range_m)
    assert np.max(np.abs(again.time_utc - first.time_utc)) <= np.timedelta64(1, "us")
    np.testing.assert_allclose(again.duration_s, 0.4, atol=1e-6)


def test_chunks_end_with_a_sweep_and_lose_nothing(place):
    first = campaign(rays=300)
    write_aas(first, place)
    chunks = list(aas_chunks(place, rays=70))
    assert len(chunks) > 2
    np.testing.assert_array_equal(np.concatenate([c.sweep_id for c in chunks]), first.sweep_id)
    np.testing.assert_array_equal(np.concatenate([c.cnr_db for c in chunks]), first.cnr_db)
    assert all(set(a.sweep_id).isdisjoint(b.sweep_id) for a, b in pairwise(chunks))


def test_a_stare_is_read_in_chunks_and_of_the_gate_that_is_wanted_alone(place):
    """One sweep without an end: no chunk is longer than twice the rays that are fetched at once."""
    whole = campaign(rays=100)
    stare = replace(whole, azimuth_deg=np.full(100, 180.0), sweep_id=np.zeros(100))
    write_aas(stare, place, scan_type="LOS")
    chunks = list(aas_chunks(place, Options(scenario=7), rays=16, range_m=710.0))
    assert max(chunk.rays for chunk in chunks) <= 32
    assert {(chunk.gates, float(chunk.range_m[0])) for chunk in chunks} == {(1, 716.0)}
    speeds = np.concatenate([chunk.radial_speed_mps for chunk in chunks])
    np.testing.assert_array_equal(speeds, stare.radial_speed_mps[:, 2:3])
    assert {int(number) for chunk in chunks for number in chunk.sweep_id} == {0}


def test_a_scenario_is_taken_by_its_number_and_written_once(place):
    write_aas(campaign(scan_id=1), place)
    later = campaign(scan_id=2)
    write_aas(replace(later, time_utc=later.time_utc + np.timedelta64(1, "h")), place)
    assert read_aas(place, Options(scenario=2)).rays == 120
    assert read_aas(place).rays == 240
    with pytest.raises(InputError, match="already holds scenario 2"):
        write_aas(later, place)
    assert read_aas(place).rays == 240
    with pytest.raises(InputError, match="no ray of scenario 9"):
        read_aas(place, Options(scenario=9))


def test_the_tables_hold_the_studys_own_conventions(tmp_path):
    """Decametres, negative away, seconds since 1904 (2014-05-01 is day 40298 of that count), start and
    stop.
    """
    write_aas(campaign(), tmp_path / "a.sqlite", scan_type="PPI", position=(56.44, 8.15, 5.1))
    with sqlite3.connect(tmp_path / "a.sqlite") as connection:
        dist, speed = connection.execute("SELECT dist, radSpeed FROM measurement WHERE gw_id = 1").fetchone()
        start, stop, count, acc = connection.execute(
            "SELECT dt_start, dt_stop, nbRG, acc FROM control"
        ).fetchone()
        kind, first, last = connection.execute(
            "SELECT scn_type, gw_start_id, gw_stop_id FROM scenario"
        ).fetchone()
        ends = connection.execute("SELECT dt FROM system").fetchone()[0]
    connection.close()
    assert (dist, speed) == (66.6, -campaign().radial_speed_mps[0, 0])
    assert abs(start - (40298 * 86400 - 0.2)) < 1e-6
    assert abs(stop - start - 0.4) < 1e-6
    assert (count, round(acc, 6), kind, first, last) == (4, 400.0, "PPI", 1, 120)
    assert ends == stop


def test_a_table_as_the_study_had_it_is_turned_and_lost_rays_counted(tmp_path):
    """Written by hand: no humidity, no dispersion, capitals in names, a NULL and a ray without
    measurement.
    """
    path = tmp_path / "hand.db"
    with sqlite3.connect(path) as connection:
        connection.execute(
            "CREATE TABLE CONTROL (scn_id INT, gw_id INT, dt_start REAL, dt_stop REAL, azim REAL, elev REAL)"
        )
        connection.execute("CREATE TABLE Measurement (gw_id INT, dist REAL, RADSPEED REAL, cnr REAL)")
        rays = [(3, n, 3481747200.0 + n, 3481747200.5 + n, 370.0 + n, 5.0) for n in range(4)]
        connection.executemany("INSERT INTO CONTROL VALUES (?, ?, ?, ?, ?, ?)", rays)
        values = [(n, d, 4.0 + n, None if n else -12.0) for n in range(3) for d in (116.6, 119.1)]
        connection.executemany("INSERT INTO Measurement VALUES (?, ?, ?, ?)", values)
    connection.close()
    records = read(path)
    np.testing.assert_allclose(records.azimuth_deg, [10, 11, 12])
    np.testing.assert_allclose(records.range_m, [1166, 1191])
    np.testing.assert_allclose(records.radial_speed_mps, [[-4, -4], [-5, -5], [-6, -6]])
    assert str(records.time_utc[0]) == "2014-05-01T00:00:00.250000000"
    assert np.isnan(records.cnr_db[1, 0])
    assert records.losses[0].times == 1


def test_a_database_that_is_none_says_so_and_hides_the_password(tmp_path):
    with pytest.raises(InputError, match="no such database"):
        read_aas(tmp_path / "absent.sqlite")
    with sqlite3.connect(tmp_path / "other.sqlite") as connection:
        connection.execute("CREATE TABLE walks (a INT)")
    connection.close()
    with pytest.raises(InputError, match="no table 'control'; it has walks"):
        read_aas(tmp_path / "other.sqlite")
    with pytest.raises(InputError) as caught:
        read_aas("mysql+pymysql://user:secret@127.0.0.1:1/db")
    assert "secret" not in str(caught.value)


def test_without_the_extra_the_error_names_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "sqlalchemy", None)
    with pytest.raises(UnavailableError, match="extra 'db'"):
        read_aas(tmp_path / "a.sqlite")
