"""What a field sheet says in words: where the head has to be, its norths, its level, and what to do in order."""

import math
from collections.abc import Iterator, Sequence

from geometry.angles import wrap_180_deg, wrap_360_deg
from planner.cnr_map import choose_targets
from planner.ground import ground_under_m
from planner.places import Places
from planner.report_values import fixed, sensible
from planner.scan_layout import ScanLayout
from planner.site import Lidar, Site

# Declination drifts and the needle bends near iron: a compass is good for a first turn only.
COMPASS_DEG = 1.0


def magnetic_deg(azimuth_true_deg: float, declination_deg: float | None) -> float | None:
    """Bearing that a compass shows: true less declination, which is positive where the needle points east of north.

    Examples
    --------
    >>> magnetic_deg(2.0, 3.5), magnetic_deg(192.0, None)
    (358.5, None)
    """
    return None if declination_deg is None else float(wrap_360_deg(azimuth_true_deg - declination_deg))


def level_limit_deg(tolerance_m: float, range_m: float) -> float:
    """Tilt that moves a beam by a tolerance at a range [deg].

    Examples
    --------
    >>> round(level_limit_deg(0.5, 1123.0), 4)
    0.0255
    """
    return math.degrees(math.atan2(tolerance_m, range_m))


def degrees_minutes(value_deg: float, letters: str) -> str:
    """Write a latitude or longitude in degrees, minutes and seconds.

    Examples
    --------
    >>> degrees_minutes(56.450450094, "NS"), degrees_minutes(-3.5, "EW"), degrees_minutes(7.99999999, "EW")
    ('56° 27′ 01.620″ N', '3° 30′ 00.000″ W', '8° 00′ 00.000″ E')
    """
    total = round(abs(value_deg) * 3_600_000)  # thousandths of a second: 3 cm
    seconds, thousandths = divmod(total, 1000)
    minutes, second = divmod(seconds, 60)
    degree, minute = divmod(minutes, 60)
    return f"{degree}° {minute:02d}′ {second:02d}.{thousandths:03d}″ {letters[value_deg < 0]}"


def position_rows(places: Places, lidar: Lidar) -> list[tuple[str, str]]:
    """Where the head has to be."""
    site = places.site
    easting, northing, height = lidar.position
    longitude, latitude, _ = (float(value) for value in places.frame.geographic(lidar.position))
    above = "sea level" if site.height_datum == "above_sea_level" else "the ellipsoid"
    ground_m = float(ground_under_m(site, lidar.position))
    ground = f"{_above(height - ground_m)} the ground ({ground_m:.6g} m)"
    return [
        ("east, north", f"{easting:.3f} m, {northing:.3f} m ({site.crs})"),
        (
            "height",
            f"{height:.3f} m above {above}, {ground if math.isfinite(ground_m) else 'outside the terrain'}",
        ),
        ("lat., lon.", f"{degrees_minutes(latitude, 'NS')}, {degrees_minutes(longitude, 'EW')}"),
        ("", f"{latitude:.7f}, {longitude:.7f}"),
        ("to be within", f"{lidar.uncertainty.position_m:g} m (k = 1)"),
    ]


def north_rows(places: Places, lidar: Lidar, declination_deg: float | None) -> list[tuple[str, str]]:
    """Where the head's zero points, and how the norths differ here."""
    convergence_deg = places.convergence_deg(lidar)
    zero_true, _ = places.mounting(lidar).to_true(0.0, 0.0)
    zero_deg = float(zero_true)
    compass = magnetic_deg(zero_deg, declination_deg)
    rows = [
        (
            "head's zero",
            f"{zero_deg:.3f}° from true, {wrap_360_deg(zero_deg - convergence_deg):.3f}° from grid north",
        ),
        ("", f"{compass:.1f}° by compass" if compass is not None else "by compass: give --declination"),
        ("planned as", f"{lidar.north} north, heading {lidar.mounting.heading_deg:g}°"),
        (
            "offsets",
            f"azimuth {fixed(lidar.azimuth_offset_deg, 3, signed=True)}°, elevation "
            f"{fixed(lidar.elevation_offset_deg, 3, signed=True)}° (pointing = head + offset)",
        ),
        ("grid north", f"{_side(convergence_deg, 3)} of true north"),
    ]
    if declination_deg is not None:
        rows.append(("magnetic north", f"{_side(float(wrap_180_deg(declination_deg)), 2)} of true north"))
    return rows


