"""The cheap way from grid to ground: the plane that touches the site at one head, and the sphere below it.

To first order a projection is a 2x2 matrix at the head: it turns by the convergence and stretches by the
scale. What a plane lacks, the curvature of the Earth, is put back as the sphere's second-order drop.
"""

from typing import NamedTuple

import numpy as np

from geometry.arrays import FloatArray
from geometry.blocks import blocks
from geometry.earth import curvature_drop_m


class Tangent(NamedTuple):
    """Ground metres to grid metres at one head, and the sphere through it."""

    grid_per_ground: FloatArray  # (2, 2): grid easting, northing per metre true east, true north
    radius_m: float

    def to_ground(self, points_m: FloatArray, head_m: FloatArray, *, bending: float) -> FloatArray:
        """Turn grid positions into east, north, up at the head.

        Parameters
        ----------
        points_m
            Easting, northing, height [m], shape (n, 3).
        head_m
            Easting, northing, height of the head [m], shape (3,).
        bending
            Share of the curvature that is taken into account: 0 for a plane, 1 for the sphere, 1 - k for the
            path of a beam that bends with it.

        Returns
        -------
        FloatArray
            True east, true north, up [m], shape (n, 3).

        Examples
        --------
        >>> plane = Tangent(0.9996 * np.eye(2), 6371000.0)
        >>> plane.to_ground(np.array([[0.0, 6000.0, 0.0]]), np.zeros(3), bending=1.0).round(2).tolist()
        [[0.0, 6002.4, -2.83]]
        """
        (east_per_easting, east_per_northing), (north_per_easting, north_per_northing) = np.linalg.inv(
            self.grid_per_ground
        )
        ground = np.empty(points_m.shape)
        for block in blocks(len(points_m)):
            # column by column: three times as fast or more than broadcasting over a last axis of three
            easting, northing, up = (points_m[block, axis] - head_m[axis] for axis in range(3))
            # two verticals spread with height: at the point's height the same two stand further apart
            spread = 1.0 + up / self.radius_m
            ground[block, 0] = (east_per_easting * easting + east_per_northing * northing) * spread
            ground[block, 1] = (north_per_easting * easting + north_per_northing * northing) * spread
            ground[block, 2] = up - self._drop_m(ground[block], bending)
        return ground

    def to_grid(self, enu_m: FloatArray, *, bending: float) -> FloatArray:
        """Turn east, north, up into grid offsets from the head: the inverse of `to_ground`, exactly."""
        offset = enu_m.copy()
        offset[:, 2] += self._drop_m(enu_m, bending)
        offset[:, :2] /= 1.0 + offset[:, 2:] / self.radius_m
        offset[:, :2] = offset[:, :2] @ self.grid_per_ground.T
        return offset

    def _drop_m(self, enu_m: FloatArray, bending: float) -> FloatArray:
        """Drop of the bent ground below the plane [m], shape (n,)."""
        if bending == 0.0:
            return np.zeros(len(enu_m))
        east, north = enu_m[:, 0], enu_m[:, 1]
        return bending * curvature_drop_m(np.sqrt(east * east + north * north), self.radius_m)
