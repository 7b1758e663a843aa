"""The one table of rays: its door, its borders, and sweeps found from angles."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.errors import InputError
from geometry.head import Mounting
from reconstruct.losses import Loss, losses_text, merged_losses
from reconstruct.record_tables import from_long, from_wide, read_parquet, to_long, to_wide, write_parquet
from reconstruct.records import Records, join
from reconstruct.store import blocks, read_store, store_chunks, write_store
from reconstruct.sweep_ids import sweep_ids
from reconstruct.sweep_lag import estimate_lead, without_lead

START = np.datetime64("2014-05-01T00:00:00", "ns")


def sector(sweeps=4, rays=6, gates=3, start=START, instrument="WS_S", seed=0):
    """A back-and-forth sector from 150 degrees in steps of 2."""
    rng = np.random.default_rng(seed)
    up = 150.0 + 2.0 * np.arange(rays)
    azimuth = np.concatenate([up if s % 2 == 0 else up[::-1] for s in range(sweeps)])
    count = len(azimuth)
    return Records(
        time_utc=start + (np.arange(count) * 400).astype("timedelta64[ms]"),
        duration_s=np.full(count, 0.4),
        azimuth_deg=azimuth,
        elevation_deg=np.full(count, 5.96),
        scan_id=np.zeros(count, dtype=int),
        sweep_id=np.repeat(np.arange(sweeps), rays),
        range_m=1000.0 + 25.0 * np.arange(gates),
        radial_speed_mps=np.round(rng.normal(size=(count, gates)), 3),
        cnr_db=np.round(rng.normal(-15, 3, size=(count, gates)), 3),
        instrument=instrument,
    )


def same(first, second):
    for name, values in {**first.ray_fields(), **first.gate_fields(), "range_m": first.range_m}.items():
        np.testing.assert_array_equal(values, getattr(second, name), err_msg=name)
    return first.instrument == second.instrument


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("azimuth_deg", np.full(24, 360.0), r"\[0, 360\)"),
        ("elevation_deg", np.full(24, 91.0), r"\[-90, 90\]"),
        ("elevation_deg", np.full(24, np.nan), "finite"),
        ("duration_s", np.ones(5), r"\(24,\) is needed"),
        ("cnr_db", np.zeros((24, 2)), r"\(24, 3\) is needed"),
        ("radial_speed_mps", np.full((24, 3), np.inf), "use NaN"),
        ("range_m", np.array([3.0, 2.0, 1.0]), "rising order"),
        ("time_utc", np.full(24, np.datetime64("NaT"), "datetime64[ns]"), "no time"),
        ("time_utc", START - np.arange(24).astype("timedelta64[s]"), "backwards"),
    ],
)
def test_the_door_says_what_came_and_what_is_allowed(name, value, said):
    with pytest.raises(InputError, match=said):
        replace(sector(), **{name: value})


def test_tables_of_all_kinds_come_back_as_they_went(tmp_path):
    records = replace(sector(), spectral_width_mps=np.full((24, 3), 0.5), pitch_deg=np.full(24, 0.1))
    assert same(records, from_long(to_long(records)))
    assert same(records, from_wide(to_wide(records)))
    write_parquet(records, tmp_path / "rays.parquet")
    assert same(records, read_parquet(tmp_path / "rays.parquet"))


def test_a_table_with_a_missing_column_or_row_is_named():
    frame = to_long(sector())
    with pytest.raises(InputError, match="lacks cnr_db"):
        from_long(frame.drop(columns="cnr_db"))
    with pytest.raises(InputError, match="71 rows are not 24 rays of 3 gates"):
        from_long(frame.iloc[1:])


def test_offsets_are_added_to_head_angles_and_noted():
    """The study's Sterenn: head 150 and 5.36 degrees point to 162.31 and 5.96."""
    head = replace(sector(), elevation_deg=np.full(24, 5.36))
    pointing = head.mounted(Mounting(azimuth_offset_deg=12.31, elevation_offset_deg=0.6))
    assert abs(pointing.azimuth_deg[0] - 162.31) < 1e-9
    assert abs(pointing.elevation_deg[0] - 5.96) < 1e-9
    assert "azimuth_offset_deg 12.31" in pointing.notes[-1]


