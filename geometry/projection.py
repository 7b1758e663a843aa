"""What PROJ knows about one projected CRS, built once and kept: ellipsoid, transformations, factors.

Longitude, latitude and earth-centred coordinates are those of the CRS' own datum and ellipsoid: nothing is
shifted to another datum, so no accuracy is lost to a transformation between datums, whichever grids a machine
has.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from pyproj import CRS, Proj, Transformer
from pyproj.enums import TransformDirection
from pyproj.exceptions import CRSError

from geometry.arrays import FloatArray
from geometry.blocks import blocks
from geometry.errors import InputError

Direction = Literal["forward", "inverse"]

_DIRECTIONS = {"forward": TransformDirection.FORWARD, "inverse": TransformDirection.INVERSE}

# Names under which a CRS states the longitude through which its grid north is true north.
_MERIDIAN_PARAMETERS = ("Longitude of natural origin", "Longitude of false origin", "Longitude of origin")


@dataclass(frozen=True)
class Projection:
    """One projected CRS in metres, ready to transform; made by `projection_of`."""

    crs: CRS  # horizontal part
    to_ecef: Transformer  # easting, northing, ellipsoidal height -> X, Y, Z of the CRS' own ellipsoid
    to_geographic: Transformer  # easting, northing, ellipsoidal height -> longitude, latitude [deg], height
    factors: Proj
    prime_meridian_deg: float  # east of Greenwich
    semi_major_m: float
    eccentricity_squared: float

    def transform(
        self, transformer: Transformer, points: FloatArray, *, direction: Direction = "forward"
    ) -> FloatArray:
        """Send points (..., 3) through one of the transformers.

        NaN coordinates give NaN; finite ones that the projection cannot map raise `InputError`.
        """
        mapped = np.empty(points.shape)
        flat_points, flat_mapped = points.reshape(-1, 3), mapped.reshape(-1, 3)
        for block in blocks(len(flat_points)):
            first, second, third = flat_points[block].T
            columns = transformer.transform(first, second, third, direction=_DIRECTIONS[direction])
            for axis, column in enumerate(columns):
                flat_mapped[block, axis] = column
        if not np.isfinite(mapped.sum()):
            self._settle_missing(points, mapped)
        return mapped

    def _settle_missing(self, points: FloatArray, mapped: FloatArray) -> None:
        """Leave what came from NaN as NaN, and refuse what PROJ could not map (it answers inf)."""
        missing = np.isnan(points).any(axis=-1)
        mapped[missing] = np.nan
        refused = ~missing & ~np.isfinite(mapped).all(axis=-1)
        if refused.any():
            first = points[refused][0].tolist()
            raise InputError(
                f"{int(refused.sum())} position(s) came that {self.crs.name} cannot map, the first {first}; "
                "allowed are positions within its area of use. "
                "Check easting and northing for swapped or missing digits."
            )


@lru_cache(maxsize=64)
def projection_of(crs_text: str) -> Projection:
    """Build what PROJ knows about a projected CRS; once for each text, since a build costs milliseconds.

    Parameters
    ----------
    crs_text
        Anything that pyproj reads as a CRS: an EPSG code, a PROJ string, WKT.

    Returns
    -------
    Projection
        Its transformers (longitude first, always), factors and ellipsoid.

    Raises
    ------
    InputError
        If pyproj does not know the CRS, or it is not projected, not in metres, or its axes do not run east
        and north.
    """
    horizontal = _horizontal(crs_text)
    _check_axes(crs_text, horizontal)
    geodetic, ellipsoid = horizontal.geodetic_crs, horizontal.ellipsoid
    if geodetic is None or ellipsoid is None:
        raise InputError(f"CRS {crs_text!r} came without an ellipsoid. Use a CRS with a geodetic datum.")
    # the conversion within one datum, as PROJ writes it; heights pass through
    to_datum = Transformer.from_crs(horizontal, geodetic, always_xy=True).definition
    radians, _, last_step = to_datum.rpartition(" step proj=unitconvert ")
    if not last_step.startswith("xy_in=rad"):
        unit = geodetic.axis_info[0].unit_conversion_factor
        radians = f"{to_datum} step proj=unitconvert xy_in={unit!r} xy_out=rad"
    semi_major, semi_minor = ellipsoid.semi_major_metre, ellipsoid.semi_minor_metre
    meridian = horizontal.prime_meridian
    return Projection(
        crs=horizontal,
        to_ecef=Transformer.from_pipeline(f"{radians} step proj=cart a={semi_major!r} b={semi_minor!r}"),
        to_geographic=Transformer.from_pipeline(f"{radians} step proj=unitconvert xy_in=rad xy_out=deg"),
        factors=Proj(horizontal),
        prime_meridian_deg=0.0
        if meridian is None
        else math.degrees(meridian.longitude * float(meridian.unit_conversion_factor)),
        semi_major_m=semi_major,
        eccentricity_squared=1.0 - (semi_minor / semi_major) ** 2,
    )


def _horizontal(crs_text: str) -> CRS:
    """Read a CRS and take its horizontal part; heights are declared by the site, not by the CRS."""
    try:
        crs = CRS.from_user_input(crs_text)
    except CRSError as error:
        raise InputError(
            f"CRS {crs_text!r} came, which pyproj does not know ({error}); allowed is any projected CRS "
            "in metres. Give an EPSG code such as EPSG:32632."
        ) from error
    while crs.is_compound or crs.is_bound:
        inner = crs.sub_crs_list[0] if crs.is_compound else crs.source_crs
        if inner is None:
            break
        crs = inner
    return crs


def _check_axes(crs_text: str, crs: CRS) -> None:
    """Refuse what is not a projected CRS in metres with axes east and north (or radiating from a pole)."""
    if not crs.is_projected:
        kind = "geographic (degrees)" if crs.is_geographic else "not projected"
        raise InputError(
            f"CRS {crs_text!r} ({crs.name}) came, which is {kind}; allowed is a projected CRS in metres. "
            "Take the UTM zone of the site: EPSG:326zz north, EPSG:327zz south of the equator."
        )
    for axis in crs.axis_info[:2]:
        if axis.unit_conversion_factor != 1.0:
            raise InputError(
                f"CRS {crs_text!r} ({crs.name}) came in {axis.unit_name}; allowed are metres, the unit of "
                "heights and ranges. Convert the positions to a metric CRS, such as the UTM zone of the site."
            )
    if {axis.direction for axis in crs.axis_info[:2]} & {"west", "down", "up"}:
        raise InputError(
            f"CRS {crs_text!r} ({crs.name}) came, whose axes do not run east and north; allowed are easting "
            "and northing. Convert the positions, for example to the UTM zone of the site."
        )


def central_meridian_deg(crs: CRS) -> float | None:
    """Longitude of the CRS' central meridian [deg] on its own datum, None where the projection has none."""
    operation = crs.coordinate_operation
    for parameter in [] if operation is None else operation.params:
        if parameter.name in _MERIDIAN_PARAMETERS:
            return math.degrees(float(parameter.value) * parameter.unit_conversion_factor)
    return None
