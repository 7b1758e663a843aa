"""The catalogue: every number has its source, and the pulses are the published ones."""

import pytest

from geometry.errors import InputError
from planner.instruments import CATALOGUE, Instrument, instrument

SPEED_OF_LIGHT_MPS = 299_792_458.0


@pytest.mark.parametrize("known", CATALOGUE.values(), ids=list(CATALOGUE))
def test_every_number_has_a_source(known: Instrument) -> None:
    sourced = {field for source in known.sources for field in source.fields}
    given = {name for name in Instrument.model_fields if getattr(known, name) not in (None, (), "")}
    assert given - {"name", "sources"} <= sourced
    assert sourced <= given


@pytest.mark.parametrize("known", CATALOGUE.values(), ids=list(CATALOGUE))
def test_the_maximum_range_is_unambiguous_for_some_pulse(known: Instrument) -> None:
    """A pulse at f is unambiguous to c/2f; a maximum beyond all of them would be a slip."""
    if known.max_range_m is not None:
        reach_m = max(SPEED_OF_LIGHT_MPS / (2 * pulse.pulse_repetition_hz) for pulse in known.pulses)
        assert known.max_range_m <= reach_m


def test_the_windscanner_has_its_published_pulses() -> None:
    modes = [(p.pulse_ns, p.pulse_repetition_hz) for p in instrument("windscanner-200s").pulses]
    assert modes == [(100, 40_000), (200, 20_000), (400, 10_000)]


def test_a_pulse_is_found_by_its_length_and_the_default_without() -> None:
    scanner = instrument("windscanner-200s")
    default, long = scanner.pulse(), scanner.pulse(400)
    assert default is not None
    assert default.pulse_ns == 200
    assert long is not None
    assert long.pulse_repetition_hz == 10_000
    assert scanner.pulse(300) is None
    assert instrument("windcube-400s").pulse() is None


def test_an_unknown_instrument_says_which_there_are() -> None:
    with pytest.raises(InputError, match="allowed: windscanner-200s"):
        instrument("zephir")