def test_files_that_cut_a_sweep_in_two_are_joined_to_whole_sweeps():
    whole = sector(sweeps=6)
    parts = [whole.at_rays(slice(0, 9)), whole.at_rays(slice(9, 20)), whole.at_rays(slice(20, 36))]
    alone = [replace(part, sweep_id=sweep_ids(part.azimuth_deg, part.elevation_deg)) for part in parts]
    joined = join([alone[2], alone[0], alone[1]])
    np.testing.assert_array_equal(joined.sweep_id, whole.sweep_id)
    np.testing.assert_array_equal(joined.time_utc, whole.time_utc)


def test_instruments_and_gates_are_never_mixed():
    with pytest.raises(InputError, match="do not make one table"):
        join([sector(), sector(instrument="WS_K")])
    with pytest.raises(InputError, match="do not make one table"):
        join([sector(), sector(gates=4)])


@settings(derandomize=True, max_examples=25, deadline=None)
@given(
    rays=st.integers(4, 40),
    sweeps=st.integers(1, 6),
    first=st.floats(0, 359),
    step=st.sampled_from([0.5, 2.0, 8.0]),
)
def test_back_and_forth_sweeps_are_found_wherever_the_sector_lies(rays, sweeps, first, step):
    """Property: the sweeps of a made scan come back, across north too."""
    rays = min(rays, int(200 / step))
    up = first + step * np.arange(rays)
    azimuth = np.concatenate([up if s % 2 == 0 else up[::-1] for s in range(sweeps)]) % 360
    found = sweep_ids(azimuth, np.full(rays * sweeps, 5.0))
    np.testing.assert_array_equal(found, np.repeat(np.arange(sweeps), rays))


def test_resets_circles_lists_and_missing_rays_are_cut_where_a_pass_ends():
    ten = np.tile(np.arange(10.0, 30.0, 2.0), 3)
    np.testing.assert_array_equal(sweep_ids(ten, np.full(30, 5.0)), np.repeat([0, 1, 2], 10))
    circle = (np.arange(0.98, 721.0, 1.0)) % 360
    np.testing.assert_array_equal(np.bincount(sweep_ids(circle, np.full(len(circle), 35.3)))[:2], [360, 360])
    lift = np.r_[np.arange(0, 90, 3.0), np.arange(87, -3, -3.0)]
    np.testing.assert_array_equal(np.bincount(sweep_ids(np.full(60, 40.0), lift)), [30, 30])
    azimuth, elevation = np.tile([79.0, 79.0, 158.0, 142.0, 123.0], 4), np.tile([2.6, 4.4, 1.4, 0.3, 1.6], 4)
    np.testing.assert_array_equal(sweep_ids(azimuth, elevation), np.repeat(np.arange(4), 5))
    lost = np.delete(np.r_[np.arange(20), np.arange(19, -1, -1)].astype(float), [5, 6, 7, 30])
    np.testing.assert_array_equal(np.bincount(sweep_ids(lost, np.full(36, 5.0))), [17, 19])
    assert not np.any(sweep_ids(np.full(9, 232.4), np.full(9, 4.25)))


