"""The known lidars: pulses, gates, head, limits and noise, each number with its source.

What no public source was found for is None: a check that needs it says so, and a site file may give the
number inline. Nothing here is a maker's guarantee.
"""

from types import MappingProxyType
from typing import Annotated

from pydantic import Field

from geometry.errors import InputError
from planner.nouns import Count, Name, NonNegative, Noun, Number, Positive


class Pulse(Noun):
    """One pulse mode."""

    pulse_ns: Positive | None = None
    """Pulse length, full width at half maximum. Without it: 200 ns. E.g. 200"""
    pulse_repetition_hz: Positive
    """Pulse repetition frequency. E.g. 20000"""
    fft_points: Count | None = None
    """Samples of one gate where the scan does not say. Without it: 64. E.g. 64"""


class Head(Noun):
    """How fast and how far a head turns."""

    azimuth_speed_deg_per_s: Positive
    """Largest angular speed in azimuth. E.g. 50"""
    elevation_speed_deg_per_s: Positive
    """Largest angular speed in elevation. E.g. 50"""
    azimuth_acceleration_deg_per_s2: Positive
    """Largest angular acceleration in azimuth. E.g. 100"""
    elevation_acceleration_deg_per_s2: Positive
    """Largest angular acceleration in elevation. E.g. 100"""
    elevation_min_deg: Number | None = None
    """Lowest elevation that the head reaches. Without it: not checked. E.g. -10"""
    elevation_max_deg: Number | None = None
    """Highest elevation that the head reaches. Without it: not checked. E.g. 190"""
    resolution_deg: Positive | None = None
    """Smallest step of the head. Without it: 0.001. E.g. 0.001"""


class Source(Noun):
    """Where the numbers of some fields come from."""

    fields: tuple[str, ...]
    """Keys whose numbers it is about. E.g. [head]"""
    text: str
    """Where they come from. E.g. maker's data sheet"""


class Instrument(Noun):
    """The numbers of a scanning lidar; what is not known is left out."""

    name: Name = "inline"
    """Name of the instrument, in tables and messages. E.g. my lidar"""
    pulses: tuple[Pulse, ...] = ()
    """Pulse modes."""
    default_pulse_ns: Positive | None = None
    """Pulse where the scan does not say. Without it: the first of `pulses`. E.g. 200"""
    sample_ns: Positive = 4.0
    """Time between two samples of the digitiser. E.g. 10"""
    head: Head | None = None
    """How the head turns. Without it: it turns at any speed, taking no time."""
    max_gates: Count | None = None
    """Most range gates. Without it: not checked. E.g. 500"""
    min_range_m: NonNegative | None = None
    """End of the blind zone. Without it: not checked. E.g. 100"""
    max_range_m: Positive | None = None
    """Range beyond which nothing is measured. Without it: not checked; `place` takes 6 km. E.g. 6000"""
    min_accumulation_s: Positive | None = None
    """Shortest accumulation. Without it: not checked. E.g. 0.1"""
    radial_speed_limit_mps: Positive | None = None
    """Largest radial speed toward or away. Without it: 30 m/s where a number is needed. E.g. 30"""
    radial_speed_noise_mps: NonNegative | None = None
    """Standard deviation of one radial speed at good signal. Without it: 0.1 m/s. E.g. 0.1"""
    sources: Annotated[tuple[Source, ...], Field(repr=False)] = ()
    """Where the numbers come from, for the report."""

    def pulse(self, pulse_ns: float | None = None) -> Pulse | None:
        """Find the mode of a pulse length (None: the default one); None where there is no such mode."""
        wanted_ns = self.default_pulse_ns if pulse_ns is None else pulse_ns
        if wanted_ns is None:
            return self.pulses[0] if self.pulses else None
        return next((mode for mode in self.pulses if mode.pulse_ns == wanted_ns), None)


_SIMON = (
    "long-range WindScanner, as handed down with the campaign of E. Simon (2015), MSc thesis, DTU and "
    "Uppsala University; not looked up in the thesis"
)
_WLS200S = (
    Source(
        fields=("pulses", "default_pulse_ns", "sample_ns", "max_gates", "max_range_m", "min_accumulation_s"),
        text="100, 200, 400 ns at 40, 20, 10 kHz, 250 MHz, FFT 64, 64, 128 points, up to 500 gates (some "
        f"software: 100), 12 km at most (ordinarily 6 km), 100 ms at least: {_SIMON}",
    ),
    Source(
        fields=("head", "radial_speed_limit_mps"),
        text=f"50 deg/s, 100 deg/s2, 0.001 deg, radial speeds to 30 m/s either way: {_SIMON}",
    ),
    Source(
        fields=("min_range_m",),
        text="first gate, 100 m, of a WindCube 200S file (NCAR ISS, WLS200s-181, 2021-06-30): what is used, "
        "not the maker's limit",
    ),
    Source(
        fields=("radial_speed_noise_mps",),
        text="assumed: with 0.1 m/s the errors published for Høvsøre are met; the signal of the day decides",
    ),
)
_NCAS = "National Centre for Atmospheric Science (UK), amof.ac.uk, instrument page of its HALO StreamLine"
_NOAA = "NOAA Chemical Sciences Laboratory, csl.noaa.gov, instrument page of its HALO StreamLine XR"
_HALO_HEAD = (
    "36 deg/s and deg/s2 in azimuth, 72 deg/s and deg/s2 in elevation: handed down for the StreamLines, "
    "no public page found"
)
_HALO_GATE = "HALO Stream Line Pro manual, page 27: gates of 10 points at 50 MHz by default"

