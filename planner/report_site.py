"""What a report says of the site itself: coordinates, the wind that was taken, and when and with what it was made."""

from collections.abc import Iterator
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from planner.nouns import Position
from planner.plan import Plan
from planner.report_values import DASH, Column, Table, Value, spans
from planner.site import Site, Wind

DISTRIBUTION = "lidarplan"

POSITIONS = (
    Column("kind", "kind"),
    Column("name", "name"),
    Column("easting_m", "easting", "m", 2),
    Column("northing_m", "northing", "m", 2),
    Column("height_m", "height", "m", 2),
    Column("latitude_deg", "latitude", "°", 6),
    Column("longitude_deg", "longitude", "°", 6),
)

WIND = (Column("quantity", "quantity"), Column("taken", "what was taken"))


def made_line(now: datetime | None = None) -> str:
    """When and with which version a report is made: the one line of it that differs from run to run.

    Examples
    --------
    >>> made_line(datetime(2026, 5, 4, 13, 5, tzinfo=UTC)).split(" by ")[0]
    'Made 2026-05-04 13:05 UTC'
    """
    when = (now or datetime.now(UTC)).astimezone(UTC)
    return f"Made {when:%Y-%m-%d %H:%M} UTC by lidarplan {_version()}"


def _version() -> str:
    """The installed version; a tree that is not installed has none."""
    try:
        return version(DISTRIBUTION)
    except PackageNotFoundError:
        return "(version not known: not installed)"


def position_table(plan: Plan) -> Table:
    """Where everything is: in the site's CRS, and as latitude and longitude on its datum."""
    named = list(_named(plan.site))
    if not named:
        return Table("positions", "Positions", POSITIONS, ())
    positions_m = np.array([position for _, _, position in named], dtype=np.float64)
    longitude_deg, latitude_deg, _ = plan.exact_places.frame.geographic(positions_m)
    rows: tuple[tuple[Value, ...], ...] = tuple(
        (kind, name, *map(float, position), float(latitude), float(longitude))
        for (kind, name, position), latitude, longitude in zip(
            named, latitude_deg, longitude_deg, strict=True
        )
    )
    return Table("positions", f"Positions in {plan.site.crs}, and on its datum", POSITIONS, rows)


def _named(site: Site) -> Iterator[tuple[str, str, Position]]:
    for lidar in site.lidars:
        yield "lidar", lidar.name, lidar.position
    for mast in site.masts:
        yield "mast", mast.name, mast.position
    for turbine in site.turbines:
        yield "turbine", turbine.name, turbine.position
    for target in site.targets:
        yield "target", target.name, site.target_position_m(target)


def wind_table(plan: Plan) -> Table:
    """The wind that findings, wakes and predictions are for."""
    wind = plan.site.assumed_wind
    rows = (
        ("speeds", _speeds(wind)),
        ("how often from where", _rose(wind)),
        ("directions that count", spans(plan.wanted.pairs())),
        ("turbulence", _turbulence(wind)),
        *_profile(wind),
    )
    return Table("wind", "The wind that was taken", WIND, rows)


def _speeds(wind: Wind) -> str:
    if wind.speeds_mps is not None:
        return ", ".join(f"{speed:g}" for speed in wind.speeds_mps) + " m/s, each alike"
    low, high = wind.speed_range_mps
    between = f"from {low:g} to {high:g} m/s"
    if wind.weibull is not None:
        return f"Weibull, scale {wind.weibull.scale_mps:g} m/s, shape {wind.weibull.shape:g}, {between}"
    return (
        f"by the rose where it has Weibull columns, else all alike, {between}"
        if wind.rose
        else f"all {between} alike"
    )


def _rose(wind: Wind) -> str:
    return "all directions alike" if wind.rose is None else f"wind rose {wind.rose.name}"


def _turbulence(wind: Wind) -> str:
    eddies = wind.turbulence
    if eddies is None:
        return f"{DASH} (not declared)"
    return f"intensity {eddies.intensity:g}, length {eddies.length_m:g} m, {eddies.model}"


def _profile(wind: Wind) -> Iterator[tuple[str, str]]:
    height_m = wind.reference_height_m
    yield (
        "speeds are those at",
        "each target's height" if height_m is None else f"{height_m:g} m above ground",
    )
    yield "shear exponent", f"{wind.shear_exponent:g}"
    yield "vertical wind", f"{wind.vertical_mps:g} m/s"
    yield "lateral gradient", f"{wind.lateral_gradient_per_s:g} 1/s"
