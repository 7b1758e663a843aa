"""netCDF files of several instruments and softwares, made here after what is published of each.

Sources: [W] github.com/openradar/xradar, WindCube reader (groups, over two softwares, DBS with two sets of
gates, empty groups); [L] github.com/actris-cloudnet/doppy docs/formats-wls200s.md (variables and comments);
[K] github.com/jdiasn/lidarwind issue 110 and github.com/mkay-atm/dl_toolbox issues 3 and 4 (time reference in
the group, in the root, in the units; azi, ele, dv); [C] CfRadial 1.3 document, NCAR, sections 4 and 5; [A] the
header of an ARM dlppi file; [N] github.com/StefanoWind/FIEXTA, lidargo's
format.py, which makes the netCDF of the Wind Data Hub.
"""

import gzip
import random

import numpy as np
import pytest

from geometry.errors import InputError
from reconstruct.formats import Options, read
from reconstruct.formats.cfradial import read_cfradial

xr = pytest.importorskip("xarray", reason="the extra 'data' is not installed")
nc = pytest.importorskip("netCDF4", reason="the extra 'data' is not installed")

RAYS, GATES = 8, 3
AZIMUTH = 10.0 + np.arange(RAYS)
SPEED = np.arange(RAYS * GATES, dtype=float).reshape(RAYS, GATES) / 10


def add(group, name, dimensions, values, **attributes):
    kind = str if isinstance(values, str) else "f8"
    variable = group.createVariable(name, kind, dimensions)
    if kind is str:
        variable[0] = values
    else:
        variable[:] = values
    variable.setncatts(attributes)


def sweep_group(file, name, *, begin=1.6e9, units="seconds since 1970-01-01T00:00:00Z", rays=RAYS, **more):
    """A sweep as WindCube 200S writes it [L]."""
    group = file.createGroup(name)
    group.createDimension("time", rays)
    group.createDimension("gate_index", GATES)
    ranges = more.get("ranges", np.tile([100.0, 150.0, 200.0], (rays, 1)))
    both = ("time", "gate_index")
    add(
        group,
        "time",
        ("time",),
        begin + np.arange(rays),
        units=units,
        comments="the end of each ray measurement",
    )
    add(group, "azimuth", ("time",), more.get("azimuth", AZIMUTH[:rays]), units="degrees")
    add(group, "elevation", ("time",), more.get("elevation", np.full(rays, 5.0)), units="degrees")
    add(group, "ray_accumulation_time", (), 500.0, units="ms")
    add(group, "range", both, ranges, units="m")
    add(group, "radial_wind_speed", both, SPEED[:rays], units="m s-1")
    add(group, "cnr", both, np.full((rays, GATES), -18.0), units="dB")
    add(group, "radial_wind_speed_ci", both, np.full((rays, GATES), 99.0), units="percent")
    return group


def windcube(path, build):
    with nc.Dataset(path, "w") as file:
        file.instrument_name = "WLS200S-218"
        file.createDimension("one", 1)
        build(file)
    return path


TIMES = {
    "in the units (21.c) [K]": ("seconds since 2020-09-13T12:26:40Z", None, None),
    "in the group (3.x) [K]": ("seconds since time_reference", "2020-09-13T12:26:40Z", None),
    "in the root [K]": ("seconds since time_reference", None, "2020-09-13T12:26:40Z"),
    "with a zone": ("seconds since 2020-09-13 14:26:40 +02:00", None, None),
    "as ARM writes it [A]": ("seconds since 2020-09-13 12:26:40 0:00", None, None),
}


@pytest.mark.parametrize(("units", "group_says", "root_says"), TIMES.values(), ids=TIMES)
def test_the_time_reference_is_found_where_each_software_puts_it(tmp_path, units, group_says, root_says):
    def build(file):
        group = sweep_group(file, "Sweep_1", begin=0.0, units=units)
        if group_says:
            group.createDimension("one", 1)
            add(group, "time_reference", ("one",), group_says)
        if root_says:
            add(file, "time_reference", ("one",), root_says)

    records = read(windcube(tmp_path / "a.nc", build))
    assert str(records.time_utc[0]) == "2020-09-13T12:26:39.750000000"  # half of its 500 ms before its end
    np.testing.assert_allclose(records.azimuth_deg, AZIMUTH - 0.25, atol=1e-9)
    np.testing.assert_allclose(records.duration_s, 0.5)


