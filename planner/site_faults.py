"""What one field cannot know: names used twice, references to nothing, positions off the map.

Works on the plain mapping of a site, faulty or not, so that every fault comes out in one pass, whatever else
is wrong.
"""

from collections.abc import Callable, Iterator, Mapping

from geometry.errors import InputError
from planner.faults import NOTHING, Fault, Loc, Raw, did_you_mean, entries, number

KINDS = {
    "lidars": "lidar",
    "masts": "mast",
    "turbines": "turbine",
    "obstacles": "obstacle",
    "hard_targets": "hard target",
    "targets": "target",
    "scans": "scan",
    "pairs": "pair",
}


def faults_of(raw: Raw) -> list[Fault]:
    """Every fault of a site that needs more than one field to see."""
    checks: tuple[Callable[[Raw], Iterator[Fault]], ...] = (
        _names,
        _references,
        _pairs,
        _instruments,
        _one_of,
        _aims,
        _spans,
        _positions,
    )
    return [fault for check in checks for fault in check(raw)]


def _names_of(raw: Raw, key: str) -> list[str]:
    return [name.strip() for _, item in entries(raw, key) if isinstance(name := item.get("name"), str)]


def _names(raw: Raw) -> Iterator[Fault]:
    for key, kind in KINDS.items():
        first: dict[str, int] = {}
        for index, item in entries(raw, key):
            name = item.get("name")
            if not isinstance(name, str):
                continue
            if name.strip() in first:
                where = f"{key}[{first[name.strip()]}]"
                yield Fault(
                    (key, index, "name"), name, f"a name that no other {kind} has ({where} has it already)"
                )
            first.setdefault(name.strip(), index)


def _reference(raw: Raw, loc: Loc, name: object, *lists: str) -> Iterator[Fault]:
    if not isinstance(name, str):
        return
    known = list(dict.fromkeys(known for key in lists for known in _names_of(raw, key)))
    if name.strip() not in known:
        kinds = " or ".join(KINDS[key] for key in lists)
        allowed = (
            f"the name of a {kinds}: {', '.join(known)}"
            if known
            else f"the name of a {kinds}, and none is declared"
        )
        yield Fault(loc, name, allowed, did_you_mean(name, known))


def _references(raw: Raw) -> Iterator[Fault]:
    singles = (
        ("hard_targets", "on", "masts"),
        ("targets", "mast", "masts"),
        ("scans", "lidar", "lidars"),
        ("scans", "target", "targets"),
        ("scans", "hard_target", "hard_targets"),
        ("pairs", "target", "targets"),
    )
    for key, field, where in singles:
        for index, item in entries(raw, key):
            yield from _reference(raw, (key, index, field), item.get(field), where)
    for key, field, where in (("scans", "targets", "targets"), ("pairs", "scans", "scans")):
        for index, item in entries(raw, key):
            names = item.get(field)
            for place, name in enumerate(names if isinstance(names, list | tuple) else ()):
                yield from _reference(raw, (key, index, field, place), name, where)


def _pairs(raw: Raw) -> Iterator[Fault]:
    """A pair that names one scan twice, or two scans of one lidar: its beams do not cross."""
    lidar_of = {
        name.strip(): lidar.strip()
        for _, item in entries(raw, "scans")
        if isinstance(name := item.get("name"), str) and isinstance(lidar := item.get("lidar"), str)
    }
    for index, item in entries(raw, "pairs"):
        names = item.get("scans")
        if item.get("columns") == 3 and isinstance(names, list | tuple) and len(names) < 3:
            yield Fault(("pairs", index, "columns"), 3, "3 (u, v and w) only with three scans or more")
        taken: dict[str, str] = {}
        seen: set[str] = set()
        for place, name in enumerate(names if isinstance(names, list | tuple) else ()):
            if not isinstance(name, str) or (lidar := lidar_of.get(name.strip())) is None:
                continue
            if lidar in taken:
                twice = name.strip() in seen
                has = "it is named twice" if twice else f"{taken[lidar]} is a scan of {lidar} too"
                yield Fault(("pairs", index, "scans", place), name, f"a scan of another lidar ({has})")
            taken.setdefault(lidar, name.strip())
            seen.add(name.strip())


def _instruments(raw: Raw) -> Iterator[Fault]:
    from planner.instruments import CATALOGUE

    for index, item in entries(raw, "lidars"):
        name = item.get("instrument")
        if isinstance(name, str) and name.strip() not in CATALOGUE:
            allowed = f"{', '.join(CATALOGUE)}, or a mapping with the instrument's own numbers"
            yield Fault(("lidars", index, "instrument"), name, allowed, did_you_mean(name, list(CATALOGUE)))


def _given(item: Raw, *keys: str) -> list[str]:
    return [key for key in keys if item.get(key) is not None]


def _one_of(raw: Raw) -> Iterator[Fault]:
    """Where two ways of saying the same exclude each other."""
    for key, on in (("targets", "mast"), ("hard_targets", "on")):
        for index, item in entries(raw, key):
            if len(given := _given(item, on, "position")) != 1:
                came = {k: item[k] for k in given} if given else NOTHING
                yield Fault((key, index), came, f"either `{on}` or `position`")
    for index, item in entries(raw, "targets"):
        has_height = item.get("height_m") is not None
        if item.get("mast") is not None and not has_height:
            yield Fault(
                ("targets", index, "height_m"), NOTHING, "a height above the mast's base [m], at least 0"
            )
        if item.get("mast") is None and item.get("position") is not None and has_height:
            hint = "The third number of `position` is the target's height above the datum."
            yield Fault(
                ("targets", index, "height_m"), item["height_m"], "a height only together with `mast`", hint
            )
    if len(given := _given(raw, "ground_height_m", "terrain")) > 1:
        yield Fault(("terrain",), raw["terrain"], "either `ground_height_m` or `terrain`, not both")
    wind = raw.get("wind")
    if isinstance(wind, Mapping) and len(given := _given(wind, "weibull", "speeds_mps", "rose")) > 1:
        yield Fault(
            ("wind", given[1]),
            wind[given[1]],
            f"one of weibull, speeds_mps and rose ({given[0]} is given too)",
        )
    areas = raw.get("areas")
    for key in ("allowed", "forbidden"):
        for index, item in entries(areas, key) if isinstance(areas, Mapping) else ():
            if len(given := _given(item, "file", "polygon")) != 1:
                yield Fault(("areas", key, index), item, "either `file` or `polygon`")


