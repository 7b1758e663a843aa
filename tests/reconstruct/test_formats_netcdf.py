"""netCDF readers on small files made here: WindCube flat and in groups, ARM, ragged CfRadial, and our own."""

import sys

import numpy as np
import pytest

from geometry.errors import InputError, UnavailableError
from reconstruct.formats import Options, detect, read
from reconstruct.formats.cfradial import read_cfradial
from reconstruct.formats.own_netcdf import write_netcdf

xr = pytest.importorskip("xarray", reason="the extra 'data' is not installed")
nc = pytest.importorskip("netCDF4", reason="the extra 'data' is not installed")

RAYS, GATES = 12, 3
AZIMUTH = 10.0 + np.arange(RAYS)
SPEED = np.arange(RAYS * GATES, dtype=float).reshape(RAYS, GATES) / 10


def windcube(path, **attributes):
    """A WindCube PPI with 1 degree rays of a second, stamped at their ends."""
    ray, both = ("time",), ("time", "range")
    away = "radial_velocity_of_scatterers_away_from_instrument"
    variables = {
        "azimuth": (ray, AZIMUTH, {"units": "degrees"}),
        "elevation": (ray, np.full(RAYS, 35.3)),
        "cnr": (both, np.full((RAYS, GATES), -20.0)),
        "radial_wind_speed": (both, SPEED, {"standard_name": away}),
        "doppler_spectrum_width": (both, np.full((RAYS, GATES), 0.8)),
    }
    time = ("time", 0.627 + np.arange(RAYS), {"units": "seconds since 2021-06-30T15:20:22Z"})
    axes = {"time": time, "range": ("range", [100.0, 150.0, 200.0])}
    named = {
        "title": "Leosphere Windcube data",
        "instrument_name": "WLS200s-181",
        "scan_id": "133",
        **attributes,
    }
    xr.Dataset(variables, axes, named).to_netcdf(path)
    return path


def test_windcube_stamps_are_moved_from_the_end_to_the_middle(tmp_path):
    records = read(windcube(tmp_path / "a.nc"))
    np.testing.assert_allclose(records.azimuth_deg, AZIMUTH - 0.5, atol=1e-6)
    assert str(records.time_utc[0])[:23] == "2021-06-30T15:20:22.127"
    assert records.instrument == "WLS200s-181"
    assert records.scan_id[0] == 133
    assert "azimuth by 0.500 deg" in records.notes[-1]


def test_stamps_stay_as_stored_where_that_is_asked_or_the_maker_unknown(tmp_path):
    stored = read_cfradial(windcube(tmp_path / "a.nc"), Options(stamp="middle"))
    np.testing.assert_allclose(stored.azimuth_deg, AZIMUTH, atol=1e-6)
    other = read_cfradial(windcube(tmp_path / "b.nc", title="a radar", instrument_name="X"))
    np.testing.assert_allclose(other.azimuth_deg, AZIMUTH, atol=1e-6)
    starts = read_cfradial(windcube(tmp_path / "c.nc"), Options(stamp="start"))
    np.testing.assert_allclose(starts.azimuth_deg, AZIMUTH + 0.5, atol=1e-6)


def test_a_windcube_file_with_a_group_for_each_sweep_is_read_whole(tmp_path):
    path = tmp_path / "groups.nc"
    with nc.Dataset(path, "w") as file:
        file.title, file.instrument_name = "Leosphere Windcube data", "WLS100s-1"
        for number in range(2):
            group = file.createGroup(f"Sweep_{number}")
            group.createDimension("time", RAYS)
            group.createDimension("gate_index", GATES)
            for name, values, dims in (
                ("time", 1000.0 + 20 * number + np.arange(RAYS), ("time",)),
                ("azimuth", AZIMUTH, ("time",)),
                ("elevation", np.full(RAYS, 5.0 + number), ("time",)),
                ("ray_accumulation_time", np.full(RAYS, 500.0), ("time",)),
                ("range", np.tile([100.0, 150.0, 200.0], (RAYS, 1)), ("time", "gate_index")),
                ("radial_wind_speed", SPEED, ("time", "gate_index")),
                ("cnr", np.full((RAYS, GATES), -18.0), ("time", "gate_index")),
            ):
                group.createVariable(name, "f8", dims)[:] = values
            group["time"].units = "seconds since 1970-01-01 00:00:00"
            group["ray_accumulation_time"].units = "ms"
    records = read(path)
    assert records.rays == 2 * RAYS
    np.testing.assert_array_equal(np.unique(records.sweep_id), [0, 1])
    np.testing.assert_allclose(records.duration_s, 0.5)
    np.testing.assert_allclose(records.azimuth_deg[:RAYS], AZIMUTH - 0.25, atol=1e-6)
    assert str(records.time_utc[0]) == "1970-01-01T00:16:39.750000000"


