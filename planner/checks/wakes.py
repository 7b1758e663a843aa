"""What stands near the measurement: wakes in the wanted wind, and the air that a rotor slows before it."""

from collections.abc import Iterator

from geometry.angles import SectorSet
from geometry.wakes import IEC_FARTHEST_DIAMETERS, IEC_NEAREST_DIAMETERS
from planner.exclusion import Exclusion, Near
from planner.finding import Finding, Severity
from planner.plan import Plan

# IEC 61400-12-1 has the mast of a power curve 2 to 4 rotor diameters from its turbine, usually 2.5: nearer, the rotor's own
# blockage changes the wind in front of it.
INDUCTION_DIAMETERS = 2.5
# Nothing is left where no more than a thousandth of the wanted wind is.
LOST_SHARE_ERROR = 0.999


def find(plan: Plan) -> Iterator[Finding]:
    """Findings about wakes, induction and the reach of the IEC formula."""
    for exclusion in plan.exclusions:
        yield from _lost(exclusion)
        for near in plan.near_wakes(exclusion):
            yield from _induction(exclusion, near)
            yield from _iec_range(plan, exclusion, near)


def _lost(exclusion: Exclusion) -> Iterator[Finding]:
    """Wanted directions in which a wake touches what is measured."""
    share = exclusion.lost_share
    if share <= 0.0:
        return
    severe = share > LOST_SHARE_ERROR
    at_target = _spans(exclusion.lost_at_target)
    text = (
        f"wakes touch what the scan measures in {share:.0%} of the wanted wind, from "
        f"{_spans(exclusion.lost)} (model {exclusion.model}); the target itself is "
        f"{f'in them from {at_target}' if at_target else 'free of them'}: "
        + ("choose another place" if severe else "leave these directions out, or measure a smaller volume")
    )
    severity: Severity = "error" if severe else "warning"
    yield Finding(severity, "wake", _subject(exclusion), share, "share", 0.0, text)


def _induction(exclusion: Exclusion, near: Near) -> Iterator[Finding]:
    """Distance to a rotor against the reach of its blockage."""
    if near.is_rotor and near.volume_diameters < INDUCTION_DIAMETERS:
        text = (
            f"{_distance(near)}, under {INDUCTION_DIAMETERS:g}: its rotor slows the air in front of it; "
            "leave out winds that blow towards it, or measure farther away"
        )
        subject, value = _subject(exclusion), near.volume_diameters
        yield Finding("warning", "induction", subject, value, "diameters", INDUCTION_DIAMETERS, text)


def _iec_range(plan: Plan, exclusion: Exclusion, near: Near) -> Iterator[Finding]:
    """Distance against the range for which IEC 61400-12-1 means its formula."""
    value, most = near.volume_diameters, plan.site.wakes.max_diameters
    if (
        exclusion.model == "jensen"
        or IEC_NEAREST_DIAMETERS <= value <= IEC_FARTHEST_DIAMETERS
        or value > most
    ):
        return
    close = value < IEC_NEAREST_DIAMETERS
    limit = IEC_NEAREST_DIAMETERS if close else IEC_FARTHEST_DIAMETERS
    text = (
        f"{_distance(near)}, {'under' if close else 'over'} the {limit:g} for which IEC 61400-12-1 gives its "
        "disturbed sector: the formula is used all the same, outside its range; take its sector with care"
    )
    yield Finding("info", "iec-range", _subject(exclusion), value, "diameters", limit, text)


def _subject(exclusion: Exclusion) -> str:
    return f"{exclusion.scan} → {exclusion.target}"


def _distance(near: Near) -> str:
    """Both distances in words."""
    unit = "rotor diameters" if near.is_rotor else "equivalent diameters"
    at_target = f"{near.target_diameters:.2f} from the target"
    return f"{near.name} stands {near.volume_diameters:.2f} {unit} from what the scan measures ({at_target})"


def _spans(sectors: SectorSet) -> str:
    """Directions in words: 118-127°, 258-270°."""
    return ", ".join(f"{start:.0f}-{stop:.0f}°" for start, stop in sectors.pairs())
