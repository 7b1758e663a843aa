"""The map's own limits, and things in one place."""

from collections.abc import Iterator

from planner.crs_area import is_transverse_mercator
from planner.finding import Finding
from planner.plan import Plan

# A UTM zone is 3° to each side; beyond it scale and convergence grow fast.
FAR_FROM_MERIDIAN_DEG = 3.5
# Closer together, two lidars or two targets are one and the same.
SAME_PLACE_M = 1.0


def find(plan: Plan) -> Iterator[Finding]:
    """Findings about the CRS and about lidars or targets in one place."""
    yield from _area(plan)
    yield from _meridian(plan)
    yield from _same_place(plan)


def _area(plan: Plan) -> Iterator[Finding]:
    """Positions against the CRS' area of use."""
    crs, area, outside_deg = plan.site.crs, plan.places.frame.area_of_use, plan.places.outside_area_deg
    if area is None or outside_deg is None:
        text = f"{crs} does not say where it is meant to be used, so positions are not checked against it"
        yield Finding("info", "crs-area", crs, None, "deg", None, f"{text}: look at them on the map")
        return
    if outside_deg > 0.0:
        west, south, east, north = area
        longitude_deg, latitude_deg = plan.longitude_latitude_deg
        text = (
            f"the site at latitude {latitude_deg:.3f}°, longitude {longitude_deg:.3f}° reaches "
            f"{outside_deg:.2f}° out of the area of use of {crs} (latitude {south:g} to {north:g}°, "
            f"longitude {west:g} to {east:g}°): take the CRS of its own zone"
        )
        yield Finding("warning", "crs-area", crs, outside_deg, "deg", 0.0, text)


def _meridian(plan: Plan) -> Iterator[Finding]:
    """Distance from the central meridian."""
    crs, off_deg = plan.site.crs, plan.from_meridian_deg
    if off_deg is not None and off_deg > FAR_FROM_MERIDIAN_DEG:
        advice = (
            "Pointing stays exact, but distances and angles taken from the map are off: take the "
            "neighbouring zone"
            if is_transverse_mercator(crs)
            else "Pointing stays exact, but grid distances and flat maps are off: a local UTM zone would be closer"
        )
        text = (
            f"the site is {off_deg:.1f}° from the central meridian of {crs}, over "
            f"{FAR_FROM_MERIDIAN_DEG:g}°, and its grid north is {plan.convergence_deg:.2f}° from true north. "
            f"{advice}"
        )
        yield Finding("warning", "central-meridian", crs, off_deg, "deg", FAR_FROM_MERIDIAN_DEG, text)


def _same_place(plan: Plan) -> Iterator[Finding]:
    """Lidars and targets against each other."""
    for kind, first, second, apart_m in plan.places.distances:
        if apart_m < SAME_PLACE_M:
            text = (
                f"the {kind} {first} and {second} are {apart_m:.2f} m apart, under {SAME_PLACE_M:g} m: if "
                "one position is a copy of the other, correct it"
            )
            yield Finding("warning", "same-place", f"{first}, {second}", apart_m, "m", SAME_PLACE_M, text)