AIMS: dict[
    str, tuple[tuple[str, ...], ...]
] = {  # what a scan of a type may point with: one of these sets of keys
    "sector": (("target",), ("azimuth_head_deg", "elevation_head_deg")),
    "stare": (("target",), ("azimuth_head_deg", "elevation_head_deg")),
    "ppi": (("target",), ("elevation_head_deg",)),
    "rhi": (("target",), ("azimuth_head_deg",)),
    "raster": (("target",), ("hard_target",), ("azimuth_head_deg", "elevation_head_deg")),
}


def _aims(raw: Raw) -> Iterator[Fault]:
    """A scan that points nowhere."""
    for index, item in entries(raw, "scans"):
        kind = item.get("type")
        ways = AIMS.get(kind, ()) if isinstance(kind, str) else ()
        if ways and not any(len(_given(item, *keys)) == len(keys) for keys in ways):
            allowed = ", or ".join(" and ".join(f"`{key}`" for key in keys) for keys in ways)
            yield Fault(("scans", index, "target"), NOTHING, f"for a {kind} scan: {allowed}")
        if kind == "points" and item.get("target") is not None:
            yield Fault(
                ("scans", index, "target"), item["target"], "for a points scan: `targets`, a list of names"
            )


def _spans(raw: Raw) -> Iterator[Fault]:
    """Angles that are no whole number of steps, and ranges that are empty."""
    for index, item in entries(raw, "scans"):
        low, high = number(item.get("elevation_from_deg")), number(item.get("elevation_to_deg"))
        if low is not None and low == high:
            allowed = f"an angle other than elevation_from_deg ({low:g})"
            yield Fault(("scans", index, "elevation_to_deg"), item["elevation_to_deg"], allowed)
        for step_key, span_key, span in _swept(item, low, high):
            yield from _whole_steps(("scans", index, step_key), item.get(step_key), span_key, span)
    wind = raw.get("wind")
    yield from _wind_spans(wind) if isinstance(wind, Mapping) else ()


def _swept(item: Raw, low: float | None, high: float | None) -> Iterator[tuple[str, str, float | None]]:
    """The steps of a scan, what each divides, and its size [deg]."""
    kind = item.get("type")
    if kind == "sector":
        yield "step_deg", "sector_deg", number(item.get("sector_deg"))
    elif kind == "ppi":
        yield "step_deg", "the circle", 360.0
    elif kind == "rhi" and low is not None and high is not None:
        yield "step_deg", "the elevation", abs(high - low)
    elif kind == "raster":
        elevation_step = "step_deg" if item.get("elevation_step_deg") is None else "elevation_step_deg"
        yield "step_deg", "width_deg", number(item.get("width_deg"))
        yield elevation_step, "height_deg", number(item.get("height_deg"))


def _whole_steps(loc: Loc, came: object, span_key: str, span: float | None) -> Iterator[Fault]:
    from geometry.sweeps import whole_steps

    step = number(came)
    if step is None or span is None or step <= 0 or span <= 0:
        return
    try:
        whole_steps(span_key, span, step)
    except InputError as error:
        yield Fault(
            loc, came, f"a step that divides {span_key} evenly", f"{str(error)[0].upper()}{str(error)[1:]}."
        )


def _wind_spans(wind: Raw) -> Iterator[Fault]:
    speeds, sectors = wind.get("speed_range_mps"), wind.get("directions_deg")
    if isinstance(speeds, list | tuple) and len(speeds) == 2:
        low, high = number(speeds[0]), number(speeds[1])
        if low is not None and high is not None and low >= high:
            yield Fault(("wind", "speed_range_mps"), speeds, "two speeds [m/s], the lower one first")
    for index, sector in enumerate(sectors if isinstance(sectors, list | tuple) else ()):
        if (
            isinstance(sector, list | tuple)
            and len(sector) == 2
            and number(sector[0]) is not None
            and sector[0] == sector[1]
        ):
            loc = ("wind", "directions_deg", index)
            yield Fault(
                loc,
                sector,
                "[from, to], two different directions [deg], clockwise",
                "The full circle is [0, 360].",
            )


def _positions(raw: Raw) -> Iterator[Fault]:
    """The CRS, and positions that it was not made for."""
    name = raw.get("crs")
    if not isinstance(name, str) or not name.strip():
        return
    from geometry.frames import SiteFrame
    from planner.crs_area import position_faults

    try:
        frame = SiteFrame(name.strip())
    except InputError as error:
        yield Fault(("crs",), name, "", str(error))
        return
    yield from position_faults(frame, list(_given_positions(raw)))


def _given_positions(raw: Raw) -> Iterator[tuple[Loc, tuple[float, ...]]]:
    for key in KINDS:
        for index, item in entries(raw, key):
            position = item.get("position")
            if isinstance(position, list | tuple) and len(position) == 3:
                numbers = tuple(value for part in position if (value := number(part)) is not None)
                if len(numbers) == 3:
                    yield (key, index, "position"), numbers
