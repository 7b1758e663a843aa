"""The site's frame: from a projected CRS to geographic coordinates and to east, north, up at each lidar.

Five earth models stand behind one interface. `exact` goes through earth-centred coordinates; the others are
cheaper and each knows what it leaves out (`LEFT_OUT`) and can be measured against `exact` at the very points
in question (`geometry.effects.model_error_m`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np

from geometry.arrays import ArrayLike, FloatArray, positions
from geometry.earth import REFRACTION_COEFFICIENT, ecef_to_enu_rotation, gaussian_radius_m
from geometry.errors import InputError
from geometry.projection import Projection, central_meridian_deg, projection_of
from geometry.tangent import Tangent

EarthModel = Literal["exact", "flat-grid", "flat", "curved", "refracted"]
HeightDatum = Literal["above_sea_level", "ellipsoidal"]

# What each earth model leaves out, for the list of what a scene needs; `geometry.effects.model_error_m` gives the size.
_ALONG_BEAM = "change of scale and convergence along the beam"
_VERTICAL = "deflection of the vertical"
LEFT_OUT: Mapping[EarthModel, tuple[str, ...]] = MappingProxyType(
    {
        "exact": ("refraction", _VERTICAL),
        "refracted": (_ALONG_BEAM, _VERTICAL),
        "curved": (_ALONG_BEAM, "refraction", _VERTICAL),
        "flat": (_ALONG_BEAM, "curvature", "refraction", _VERTICAL),
        "flat-grid": ("convergence", "scale", "curvature", "refraction", _VERTICAL),
    }
)

# Share of the Earth's curvature that each model on the tangent plane takes into account.
_BENDING: Mapping[EarthModel, float] = MappingProxyType(
    {"flat": 0.0, "curved": 1.0, "refracted": 1.0 - REFRACTION_COEFFICIENT}
)

# Step of the central difference that gives the grid's scale and turn at a head: 100 m keeps both the
# third-order term ((step/R)^2 = 2e-10) and the rounding (1e-9 m / step = 1e-11) under a micrometre in 3 km.
JACOBIAN_STEP_M = 100.0

GRID_AXES = "easting, northing, height"

# Undulations of the geoid lie between -107 and +86 m: Pavlis et al. (2012), J. Geophys. Res. 117, B04406.
MAX_UNDULATION_M = 120.0


@dataclass(frozen=True)
class SiteFrame:
    """The coordinates of a site and every way out of them.

    Parameters
    ----------
    crs
        Any projected CRS in metres that pyproj reads, such as ``EPSG:32632``; of a compound CRS the
        horizontal part.
    height_datum
        What heights are measured from: sea level, or the CRS' own ellipsoid.
    geoid_undulation_m
        Height of the geoid above the ellipsoid at the site [m], added to heights above sea level. None takes
        it as 0, which changes distances by 6 ppm per 40 m. Ellipsoidal heights need none and ignore it.

    Raises
    ------
    InputError
        If the CRS is unknown, geographic, not in metres or does not run east and north (feet are refused, not
        converted: ranges and heights are metres, and a silent mixture would be worse than a refusal).

    Notes
    -----
    Every position is easting, northing, height [m] on the last axis. "Exact" takes the ellipsoid's normal as
    the vertical: the deflection of the vertical (30 arc seconds in mountains is 0.9 m at 6 km) is left out by
    all models.

    Examples
    --------
    >>> frame = SiteFrame("EPSG:32632")
    >>> head = [448937.717, 6256404.894, 5.409]
    >>> frame.enu_m(head, [447647.39, 6255435.76, 4.836]).round(3).tolist()
    [-1279.027, -984.973, -0.777]
    >>> round(float(frame.convergence_deg(head)), 3)
    -0.69
    """

    crs: str
    height_datum: HeightDatum = "above_sea_level"
    geoid_undulation_m: float | None = None

    def __post_init__(self) -> None:
        if self.height_datum not in ("above_sea_level", "ellipsoidal"):
            raise InputError(
                f"height datum {self.height_datum!r} came; allowed are above_sea_level and ellipsoidal."
            )
        undulation = self.geoid_undulation_m
        if undulation is not None and not abs(undulation) <= MAX_UNDULATION_M:
            raise InputError(
                f"geoid undulation {undulation} m came; allowed is -{MAX_UNDULATION_M:g} to "
                f"{MAX_UNDULATION_M:g} m. Give the height of the geoid above the ellipsoid, or leave it out."
            )
        projection_of(self.crs)

    @property
    def area_of_use(self) -> tuple[float, float, float, float] | None:
        """West, south, east, north of where the CRS is meant to be used [deg]; None if it does not say.

        West is greater than east where the area crosses the antimeridian.
        """
        area = self._projection.crs.area_of_use
        return None if area is None else (area.west, area.south, area.east, area.north)

    @property
    def central_meridian_deg(self) -> float | None:
        """Longitude where grid north is true north [deg from Greenwich]; None if the CRS states none."""
        meridian = central_meridian_deg(self._projection.crs)
        return None if meridian is None else meridian + self._projection.prime_meridian_deg

    def geographic(self, points_m: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Longitude, latitude and ellipsoidal height of positions.

        Parameters
        ----------
        points_m
            Easting, northing, height [m], shape (..., 3).

        Returns
        -------
        tuple of FloatArray
            Longitude east of Greenwich in [-180, 180] [deg], latitude [deg] and height above the ellipsoid
            [m], each (...), on the CRS' own datum.

        Examples
        --------
        >>> longitude, latitude, height = SiteFrame("EPSG:32632").geographic([447647.39, 6255435.76, 4.8])
        >>> round(float(longitude), 5), round(float(latitude), 5), round(float(height), 3)
        (8.15089, 56.44054, 4.8)
        """
        projection = self._projection
        degrees = projection.transform(
            projection.to_geographic, self._ellipsoidal(positions(points_m, GRID_AXES))
        )
        longitude = degrees[..., 0] + projection.prime_meridian_deg
        longitude = np.where(np.abs(longitude) > 180.0, np.mod(longitude + 180.0, 360.0) - 180.0, longitude)
        return longitude, degrees[..., 1].copy(), degrees[..., 2].copy()

    def from_geographic(
        self, longitude_deg: ArrayLike, latitude_deg: ArrayLike, height_m: ArrayLike
    ) -> FloatArray:
        """Positions of longitude, latitude and ellipsoidal height: the inverse of `geographic`.

        Parameters
        ----------
        longitude_deg
            Longitude east of Greenwich [deg], on the CRS' own datum.
        latitude_deg
            Latitude [deg].
        height_m
            Height above the ellipsoid [m]. The three shapes broadcast.

        Returns
        -------
        FloatArray
            Easting, northing, height [m], shape (..., 3); the height in the frame's own datum.

        Examples
        --------
        >>> SiteFrame("EPSG:32632").from_geographic(9.0, 0.0, 10.0).round(3).tolist()
        [500000.0, 0.0, 10.0]
        """
        projection = self._projection
        longitude = np.asarray(longitude_deg, dtype=np.float64) - projection.prime_meridian_deg
        degrees = np.stack(np.broadcast_arrays(longitude, latitude_deg, height_m), axis=-1).astype(np.float64)
        points = projection.transform(projection.to_geographic, degrees, direction="inverse")
        points[..., 2] -= self._undulation_m
        return points

    def convergence_deg(self, points_m: ArrayLike) -> FloatArray:
        """Angle from true north to grid north: true azimuth = grid azimuth + convergence.

        Parameters
        ----------
        points_m
            Easting, northing, height [m], shape (..., 3).

        Returns
        -------
        FloatArray
            Meridian convergence [deg], shape (...); positive where grid north lies clockwise of true north,
            as it does east of the central meridian in the northern hemisphere.

        Examples
        --------
        >>> round(float(SiteFrame("EPSG:32632").convergence_deg([448937.717, 6256404.894, 5.4])), 3)
        -0.69
        """
        longitude, latitude = self._datum_degrees(points_m)
        return np.asarray(self._projection.factors.get_factors(longitude, latitude).meridian_convergence)

    def scale_factor(self, points_m: ArrayLike) -> FloatArray:
        """Grid distance divided by distance on the ellipsoid.

        Parameters
        ----------
        points_m
            Easting, northing, height [m], shape (..., 3).

        Returns
        -------
        FloatArray
            Point scale factor, without unit, shape (...); the mean over directions (root of the areal scale)
            where a projection is not conformal.

        Examples
        --------
        >>> round(float(SiteFrame("EPSG:32632").scale_factor([500000.0, 6256404.9, 0.0])), 6)
        0.9996
        """
        longitude, latitude = self._datum_degrees(points_m)
        areal_scale = np.asarray(self._projection.factors.get_factors(longitude, latitude).areal_scale)
        return np.asarray(np.sqrt(areal_scale))

    def enu_m(self, origin_m: ArrayLike, points_m: ArrayLike, *, model: EarthModel = "exact") -> FloatArray:
        """Positions in the east-north-up frame of one head.

        Parameters
        ----------
        origin_m
            Easting, northing, height of the head [m], shape (3,).
        points_m
            Easting, northing, height [m], shape (..., 3). Float32 is widened before anything is subtracted,
            but what it has lost already (0.25 m in a northing of 6 million) cannot come back.
        model
            ``exact``: through earth-centred coordinates; the reference of the others.
            ``refracted``: as ``curved``, with the point lifted as the bent beam sees it (k = 0.13).
            ``curved``: as ``flat``, less the curvature drop.
            ``flat``: grid differences turned by the convergence and divided by the scale at the head and the
            height factor at the point.
            ``flat-grid``: grid differences as they are; north is grid north.

        Returns
        -------
        FloatArray
            True (for ``flat-grid``: grid) east, true north, up [m] from the head, shape (..., 3).

        Raises
        ------
        InputError
            If a shape does not end in 3, or the CRS cannot map a position, or the model is not one of the
            five.

        Notes
        -----
        The exact model rotates earth-centred differences into the head's axes: EPSG Guidance Note 7-2,
        method 9836. Largest error of the others against it, in metres, over all directions, up to 500 m above the
        head, in UTM (EPSG:32632; `model_error_m` gives it for any scene, and the tests hold these numbers):

        ============ ======= ======= ======= ========= =======================================
        model        at 1 km    3 km    6 km     30 km where
        ============ ======= ======= ======= ========= =======================================
        flat-grid       12.4    37.1    74.2     377.8 Høvsøre, 0.7° west of its meridian
        flat-grid       40.1   120.4   240.9    1208.2 zone edge at 50° N
        flat           0.078    0.71    2.82      70.5 anywhere: the curvature
        curved        0.0008   0.006   0.026      0.81 Høvsøre
        curved         0.003   0.024   0.098      2.60 zone edge at 50° N
        refracted      0.010    0.09    0.37      9.25 Høvsøre: the lift, which `exact` has not
        ============ ======= ======= ======= ========= =======================================

        `exact` agrees with 50-digit arithmetic on the ellipsoid within 2e-8 m in conformal projections;
        PROJ's inverse of equal-area ones is good to 1 mm.

        Examples
        --------
        >>> frame = SiteFrame("EPSG:32632")
        >>> head, point = [500000.0, 6256400.0, 0.0], [500000.0, 6262400.0, 0.0]
        >>> for model in ("exact", "refracted", "curved", "flat", "flat-grid"):
        ...     print(model, (frame.enu_m(head, point, model=model) + 0.0).round(2).tolist())
        exact [0.0, 6002.4, -2.82]
        refracted [0.0, 6002.4, -2.45]
        curved [0.0, 6002.4, -2.82]
        flat [0.0, 6002.4, 0.0]
        flat-grid [0.0, 6000.0, 0.0]
        """
        origin, points = _origin(origin_m), positions(points_m, GRID_AXES)
        if model == "exact":
            return self._exact_enu(origin, points)
        if model == "flat-grid":
            return points - origin
        bending = _bending(model)
        ground = self._tangent(origin).to_ground(points.reshape(-1, 3), origin, bending=bending)
        return ground.reshape(points.shape)

    def projected_m(
        self, origin_m: ArrayLike, enu_m: ArrayLike, *, model: EarthModel = "exact"
    ) -> FloatArray:
        """Positions in the site's CRS of points in a head's east-north-up frame: the inverse of `enu_m`.

        Parameters
        ----------
        origin_m
            Easting, northing, height of the head [m], shape (3,).
        enu_m
            East, north, up [m] from the head, shape (..., 3).
        model
            One of the five earth models; see `enu_m`.

        Returns
        -------
        FloatArray
            Easting, northing, height [m], shape (..., 3). With ``exact`` the height is PROJ's: good to 1e-7 m
            up to 3 km above the ellipsoid and to 1e-5 m at 30 km.

        Raises
        ------
        InputError
            As `enu_m`.

        Examples
        --------
        >>> frame = SiteFrame("EPSG:32632")
        >>> head = [447450.548, 6256541.135, 4.054]
        >>> frame.projected_m(head, frame.enu_m(head, [447647.39, 6255435.76, 121.336])).round(3).tolist()
        [447647.39, 6255435.76, 121.336]
        """
        origin, enu = _origin(origin_m), positions(enu_m, "east, north, up")
        if model == "exact":
            return self._exact_projected(origin, enu)
        if model == "flat-grid":
            return enu + origin
        bending = _bending(model)
        return self._tangent(origin).to_grid(enu.reshape(-1, 3), bending=bending).reshape(enu.shape) + origin

    @property
    def _projection(self) -> Projection:
        return projection_of(self.crs)

    @property
    def _undulation_m(self) -> float:
        return 0.0 if self.height_datum == "ellipsoidal" else self.geoid_undulation_m or 0.0

    def _ellipsoidal(self, points: FloatArray) -> FloatArray:
        """Positions with heights above the ellipsoid."""
        return np.asarray(points + np.array([0.0, 0.0, self._undulation_m]), dtype=np.float64)

    def _datum_degrees(self, points_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Longitude from the datum's own prime meridian, as PROJ's factors want it, and latitude [deg]."""
        projection = self._projection
        degrees = projection.transform(
            projection.to_geographic, self._ellipsoidal(positions(points_m, GRID_AXES))
        )
        return degrees[..., 0].copy(), degrees[..., 1].copy()

    def _head(self, origin: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Earth-centred position (3,) of a head and the rotation (3, 3) to its local axes."""
        projection = self._projection
        ellipsoidal = self._ellipsoidal(origin)
        longitude, latitude, _ = projection.transform(projection.to_geographic, ellipsoidal)
        centre = projection.transform(projection.to_ecef, ellipsoidal)
        return centre, ecef_to_enu_rotation(longitude, latitude)

    def _exact_enu(self, origin: FloatArray, points: FloatArray) -> FloatArray:
        centre, rotation = self._head(origin)
        offset = self._projection.transform(self._projection.to_ecef, self._ellipsoidal(points))
        offset -= centre
        return np.asarray(offset @ rotation.T, dtype=np.float64)

    def _exact_projected(self, origin: FloatArray, enu: FloatArray) -> FloatArray:
        centre, rotation = self._head(origin)
        ecef = enu @ rotation + centre
        points = self._projection.transform(self._projection.to_ecef, ecef, direction="inverse")
        points[..., 2] -= self._undulation_m
        return points

    def _tangent(self, origin: FloatArray) -> Tangent:
        """Scale, turn and radius at a head, from the exact model's derivatives: conformal or not."""
        projection = self._projection
        step = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]]) * JACOBIAN_STEP_M
        grid = self._exact_projected(origin, step)[:, :2] - origin[:2]
        jacobian = np.stack([grid[0] - grid[1], grid[2] - grid[3]], axis=-1) / (2.0 * JACOBIAN_STEP_M)
        _, latitude, height = projection.transform(projection.to_geographic, self._ellipsoidal(origin))
        radius = gaussian_radius_m(
            latitude,
            semi_major_m=projection.semi_major_m,
            eccentricity_squared=projection.eccentricity_squared,
        )
        return Tangent(jacobian, float(radius + height))


def _bending(model: EarthModel) -> float:
    """Share of the Earth's curvature that a tangent model takes into account."""
    if model not in _BENDING:
        raise InputError(f"earth model {model!r} came; allowed are {', '.join(LEFT_OUT)}.")
    return _BENDING[model]


def _origin(origin_m: ArrayLike) -> FloatArray:
    """Check that a head is one finite position."""
    origin = positions(origin_m, GRID_AXES)
    if origin.shape != (3,) or not np.isfinite(origin).all():
        raise InputError(
            f"head position {origin.tolist()} of shape {origin.shape} came; allowed are three finite "
            "numbers: easting, northing, height in metres. Call once for each head."
        )
    return origin