def level_rows(site: Site, lidar: Lidar, ranges_m: Sequence[float]) -> list[tuple[str, str]]:
    """How level the head has to stand for the beam to be where it is wanted."""
    limit_m = site.tolerance.position_m
    rows = [
        (
            "level within",
            f"{lidar.uncertainty.levelling_deg:g}° = {_slope(lidar.uncertainty.levelling_deg)} (k = 1)",
        )
    ]
    if ranges_m:
        farthest = max(ranges_m)
        tilt = level_limit_deg(limit_m, farthest)
        rows.append((f"for {limit_m:g} m at {farthest:.0f} m", f"{sensible(tilt)}° = {_slope(tilt)}"))
    rows.append(
        (
            "planned pitch, roll",
            f"{lidar.mounting.pitch_deg:g}° nose up, {lidar.mounting.roll_deg:g}° right down",
        )
    )
    return rows


def steps(
    places: Places, lidar: Lidar, scans: Sequence[ScanLayout], declination_deg: float | None
) -> Iterator[str]:
    """What to do, in order."""
    unsure = lidar.uncertainty
    tilt = f"{unsure.levelling_deg:g}° ({_slope(unsure.levelling_deg)})"
    zero, _ = places.mounting(lidar).to_true(0.0, 0.0)
    compass = magnetic_deg(float(zero), declination_deg)
    turn = f"Turn its zero to {float(zero):.1f}° true"
    if compass is not None:
        turn += f" ({compass:.1f}° by compass, good for {COMPASS_DEG:g}° at best, away from iron)"
    yield "Stand the lidar on firm ground over its mark; measure the head by GNSS and write it down."
    yield f"Level to {tilt} with the warm instrument, doors closed; read pitch and roll at four headings 90° apart."
    yield f"{turn}. Hard targets give the rest: {unsure.heading_deg:g}° are planned."
    yield "Set the clock to UTC by GNSS or NTP; write down its offset."
    best = choose_targets(places, lidar.name)
    if best is None:
        yield "No hard target is in sight and in reach: heading and offsets stay as they are; say so in the log."
    else:
        which = f"Map {', '.join(best.names)} (lidarplan cnr-map plan) within the search window, in 1 m gates"
        weak = ", ".join(angle.removesuffix("_deg").replace("_", " ") for angle in best.undetermined)
        yield f"{which}. They leave {weak} undetermined." if weak else f"{which}; write what was found."
        solve = f" --solve {','.join(best.solvable)}" if weak and best.solvable else ""
        yield (
            f"Fit the maps (lidarplan cnr-map fit --write{solve}): offsets go into the site file. Export anew; check the "
            "level again."
        )
    names = ", ".join(f"“{layout.name}”" for layout in scans)
    yield f"Start {names or 'the scans'}; look at the first file: angles, gates, CNR at the measured gate."
    yield "Photograph the lidar from four sides, the levels, and the horizon along the beams."


def _above(height_m: float) -> str:
    return f"{abs(height_m):.2f} m {'above' if height_m >= 0 else 'below'}"


def _side(angle_deg: float, digits: int) -> str:
    return f"{abs(angle_deg):.{digits}f}° {'east' if angle_deg >= 0 else 'west'}"


def _slope(tilt_deg: float) -> str:
    """A tilt as a level shows it."""
    return f"{sensible(1000 * math.tan(math.radians(tilt_deg)))} mm/m"