_WLS200S_PULSES = (
    Pulse(pulse_ns=100, pulse_repetition_hz=40_000, fft_points=64),
    Pulse(pulse_ns=200, pulse_repetition_hz=20_000, fft_points=64),
    Pulse(pulse_ns=400, pulse_repetition_hz=10_000, fft_points=128),
)
_WLS200S_HEAD = Head(
    azimuth_speed_deg_per_s=50,
    elevation_speed_deg_per_s=50,
    azimuth_acceleration_deg_per_s2=100,
    elevation_acceleration_deg_per_s2=100,
    resolution_deg=0.001,
)


def _wls200s(name: str) -> Instrument:
    """WindScanner and WindCube 200S are one lidar with two kinds of software."""
    return Instrument(
        name=name,
        pulses=_WLS200S_PULSES,
        default_pulse_ns=200,
        head=_WLS200S_HEAD,
        max_gates=500,
        min_range_m=100,
        max_range_m=12_000,
        min_accumulation_s=0.1,
        radial_speed_limit_mps=30,
        radial_speed_noise_mps=0.1,
        sources=_WLS200S,
    )


def _unsourced(name: str) -> Instrument:
    """A lidar for whose numbers no public source was found; a site can give them inline."""
    sample = Source(fields=("sample_ns",), text="assumed to be that of the WindCube 200S")
    return Instrument(name=name, sources=(sample,))


def _streamline() -> Instrument:
    return Instrument(
        name="halo-streamline",
        pulses=(Pulse(pulse_repetition_hz=15_000, fft_points=10),),
        sample_ns=20,
        head=Head(
            azimuth_speed_deg_per_s=36,
            elevation_speed_deg_per_s=72,
            azimuth_acceleration_deg_per_s2=36,
            elevation_acceleration_deg_per_s2=72,
            elevation_min_deg=0,
            elevation_max_deg=180,
            resolution_deg=0.001,
        ),
        max_range_m=9600,
        radial_speed_limit_mps=19.2,
        sources=(
            Source(fields=("pulses", "sample_ns"), text=f"15 kHz, 50 MHz: {_NCAS}; {_HALO_GATE}"),
            Source(fields=("max_range_m", "radial_speed_limit_mps"), text=f"9600 m, 19.2 m/s: {_NCAS}"),
            Source(fields=("head",), text=f"{_HALO_HEAD}; elevation 0 to 180 deg, 0.001 deg: {_NCAS}"),
        ),
    )


def _streamline_xr() -> Instrument:
    return Instrument(
        name="halo-streamline-xr",
        pulses=(Pulse(pulse_ns=350, pulse_repetition_hz=10_000, fft_points=10),),
        sample_ns=20,
        head=Head(
            azimuth_speed_deg_per_s=36,
            elevation_speed_deg_per_s=72,
            azimuth_acceleration_deg_per_s2=36,
            elevation_acceleration_deg_per_s2=72,
        ),
        min_range_m=96,
        max_range_m=10_000,
        radial_speed_noise_mps=0.05,
        sources=(
            Source(fields=("pulses",), text=f"350 ns at 10 kHz: {_NOAA}; gates as {_HALO_GATE}"),
            Source(fields=("sample_ns",), text=_HALO_GATE),
            Source(
                fields=("min_range_m", "max_range_m", "radial_speed_noise_mps"),
                text=f"96 m to 10 km (typically 3 km), about 5 cm/s: {_NOAA}",
            ),
            Source(fields=("head",), text=_HALO_HEAD),
        ),
    )


CATALOGUE: MappingProxyType[str, Instrument] = MappingProxyType(
    {
        known.name: known
        for known in (
            _wls200s("windscanner-200s"),
            _unsourced("windcube-100s"),
            _wls200s("windcube-200s"),
            _unsourced("windcube-400s"),
            _streamline(),
            _streamline_xr(),
        )
    }
)


def instrument(name: str) -> Instrument:
    """Look an instrument up by its name in the catalogue.

    Raises
    ------
    InputError
        If there is none of that name.

    Examples
    --------
    >>> mode = instrument("windscanner-200s").pulse(400)
    >>> mode.pulse_repetition_hz, mode.fft_points
    (10000.0, 128)
    """
    if name not in CATALOGUE:
        raise InputError(f"instrument '{name}' is not in the catalogue; allowed: {', '.join(CATALOGUE)}")
    return CATALOGUE[name]
