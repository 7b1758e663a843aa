"""Whether positions lie where their CRS is made to be used, or have easting and northing swapped."""

from collections.abc import Sequence

import numpy as np

from geometry.arrays import BoolArray
from geometry.errors import InputError
from geometry.frames import SiteFrame
from planner.faults import Fault, Loc

# A site may reach this far over the edge of a zone; there a transverse Mercator is as good as inside.
MARGIN_DEG = 0.5

Place = tuple[float, float]  # easting, northing [m]


def inside_area(frame: SiteFrame, places: Sequence[Place]) -> BoolArray:
    """Tell which places lie in the CRS' area of use, or within 0.5° of it.

    Parameters
    ----------
    frame : SiteFrame
        With the CRS; one that states no area of use takes every place that it can map.
    places : sequence of (easting, northing)
        In metres.

    Returns
    -------
    BoolArray
        (place,)

    Examples
    --------
    >>> inside_area(SiteFrame("EPSG:32632"), [(447893.983, 6256558.133), (6256558.133, 447893.983)])
    array([ True, False])
    """
    if not places:
        return np.zeros(0, dtype=np.bool_)
    try:
        longitude, latitude, _ = frame.geographic([(*place, 0.0) for place in places])
    except InputError:  # one of them cannot be mapped: find out which
        if len(places) == 1:
            return np.zeros(1, dtype=np.bool_)
        return np.concatenate([inside_area(frame, [place]) for place in places])
    if (area := frame.area_of_use) is None:
        return np.ones(len(places), dtype=np.bool_)
    west, south, east, north = area
    width = (east - west) % 360.0 or 360.0
    along = (longitude - west + MARGIN_DEG) % 360.0 <= width + 2 * MARGIN_DEG
    return np.asarray(along & (latitude >= south - MARGIN_DEG) & (latitude <= north + MARGIN_DEG))


def position_faults(frame: SiteFrame, positions: Sequence[tuple[Loc, tuple[float, ...]]]) -> list[Fault]:
    """Find the positions that lie outside the CRS' area of use.

    Parameters
    ----------
    frame : SiteFrame
        With the site's CRS.
    positions : sequence of (loc, (easting, northing, ...))
        In metres.

    Returns
    -------
    list of Fault
        Each says whether exchanging easting and northing would mend it.
    """
    inside = inside_area(frame, [(position[0], position[1]) for _, position in positions])
    return [_fault(frame, *item) for item, good in zip(positions, inside, strict=True) if not good]


def _fault(frame: SiteFrame, loc: Loc, position: tuple[float, ...]) -> Fault:
    east_north = (position[0], position[1])
    if inside_area(frame, [(east_north[1], east_north[0])])[0]:
        hint = "Easting and northing are swapped: exchange the first two numbers."
    else:
        hint = _where(frame, east_north)
    return Fault(loc, position, f"[easting, northing, height] in {_area(frame)}", hint)


def _area(frame: SiteFrame) -> str:
    if frame.area_of_use is None:
        return f"the reach of {frame.crs}"
    west, south, east, north = frame.area_of_use
    return (
        f"the area of use of {frame.crs}: longitude {west:g} to {east:g}°, latitude {south:g} to {north:g}°"
    )


def _where(frame: SiteFrame, place: Place) -> str:
    try:
        longitude, latitude, _ = frame.geographic((*place, 0.0))
    except InputError:
        return "This one is off the map."
    return f"This one is at longitude {float(longitude):.2f}°, latitude {float(latitude):.2f}°."


def is_transverse_mercator(crs: str) -> bool:
    """Whether a projected CRS is a zone of a transverse Mercator projection, such as UTM.

    Examples
    --------
    >>> is_transverse_mercator("EPSG:25832"), is_transverse_mercator("EPSG:2154")
    (True, False)
    """
    from pyproj import CRS

    own = CRS.from_user_input(crs)
    projected = own.sub_crs_list[0] if own.is_compound else own
    operation = projected.coordinate_operation
    return operation is not None and operation.method_name.startswith("Transverse Mercator")
