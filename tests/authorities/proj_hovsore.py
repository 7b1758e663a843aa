"""Print what PROJ alone says about Høvsøre; its output stands in proj_hovsore.txt."""

import sys

import pyproj

HEADS = {
    "WS_K": (447450.548, 6256541.135, 4.054),
    "WS_S": (447893.983, 6256558.133, 5.078),
    "WS_W": (448937.717, 6256404.894, 5.409),
}
CUP = (447647.39, 6255435.76, 121.336)
UTM = "+proj=utm +zone=32 +ellps=WGS84"


def main() -> None:
    """One line a head: topocentric pipeline, geodesic inverse, factors."""
    utm, geod = pyproj.Proj(UTM), pyproj.Geod(ellps="WGS84")
    longitude2, latitude2 = utm(*CUP[:2], inverse=True)
    sys.stdout.write(f"PROJ {pyproj.proj_version_str}\ncup {longitude2:.12f} {latitude2:.12f}\n")
    for name, (easting, northing, height) in HEADS.items():
        longitude, latitude = utm(easting, northing, inverse=True)
        topocentric = pyproj.Transformer.from_pipeline(
            f"+proj=pipeline +step +inv {UTM} +step +proj=cart +ellps=WGS84 +step +proj=topocentric "
            f"+ellps=WGS84 +lon_0={longitude!r} +lat_0={latitude!r} +h_0={height!r}"
        )
        azimuth, _, distance = geod.inv(longitude, latitude, longitude2, latitude2)
        factors = utm.get_factors(longitude, latitude)
        numbers = (*topocentric.transform(*CUP), azimuth % 360.0, distance, factors.meridian_convergence)
        line = " ".join(f"{number:.6f}" for number in numbers)
        sys.stdout.write(f"{name} {line} {factors.meridional_scale:.9f}\n")


if __name__ == "__main__":
    main()
