"""What is taken for granted because a site does not say it."""

from collections.abc import Iterator
from pathlib import Path

from planner.scan_layout import DEFAULT_FFT_POINTS, DEFAULT_PULSE_NS
from planner.site import Lidar, ScanPlan, Site

UNCERTAINTIES = ("position_m", "heading_deg", "levelling_deg", "azimuth_deg", "elevation_deg", "range_m")


def assumptions(site: Site) -> tuple[str, ...]:
    """Say in one sentence each what is assumed, for the report.

    Parameters
    ----------
    site : Site
        As it was loaded: a value that the file gives is no assumption, even where it equals the default.

    Returns
    -------
    tuple of str

    Examples
    --------
    >>> from planner.site import Wind
    >>> assumptions(Site(name="Moor", crs="EPSG:25832", wind=Wind(shear_exponent=0.2)))[0]
    'Neither weibull, speeds_mps nor rose is given: all speeds from 4 to 25 m/s count alike.'
    """
    return (
        *_ground(site),
        *_wind(site),
        *_wakes(site),
        *_pulses(site),
        *_heads(site),
        *(text for lidar in site.lidars for text in _uncertainty(lidar)),
    )


def _ground(site: Site) -> Iterator[str]:
    if site.ground_height_m is None and site.terrain is None and site.lidars:
        yield f"No ground height is given: {site.ground_m:g} m, that of what stands lowest, is taken."


def _wind(site: Site) -> Iterator[str]:
    wind = site.wind
    if wind is None:
        yield "No wind is given: 10 m/s from all directions alike is taken, shear exponent 0.14."
    else:
        if wind.weibull is None and wind.speeds_mps is None and wind.rose is None:
            low, high = wind.speed_range_mps
            given = "Neither weibull, speeds_mps nor rose is given"
            yield f"{given}: all speeds from {low:g} to {high:g} m/s count alike."
        if wind.rose is not None and not _has_speeds(wind.rose):
            low, high = wind.speed_range_mps
            yield f"The wind rose has no Weibull columns: all speeds from {low:g} to {high:g} m/s count alike."
        if "shear_exponent" not in wind.model_fields_set:
            yield f"No shear exponent is given: {wind.shear_exponent:g} is taken."
    if wind is None or wind.turbulence is None:
        yield "No turbulence is given: errors that need it are not predicted."


def _has_speeds(rose: Path) -> bool:
    from planner.wind_rose import load_rose

    return load_rose(rose).weibull_scale_mps is not None


def _wakes(site: Site) -> Iterator[str]:
    if "wakes" not in site.model_fields_set and (site.turbines or site.obstacles):
        wakes = site.wakes
        yield (
            f"No wakes are described: model {wakes.model}, decay {wakes.decay:g} (on land), up to "
            f"{wakes.max_diameters:g} diameters."
        )


def _pulses(site: Site) -> Iterator[str]:
    """Pulses and FFTs that neither scan nor instrument names, once for each instrument."""
    taken: dict[tuple[str, str], list[str]] = {}
    for scan in site.scans:
        if missing := _missing_pulse(site, scan):
            key = (site.lidar(scan.lidar).device.name, " and ".join(missing))
            taken.setdefault(key, []).append(scan.name)
    for (device, missing_text), scans in taken.items():
        yield f"Neither scan nor instrument ({device}) says: {missing_text} taken for {', '.join(scans)}."


def _missing_pulse(site: Site, scan: ScanPlan) -> list[str]:
    pulse = site.pulse_of(scan)
    missing = []
    if scan.pulse_ns is None and (pulse is None or pulse.pulse_ns is None):
        missing.append(f"a pulse of {DEFAULT_PULSE_NS:g} ns")
    if scan.fft_points is None and (pulse is None or pulse.fft_points is None):
        missing.append(f"a probe of {DEFAULT_FFT_POINTS} FFT points")
    return missing


def _heads(site: Site) -> Iterator[str]:
    used = {scan.lidar for scan in site.scans}
    devices = {lidar.device.name: lidar.device for lidar in site.lidars if lidar.name in used}
    for device in devices.values():
        if device.head is None:
            yield f"Nothing is known of the head of {device.name}: it turns at any speed, taking no time."


def _uncertainty(lidar: Lidar) -> Iterator[str]:
    given = lidar.uncertainty.model_fields_set
    taken = [f"{key} {getattr(lidar.uncertainty, key):g}" for key in UNCERTAINTIES if key not in given]
    if lidar.uncertainty.radial_speed_mps is None:
        taken.append(f"radial_speed_mps {lidar.radial_speed_noise_mps:g}")
    if taken:
        yield f"Uncertainties of {lidar.name} that are not given are taken as: {', '.join(taken)}."
