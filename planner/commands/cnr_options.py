"""The options that the commands on hard targets share."""

from typing import Annotated

import typer

LidarOption = Annotated[str, typer.Option("--lidar", metavar="L", help="Name of the lidar.")]
TargetsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--target",
        metavar="T",
        help="Hard target, mast or turbine; give it once for each. [default: the best three]",
    ),
]
OrderOption = Annotated[str, typer.Option("--order", metavar="rows|columns", help="PPI rows or RHI columns.")]
AccumulationOption = Annotated[
    float | None, typer.Option("--accumulation", metavar="S", help="Of one ray [s]. [default: the least]")
]
HeadingOption = Annotated[
    float | None,
    typer.Option("--heading-std", metavar="DEG", help="How well the heading is known; 180 for not at all."),
]
BeamOption = Annotated[
    float, typer.Option("--beam", metavar="M", help="Diameter of the beam at the target [m].")
]
PulseOption = Annotated[float | None, typer.Option("--pulse-ns", help="Pulse of the maps [ns].")]
FftOption = Annotated[
    int | None, typer.Option("--fft-points", min=1, help="Samples of one gate of the maps.")
]
SiteOption = Annotated[str, typer.Option("--site", metavar="SITE", help="Site file.")]
WriteOption = Annotated[bool, typer.Option("--write", help="Put the offsets into the site file.")]


def number(value: float) -> float | None:
    """JSON has no NaN: what is unknown is null."""
    from math import isfinite

    return float(value) if isfinite(value) else None
