"""The readers on measured files of the instruments, where these lie beside the project; the numbers come with
the files.
"""

from pathlib import Path

import numpy as np
import pytest

from geometry.angles import difference_deg
from geometry.beams import unit_vector
from reconstruct.formats import Options, read, read_all
from reconstruct.formats.hpl_write import read_schedule
from reconstruct.formats.over_the_top import folded
from reconstruct.retrieval import rows, solve
from reconstruct.two_beam import two_beam_wind
from reconstruct.wind import from_deg, speed_mps

DATA = Path(__file__).parents[3] / "shared" / "data"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the measured files do not lie at ../shared/data")

WS9 = DATA / "windscanner" / "WS9_20161213181000_wind.txt"


def sweep_winds(records, range_m, cnr_min_db=-24.0):
    """Speed and direction of each whole sweep, and whether it runs clockwise."""
    gate = records.gate_at(range_m)
    found = []
    for sweep in np.unique(records.sweep_id):
        rays = records.sweep_id == sweep
        if rays.sum() < 50:
            continue
        speed = np.where(
            records.cnr_db[rays, gate] >= cnr_min_db, records.radial_speed_mps[rays, gate], np.nan
        )
        fit = solve(rows(records.azimuth_deg[rays], records.elevation_deg[rays]), speed)
        way = np.sum(difference_deg(records.azimuth_deg[rays][1:], records.azimuth_deg[rays][:-1])) > 0
        found.append((way, float(speed_mps(*fit.wind_mps)), float(from_deg(*fit.wind_mps))))
    return np.array(found)


def disagreement(winds):
    """Mean direction of the up-sweeps less that of the down-sweeps [deg]."""
    return winds[winds[:, 0] == 1, 2].mean() - winds[winds[:, 0] == 0, 2].mean()


@pytest.mark.parametrize("range_m", [600.0, 800.0, 1000.0])
@pytest.mark.parametrize("source", ["scanner", "estimate"])
def test_windscanner_sweeps_agree_with_the_azimuths_of_the_ray(source, range_m):
    winds = sweep_winds(read(WS9, options=Options(azimuth=source)), range_m)
    assert len(winds) == 9
    assert abs(disagreement(winds)) < 0.5
    if range_m == 800.0:
        assert abs(winds[:, 1].mean() - 5.2) < 0.1
        assert abs(winds[:, 2].mean() - 171) < 0.5


def test_windscanner_sweeps_disagree_with_the_azimuths_as_stored():
    assert disagreement(sweep_winds(read(WS9, options=Options(azimuth="stored")), 1000.0)) > 3.0


def test_the_estimate_finds_the_azimuths_that_the_scanner_file_has():
    known, estimated = (read(WS9, options=Options(azimuth=source)) for source in ("scanner", "estimate"))
    assert np.max(np.abs(difference_deg(known.azimuth_deg, estimated.azimuth_deg))) < 0.4


def test_step_stare_points_are_where_the_head_stood():
    """Kassel: WS4 looks to 79.26, 3.00 and WS5 to 142.47, 2.83 degrees for the first common target."""
    for name, azimuth, elevation in (("WS4", 79.26, 3.00), ("WS5", 142.47, 2.83)):
        records = read(next((DATA / "windscanner").glob(f"{name}_*_wind.txt")))
        off = np.hypot(difference_deg(records.azimuth_deg, azimuth), records.elevation_deg - elevation)
        assert np.sum(off < 0.02) >= 20


def test_windcube_gates_with_angles_as_stored_and_moved_by_half_a_ray():
    path = next((DATA / "windcube").glob("*.nc"))
    winds = []
    for stamp in ("middle", "auto"):
        records = read(path, options=Options(stamp=stamp))
        speed = np.where(records.cnr_db >= -22, records.radial_speed_mps, np.nan).T
        winds.append(solve(rows(records.azimuth_deg, records.elevation_deg, columns=3), speed).wind_mps[:2])
    stated = [[0.0693, -4.3403, -0.4673], [-0.1798, -4.3924, -0.1289]]
    np.testing.assert_allclose(winds[0], stated, atol=1e-4)
    stored, moved = (from_deg(wind[:, 0], wind[:, 1]) for wind in winds)
    np.testing.assert_allclose(difference_deg(moved, stored), -0.5, atol=2e-3)


def test_arm_levels_and_their_sums():
    records = read(next((DATA / "arm").glob("*.cdf")))
    speed = np.where(records.cnr_db >= 10 * np.log10(0.008), records.radial_speed_mps, np.nan).T
    fit = solve(rows(records.azimuth_deg, records.elevation_deg, columns=3), speed)
    good = fit.condition < 5
    u, v = fit.wind_mps[good, 0], fit.wind_mps[good, 1]
    assert good.sum() == 174
    assert abs(speed_mps(u, v).sum() / 1570.36 - 1) < 1e-4
    assert abs(from_deg(u, v).sum() / 32634.9 - 1) < 1e-4


def test_halo_measured_where_its_schedule_says():
    records = read(next((DATA / "halo").glob("*.hpl")))
    azimuth, elevation, _ = folded(*read_schedule(next((DATA / "halo").glob("S_*.txt"))))
    planned, measured = (
        unit_vector(azimuth, elevation),
        unit_vector(records.azimuth_deg, records.elevation_deg),
    )
    assert np.degrees(np.max(np.linalg.norm(planned - measured, axis=-1))) < 0.02
    np.testing.assert_array_equal(np.bincount(records.sweep_id), np.full(22, 24))


def test_nacelle_ten_minutes_from_a_folder():
    """Line of sight 3 looks to 250.2 and 2 to 221.8 degrees: only so do the stated means come out."""
    options = Options(beam_azimuth_deg={2: 221.8, 3: 250.2})
    found = read_all(DATA / "nacelle", options=options)
    assert len(found.records) == 1
    records = found.records[0]
    span = (records.time_utc >= np.datetime64("2020-09-04T09:00")) & (
        records.time_utc < np.datetime64("2020-09-04T09:10")
    )
    means = [records.radial_speed_mps[span & (records.scan_id == line), 0].mean() for line in (2, 3)]
    np.testing.assert_allclose(means, [-6.013, -8.381], atol=6e-4)
    wind = two_beam_wind(*means, half_angle_deg=(250.2 - 221.8) / 2)
    assert abs(float(wind.speed_mps) - 8.855) < 1e-3
    assert abs((250.2 + 221.8) / 2 - float(wind.angle_deg) - 269.0) < 0.05
    assert sum(loss.times for loss in found.losses) == 557