def test_a_sweep_without_rays_is_a_loss_and_the_others_are_read(tmp_path):
    """[W]: interrupted scans leave groups without measurements."""

    def build(file):
        sweep_group(file, "Sweep_1")
        sweep_group(file, "Sweep_2", rays=0)

    records = read(windcube(tmp_path / "a.nc", build))
    assert records.rays == RAYS
    assert [loss.what for loss in records.losses] == ["a sweep: holds no ray"]
    with pytest.raises(InputError, match="holds no ray"):
        read(windcube(tmp_path / "b.nc", lambda file: sweep_group(file, "Sweep_1", rays=0)))


def test_rays_without_angles_are_counted(tmp_path):
    """[W]: rays while the head moves to its scan have no angles."""
    azimuth = np.where(np.arange(RAYS) < 2, np.nan, AZIMUTH)
    records = read(windcube(tmp_path / "a.nc", lambda file: sweep_group(file, "Sweep_1", azimuth=azimuth)))
    np.testing.assert_array_equal(records.radial_speed_mps, SPEED[2:])
    assert [loss.times for loss in records.losses] == [2]


def test_inclined_and_vertical_beams_share_all_their_ranges(tmp_path):
    """[W]: a DBS lists other ranges for its vertical beam, ray by ray or sweep by sweep."""
    ranges = np.tile([100.0, 150.0, 200.0], (RAYS, 1))
    ranges[::5] = [90.0, 150.0, 210.0]
    rows = read(windcube(tmp_path / "a.nc", lambda file: sweep_group(file, "Sweep_1", ranges=ranges)))

    def build(file):
        sweep_group(file, "Sweep_1")
        sweep_group(file, "Sweep_2", begin=1.6e9 + 100, ranges=np.tile([90.0, 150.0, 210.0], (RAYS, 1)))

    sweeps = read(windcube(tmp_path / "b.nc", build))
    for records in (rows, sweeps):
        np.testing.assert_array_equal(records.range_m, [90, 100, 150, 200, 210])
        both = np.isfinite(records.radial_speed_mps).sum(axis=1)
        np.testing.assert_array_equal(both, 3)
    assert any("different gates" in note for note in sweeps.notes)
    np.testing.assert_array_equal(sweeps.radial_speed_mps[-1, [0, 2, 4]], SPEED[-1])


def flat(path, *, speed=None, **changes):
    """A CfRadial 1 file [C] as Py-ART writes it: two sweeps, char arrays, fields with fill values."""
    with nc.Dataset(path, "w", format=changes.get("format", "NETCDF4")) as file:
        file.Conventions, file.instrument_name = "CF/Radial instrument_parameters", "XSAPR"
        for name, size in (("time", RAYS), ("range", GATES), ("sweep", 2), ("string_length", 20)):
            file.createDimension(name, size)
        since = changes.get("since", "seconds since 2011-05-20T10:54:08Z")
        add(file, "time", ("time",), changes.get("time", np.arange(RAYS, dtype=float)), units=since)
        add(
            file,
            "range",
            ("range",),
            changes.get("range", [100.0, 150.0, 200.0]),
            **changes.get("of_range", {}),
        )
        add(file, "azimuth", ("time",), changes.get("azimuth", AZIMUTH), **changes.get("of_azimuth", {}))
        add(file, "elevation", ("time",), np.full(RAYS, 0.75))
        add(file, "sweep_start_ray_index", ("sweep",), [0, 4])
        add(file, "sweep_end_ray_index", ("sweep",), [3, 7])
        field = file.createVariable("velocity", "f4", ("time", "range"), fill_value=-9999.0)
        field[:] = SPEED if speed is None else speed
        field.setncatts(changes.get("of_speed", {"units": "meters_per_second"}))
        for name, values, attributes in changes.get("more", ()):
            add(file, name, ("time", "range"), values, **attributes)
    return path


def test_a_cfradial_1_file_is_taken_as_stored_with_its_sweeps_and_fill_values(tmp_path):
    speed = SPEED.copy()
    speed[3, 1] = -9999.0
    records = read(flat(tmp_path / "a.nc", speed=speed))
    np.testing.assert_array_equal(records.sweep_id, [0] * 4 + [1] * 4)
    np.testing.assert_array_equal(records.azimuth_deg, AZIMUTH)
    assert np.isnan(records.radial_speed_mps[3, 1])
    assert str(records.time_utc[-1]) == "2011-05-20T10:54:15.000000000"
    assert "times and angles as stored" in records.notes


@pytest.mark.parametrize("changes", [{"units": "cm/s"}, {"units": "knots"}, {"units": "km h-1"}])
def test_other_units_of_speed_are_turned_and_said(tmp_path, changes):
    factor = {"cm/s": 0.01, "knots": 1852 / 3600, "km h-1": 1 / 3.6}[changes["units"]]
    records = read(flat(tmp_path / "a.nc", of_speed=changes))
    np.testing.assert_allclose(records.radial_speed_mps, SPEED * factor, rtol=1e-6)
    assert any("velocity turned from" in note for note in records.notes)


