"""Nothing of a table of rays is lost at any border: data frames, Parquet, DuckDB, netCDF."""

import tempfile
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.errors import InputError
from reconstruct.formats.cfradial import read_cfradial
from reconstruct.formats.own_netcdf import write_netcdf
from reconstruct.losses import Loss
from reconstruct.record_tables import from_long, from_wide, read_parquet, to_long, to_wide, write_parquet
from reconstruct.records import Records
from reconstruct.store import read_store, store_chunks, write_store

pytest.importorskip("netCDF4", reason="the extra 'data' is not installed")

WORDS = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=12)
ANGLE = st.floats(-89.0, 89.0)
KNOWN = st.floats(-1e6, 1e6) | st.just(float("nan"))


def column(draw: st.DrawFn, values: st.SearchStrategy[float], *shape: int) -> np.ndarray:
    count = int(np.prod(shape))
    return np.array(draw(st.lists(values, min_size=count, max_size=count)), dtype=float).reshape(shape)


@st.composite
def tables(draw: st.DrawFn, least_rays: int = 0) -> Records:
    """Any table of rays that passes the door: optional columns there or not, NaN, odd names, nanoseconds."""
    rays, gates = draw(st.integers(least_rays, 6)), draw(st.integers(1, 3))
    steps = draw(st.lists(st.integers(0, 10**12), min_size=rays, max_size=rays))
    whole = st.lists(st.integers(-(2**40), 2**40), min_size=rays, max_size=rays)
    optional = {
        name: column(draw, KNOWN, rays)
        for name in ("heading_deg", "pitch_deg", "roll_deg")
        if draw(st.booleans())
    }
    optional |= {
        name: column(draw, KNOWN, rays, gates)
        for name in ("spectral_width_mps", "quality")
        if draw(st.booleans())
    }
    losses = st.builds(Loss, WORDS, WORDS, st.none() | st.integers(1, 10**6), st.integers(1, 10**6))
    return Records(
        time_utc=np.datetime64("2014-05-01T00:00:00.123456789", "ns")
        + np.cumsum(np.array(steps, dtype=np.int64)).astype("timedelta64[ns]"),
        duration_s=column(draw, KNOWN, rays),
        azimuth_deg=column(draw, st.floats(0.0, 359.999), rays),
        elevation_deg=column(draw, ANGLE, rays),
        scan_id=np.array(draw(whole), dtype=int),
        sweep_id=np.sort(np.array(draw(whole), dtype=int)),
        range_m=np.array(sorted(draw(st.sets(st.floats(0.0, 1e5), min_size=gates, max_size=gates)))),
        radial_speed_mps=column(draw, KNOWN, rays, gates),
        cnr_db=column(draw, KNOWN, rays, gates),
        instrument=draw(WORDS),
        notes=tuple(draw(st.lists(WORDS, max_size=3, unique=True))),
        losses=tuple(draw(st.lists(losses, max_size=2, unique_by=lambda loss: loss[:2]))),
        **optional,
    )


def through_parquet(records: Records, folder: Path) -> Records:
    write_parquet(records, folder / "it's.parquet")
    return read_parquet(folder / "it's.parquet")


def through_store(records: Records, folder: Path) -> Records:
    write_store(folder / "rays.duckdb", records)
    return read_store(folder / "rays.duckdb")


def through_netcdf(records: Records, folder: Path) -> Records:
    write_netcdf(records, folder / "rays.nc")
    return read_cfradial(folder / "rays.nc")


BORDERS = {
    "long frame": lambda records, _: from_long(to_long(records)),
    "wide frame": lambda records, _: from_wide(to_wide(records)),
    "parquet": through_parquet,
    "netcdf": through_netcdf,
    "store": through_store,
}


def assert_same(first: Records, second: Records) -> None:
    for field in fields(Records):
        one, other = getattr(first, field.name), getattr(second, field.name)
        if isinstance(one, np.ndarray):
            assert other is not None, field.name
            np.testing.assert_array_equal(one, other, err_msg=field.name)
            assert one.dtype == other.dtype, field.name
        else:
            assert one == other, field.name


@pytest.mark.parametrize("border", BORDERS)
@settings(derandomize=True, max_examples=15, deadline=None)
@given(data=st.data())
def test_every_field_comes_back_as_it_went(border: str, data: st.DataObject) -> None:
    """A store keeps no table without a ray; every other border does."""
    records = data.draw(tables(least_rays=1 if border == "store" else 0))
    cross: Callable[[Records, Path], Records] = BORDERS[border]
    with tempfile.TemporaryDirectory() as folder:
        assert_same(records, cross(records, Path(folder)))


def some(rays: int = 40, gates: int = 2) -> Records:
    """A stare: one sweep that never ends."""
    rng = np.random.default_rng(3)
    return Records(
        time_utc=np.datetime64("2014-05-01", "ns") + (500 * np.arange(rays)).astype("timedelta64[ms]"),
        duration_s=np.full(rays, 0.5),
        azimuth_deg=np.full(rays, 232.4),
        elevation_deg=np.full(rays, 4.25),
        scan_id=np.zeros(rays),
        sweep_id=np.zeros(rays),
        range_m=600.0 + 25.0 * np.arange(gates),
        radial_speed_mps=rng.normal(size=(rays, gates)),
        cnr_db=rng.normal(-15, 2, size=(rays, gates)),
        instrument="K",
    )


def test_rays_without_a_gate_are_refused_and_not_dropped() -> None:
    with pytest.raises(InputError, match="40 rays without a gate"):
        to_long(some(gates=0))
    with pytest.raises(InputError, match="two gates of the records have the same range"):
        to_wide(replace(some(), range_m=np.full(2, 600.0)))


def test_notes_and_losses_of_later_files_are_added_to_those_of_a_store(tmp_path: Path) -> None:
    path, whole = tmp_path / "rays.duckdb", some()
    for number, part in enumerate((slice(0, 20), slice(20, 40))):
        told = {"notes": ("turned", f"file {number}"), "losses": (Loss("a.txt", "cut", 3 + number),)}
        write_store(path, replace(whole.at_rays(part), **told))
    back = read_store(path)
    assert back.notes == ("turned", "file 0", "file 1")
    assert back.losses == (Loss("a.txt", "cut", 3, times=2),)


@pytest.mark.parametrize("values", [1, 7, 16, 1000])
def test_a_stare_is_read_in_chunks_of_the_size_asked_for(tmp_path: Path, values: int) -> None:
    """One sweep without an end is cut, loses nothing and stays one sweep."""
    whole = some()
    write_store(tmp_path / "rays.duckdb", whole)
    chunks = list(store_chunks(tmp_path / "rays.duckdb", range_m=625.0, values=values))
    assert max(chunk.rays for chunk in chunks) <= values
    np.testing.assert_array_equal(
        np.concatenate([chunk.radial_speed_mps for chunk in chunks]), whole.radial_speed_mps[:, 1:]
    )
    assert {int(number) for chunk in chunks for number in chunk.sweep_id} == {0}


def test_what_a_store_lost_is_told_with_the_first_chunk_alone(tmp_path: Path) -> None:
    path = tmp_path / "rays.duckdb"
    write_store(path, replace(some(), losses=(Loss("a.txt", "cut", 3, times=2),)))
    chunks = list(store_chunks(path, values=20))
    assert len(chunks) > 1
    assert [chunk.losses for chunk in chunks] == [(Loss("a.txt", "cut", 3, 2),), *[()] * (len(chunks) - 1)]