def test_arm_intensity_becomes_cnr_and_odd_time_units_are_understood(tmp_path):
    path = tmp_path / "sgpdlppi.cdf"
    variables = {
        "azimuth": ("time", [90.9, 135.9, np.nan]),
        "elevation": ("time", [60.0, 60.0, 60.0]),
        "radial_velocity": (("range", "time"), [[1.0, 2.0, 3.0]]),
        "intensity": (("range", "time"), [[1.008, 0.9, 1.5]]),
    }
    time = ("time", [43223.0, 43229.0, 43236.0], {"units": "seconds since 2019-10-15 00:00:00 0:00"})
    axes = {"time": time, "range": ("range", [15.0])}
    xr.Dataset(variables, axes, {"serial_number": "0116-107"}).to_netcdf(path)
    records = read(path)
    np.testing.assert_allclose(records.cnr_db[:, 0], [10 * np.log10(0.008), np.nan])
    np.testing.assert_allclose(records.radial_speed_mps[:, 0], [1.0, 2.0])
    assert str(records.time_utc[0])[:19] == "2019-10-15T12:00:23"
    assert records.losses[0].times == 1


def test_ragged_fields_and_speeds_toward_are_turned(tmp_path):
    path = tmp_path / "ragged.nc"
    toward = {"standard_name": "radial_velocity_of_scatterers_toward_instrument"}
    variables = {
        "azimuth": ("time", [1.0, 2.0]),
        "elevation": ("time", [5.0, 5.0]),
        "ray_n_gates": ("time", [2, 1]),
        "ray_start_index": ("time", [0, 2]),
        "VEL": ("n_points", [1.0, 2.0, 3.0], toward),
    }
    axes = {
        "time": ("time", [0.0, 1.0], {"units": "seconds since 2020-01-01T00:00:00Z"}),
        "range": [50.0, 100.0],
    }
    xr.Dataset(variables, axes).to_netcdf(path)
    np.testing.assert_allclose(read(path).radial_speed_mps, [[-1.0, -2.0], [-3.0, np.nan]])


def test_our_own_file_comes_back_as_it_went(tmp_path):
    first = read(windcube(tmp_path / "a.nc"))
    write_netcdf(first, tmp_path / "b.nc")
    again = read(tmp_path / "b.nc")
    for name, values in {**first.ray_fields(), **first.gate_fields()}.items():
        if name != "scan_id":
            np.testing.assert_array_equal(getattr(again, name), values, err_msg=name)


def test_a_file_that_lacks_something_says_what(tmp_path):
    path = windcube(tmp_path / "a.nc")
    data = xr.load_dataset(path, decode_times=False)
    data.drop_vars("elevation").to_netcdf(tmp_path / "b.nc")
    with pytest.raises(InputError, match="no elevations"):
        read(tmp_path / "b.nc")
    data.drop_vars("radial_wind_speed").to_netcdf(tmp_path / "c.nc")
    with pytest.raises(InputError, match="holds no radial speeds"):
        read(tmp_path / "c.nc")
    (tmp_path / "d.nc").write_bytes((tmp_path / "a.nc").read_bytes()[:900])
    assert detect(tmp_path / "d.nc") == "cfradial"
    with pytest.raises(InputError, match="cannot be read as netCDF"):
        read(tmp_path / "d.nc")


@pytest.mark.parametrize("module", ["xarray", "netCDF4"])
def test_without_the_extra_the_error_names_it(tmp_path, monkeypatch, module):
    records = read(windcube(tmp_path / "a.nc"))
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(UnavailableError, match="extra 'data'"):
        read(tmp_path / "a.nc")
    with pytest.raises(UnavailableError, match="extra 'data'"):
        write_netcdf(records, tmp_path / "b.nc")
