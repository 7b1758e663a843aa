"""From radial speeds to wind, and how wrong it will be.

Conventions: radial speed is positive away from the lidar; wind direction is where the wind blows from, clockwise from
true north; u is east, v north, w up.
"""