def test_kilometres_radians_and_units_unknown_are_turned_or_said(tmp_path):
    path = flat(tmp_path / "a.nc", range=[0.1, 0.15, 0.2], of_range={"units": "km"})
    np.testing.assert_allclose(read(path).range_m, [100, 150, 200])
    path = flat(tmp_path / "b.nc", azimuth=np.radians(AZIMUTH), of_azimuth={"units": "radians"})
    np.testing.assert_allclose(read(path).azimuth_deg, AZIMUTH)
    odd = read(flat(tmp_path / "c.nc", of_speed={"units": "furlongs per week"}))
    assert any("taken to be in m/s: its units are 'furlongs per week'" in note for note in odd.notes)
    plain = read(flat(tmp_path / "d.nc", of_range={"units": "meters"}, of_azimuth={"units": "degrees_north"}))
    assert not any("turned from" in note or "taken to be" in note for note in plain.notes)
    with pytest.raises(InputError, match="numbers the gates"):
        wide = flat(tmp_path / "e.nc", range=[0.0, 1.0, 2.0])
        data = xr.load_dataset(wide, decode_times=False).pad(range=(0, 2), mode="edge")
        data.assign_coords(range=np.arange(5.0)).to_netcdf(tmp_path / "f.nc")
        read(tmp_path / "f.nc")


SIGNS = {
    "standard name": ({"standard_name": "radial_velocity_of_scatterers_toward_instrument"}, -1),
    "words": ({"comment": "Positive values are towards the lidar."}, -1),
    "attribute": ({"positive": "toward"}, -1),
    "away in words [K]": ({"comments": "where positive implies movement away from the instrument"}, 1),
    "both ways": ({"comment": "Positive away from the lidar, negative toward it"}, 1),
    "both ways, the negative first": (
        {"comments": "a negative value is movement towards the lidar, and a positive value away from it"},
        1,
    ),
    "only the negative": ({"long_name": "radial velocity (negative is away)"}, -1),
    "name against words": (
        {
            "standard_name": "radial_velocity_of_scatterers_away_from_instrument",
            "comment": "turned from positive toward",
        },
        1,
    ),
    "nothing": ({}, 1),
}


@pytest.mark.parametrize(("of_speed", "sign"), SIGNS.values(), ids=SIGNS)
def test_the_sign_is_the_one_that_the_file_states(tmp_path, of_speed, sign):
    records = read(flat(tmp_path / "a.nc", of_speed=of_speed))
    np.testing.assert_allclose(records.radial_speed_mps, sign * SPEED, rtol=1e-6)


def test_a_ratio_becomes_decibels_and_decibels_stay(tmp_path):
    ratio = ("snr", np.full((RAYS, GATES), 0.01), {"units": "1"})
    np.testing.assert_allclose(read(flat(tmp_path / "a.nc", more=[ratio])).cnr_db, -20.0)
    level = ("snr", np.full((RAYS, GATES), -20.0), {"units": "dB"})
    np.testing.assert_allclose(read(flat(tmp_path / "b.nc", more=[level])).cnr_db, -20.0)


def test_as_many_rays_as_gates_are_not_transposed_by_mistake(tmp_path):
    values = np.arange(9.0).reshape(3, 3)
    axes = {"time": ("time", np.arange(3.0), {"units": "seconds since 2020-01-01"}), "range": [1.0, 2.0, 3.0]}
    angles = {"azi": ("time", [1.0, 2.0, 3.0]), "ele": ("time", np.zeros(3))}
    for name, dimensions, wanted in (("a", ("time", "range"), values), ("b", ("range", "time"), values.T)):
        xr.Dataset({**angles, "dv": (dimensions, values)}, axes).to_netcdf(tmp_path / f"{name}.nc")
        np.testing.assert_array_equal(read(tmp_path / f"{name}.nc").radial_speed_mps, wanted)