@pytest.mark.parametrize("lead_deg", [1.84, 0.0, -1.0])
def test_the_lead_of_the_stamps_is_found_from_up_against_down_sweeps(lead_deg):
    """A uniform wind seen at true azimuths and stamped ahead of them in the direction of the sweep."""
    true = sector(sweeps=9, rays=60, gates=4)
    rng = np.random.default_rng(1)
    wind = 7.0 * np.cos(np.radians(true.azimuth_deg - 200.0))[:, None] + rng.normal(0, 0.1, (true.rays, 4))
    wind[:, 3] = rng.normal(0, 15, true.rays)  # a gate without signal
    stamped = without_lead(replace(true, radial_speed_mps=wind), -lead_deg)
    found = estimate_lead(stamped)
    assert abs(found.lead_deg - lead_deg) < 0.1
    assert found.sweeps == 9
    back = without_lead(stamped, found.lead_deg)
    assert np.max(np.abs(back.azimuth_deg - true.azimuth_deg)) < 0.1


def test_too_few_sweeps_or_noise_alone_give_no_lead_but_a_reason():
    with pytest.raises(InputError, match="2 whole sweeps"):
        estimate_lead(sector(sweeps=2, rays=20))
    noise = sector(sweeps=5, rays=30)
    with pytest.raises(InputError, match="noise from ray to ray"):
        estimate_lead(replace(noise, radial_speed_mps=20 * noise.radial_speed_mps))


def test_the_store_gives_back_what_it_got_in_chunks_that_end_with_a_sweep(tmp_path):
    path, whole = tmp_path / "rays.duckdb", sector(sweeps=20, rays=6)
    whole.radial_speed_mps[3, 1] = np.nan
    write_store(path, whole.at_rays(slice(0, 33)))
    rest = whole.at_rays(slice(33, 120))
    write_store(path, replace(rest, sweep_id=sweep_ids(rest.azimuth_deg, rest.elevation_deg)))
    assert same(whole, read_store(path))
    chunks = list(store_chunks(path, values=20 * 3))
    assert [c.rays for c in chunks] == [18] * 6 + [12]
    np.testing.assert_array_equal(np.concatenate([c.cnr_db for c in chunks]), whole.cnr_db)
    one = read_store(path, range_m=1030.0)
    np.testing.assert_array_equal(one.range_m, [1025.0])
    np.testing.assert_array_equal(one.radial_speed_mps[:, 0], whole.radial_speed_mps[:, 1])
    assert [c.rays for c in store_chunks(path, range_m=1030.0, values=7)] == [6] * 20
    cut = list(store_chunks(path, range_m=1030.0, values=4))  # sweeps of six do not fit: 4 and 2
    assert [c.rays for c in cut] == [4, 2] * 20
    np.testing.assert_array_equal(np.concatenate([c.sweep_id for c in cut]), whole.sweep_id)


def test_the_store_keeps_instruments_apart_and_refuses_rays_it_has(tmp_path):
    path = tmp_path / "rays.duckdb"
    write_store(path, sector())
    write_store(path, sector(instrument="WS_K"))
    assert [(b.instrument, b.rays, b.gates) for b in blocks(path)] == [("WS_S", 24, 3), ("WS_K", 24, 3)]
    with pytest.raises(InputError, match="name one instrument"):
        read_store(path)
    assert same(sector(instrument="WS_K"), read_store(path, instrument="WS_K"))
    with pytest.raises(InputError, match="already holds rays"):
        write_store(path, sector())
    assert blocks(path)[0].rays == 24


def test_a_store_that_is_none_is_named(tmp_path):
    with pytest.raises(InputError, match="there is no such store"):
        read_store(tmp_path / "absent.duckdb")
    (tmp_path / "text.duckdb").write_text(
        "no database at all, but long enough to look like one " * 100, encoding="utf-8"
    )
    with pytest.raises(InputError, match="cannot be opened"):
        read_store(tmp_path / "text.duckdb")


def test_losses_are_counted_together_and_the_rest_is_not_hidden():
    losses = merged_losses(
        [Loss("a.txt", "cut", line=7), Loss("a.txt", "cut", line=3), Loss("b.txt", "empty")]
    )
    assert losses[0] == Loss("a.txt", "cut", line=3, times=2)
    assert losses_text([Loss(f"{n}.txt", "empty") for n in range(8)]).endswith("and 3 more")