@pytest.mark.parametrize(("scan", "step"), [("User1 - csm", 30.0), ("Stare - overlapping", 1.5)])
def test_files_of_the_wind_data_hub_are_read_from_distances_and_not_gate_numbers(tmp_path, scan, step):
    """[N] names the line-of-sight speed wind_speed and gives both distances."""
    gate = np.arange(4.0)
    variables = {
        "wind_speed": (("time", "range_gate"), np.ones((3, 4))),
        "SNR": (("time", "range_gate"), np.full((3, 4), -15.0)),
        "azimuth": ("time", [1.0, 2.0, 3.0]),
        "elevation": ("time", np.full(3, 5.0)),
        "distance": ("range_gate", 15 + 30 * gate),
        "distance_overlapped": ("range_gate", 15 + 1.5 * gate),
    }
    time = np.datetime64("2023-08-01T00:00:01", "ns") + np.arange(3) * np.timedelta64(1500, "ms")
    data = xr.Dataset(variables, {"time": time, "range_gate": gate}, {"Scan type": scan})
    data.to_netcdf(tmp_path / "rt1.lidar.z02.b0.20230801.000001.user1.nc")
    records = read(tmp_path / "rt1.lidar.z02.b0.20230801.000001.user1.nc")
    np.testing.assert_array_equal(records.range_m, 15 + step * gate)
    np.testing.assert_array_equal(records.time_utc, time)
    data.drop_vars(["SNR"]).to_netcdf(tmp_path / "b.nc")
    with pytest.raises(InputError, match="holds no radial speeds"):
        read(tmp_path / "b.nc")


def test_times_that_are_missing_or_stand_alone_are_lost_and_counted(tmp_path):
    time = np.array([0.0, 1, np.nan, 3, 900, 5, 6, 7])
    records = read(flat(tmp_path / "a.nc", time=time))
    np.testing.assert_allclose(records.radial_speed_mps[:, 0], [0, 0.3, 0.9, 1.5, 1.8, 2.1], atol=1e-6)
    assert sum(loss.times for loss in records.losses) == 2


@pytest.mark.parametrize("kind", ["NETCDF3_CLASSIC", "NETCDF3_64BIT_OFFSET", "NETCDF3_64BIT_DATA", "NETCDF4"])
def test_a_file_that_is_cut_off_is_refused_where_the_library_reads_zeros(tmp_path, kind):
    """Each is whole when its last byte is there, and is not without the last eight."""
    path = flat(tmp_path / "a.nc", format=kind)
    assert read_cfradial(path).rays == RAYS
    raw = path.read_bytes()
    for share in (len(raw) - 8, len(raw) // 2):
        path.write_bytes(raw[:share])
        with pytest.raises(InputError, match=r"a\.nc: cannot be read as netCDF"):
            read_cfradial(path)


def test_angles_and_fields_that_belong_to_no_ray_are_refused_by_name(tmp_path):
    data = xr.load_dataset(flat(tmp_path / "a.nc"), decode_times=False)
    data.assign(azimuth=("other", [1.0, 2.0])).to_netcdf(tmp_path / "b.nc")
    with pytest.raises(InputError, match="azimuth has 2 values where there are 8 rays"):
        read(tmp_path / "b.nc")
    data.assign(velocity=(("other", "range"), np.zeros((2, GATES)))).to_netcdf(tmp_path / "c.nc")
    with pytest.raises(InputError, match=r"velocity has the shape \(2, 3\) where 8 rays and 3 gates"):
        read(tmp_path / "c.nc")
    data.time.attrs["units"] = "seconds since 2020-13-45"
    data.to_netcdf(tmp_path / "d.nc")
    with pytest.raises(InputError, match="which is no date"):
        read(tmp_path / "d.nc")


def test_a_stamp_that_is_asked_for_wins_over_what_the_file_says(tmp_path):
    path = windcube(tmp_path / "a.nc", lambda file: sweep_group(file, "Sweep_1"))
    stored = read(path, options=Options(stamp="middle"))
    np.testing.assert_allclose(stored.azimuth_deg, AZIMUTH)


def test_no_mutation_of_a_classic_file_brings_the_reader_to_anything_but_an_input_error(tmp_path):
    path = flat(tmp_path / "a.nc", format="NETCDF3_CLASSIC")
    whole, dice = path.read_bytes(), random.Random(20140501)
    for _ in range(25):
        raw = bytearray(whole)
        for _ in range(dice.choice([1, 3])):
            place = dice.randrange(4, len(raw))
            raw[place : place + dice.choice([1, 1, 9])] = bytes([dice.randrange(256)])
        path.write_bytes(bytes(raw))
        try:
            records = read_cfradial(path)
        except InputError as error:
            assert str(path) in str(error)
        else:
            assert records.rays + sum(loss.times for loss in records.losses) >= RAYS


def test_a_packed_netcdf_is_told_to_be_one(tmp_path):
    packed = tmp_path / "a.nc.gz"
    packed.write_bytes(gzip.compress(flat(tmp_path / "a.nc").read_bytes()))
    with pytest.raises(InputError, match=r"packed with gzip.*unpack it first"):
        read(packed)
