"""What pydantic finds wrong, in the words of a site file: key, what came, what is allowed."""

from collections.abc import Mapping
from typing import Any, get_args

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from planner import scan_plans
from planner.faults import NOTHING, Fault, Loc, did_you_mean
from planner.instruments import Instrument
from planner.site import Site

# Unions put such a tag into the place of an error; it is not a key of the file.
TAGGED: dict[str, type[BaseModel] | None] = {
    "<sector>": scan_plans.SectorScan,
    "<ppi>": scan_plans.PpiScan,
    "<rhi>": scan_plans.RhiScan,
    "<stare>": scan_plans.StareScan,
    "<raster>": scan_plans.RasterScan,
    "<points>": scan_plans.PointsScan,
    "<inline>": Instrument,
    "<catalogue>": None,
    "<word>": None,
    "<effects>": None,
    "<pairs>": None,
}

SHAPES = {  # what a short list of numbers holds, by the key that it stands under
    "position": "[easting, northing, height], three numbers [m]",
    "directions_deg": "[from, to], two directions [deg], clockwise; a list of such pairs",
    "speed_range_mps": "[lowest, highest], two speeds [m/s]",
    "polygon": "[easting, northing], two numbers [m], three corners at least",
}

ALLOWED = {
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "string_type": "text (in quotes where YAML would take it for a number or a date)",
    "string_too_short": "a name of at least one letter",
    "string_too_long": "a name of at most 100 letters",
    "string_pattern_mismatch": "a name on one line, without control characters",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "a mapping of keys and values",
    "model_type": "a mapping of keys and values",
    "model_attributes_type": "a mapping of keys and values",
    "path_type": "the path of a file",
}

BOUNDS = {
    "greater_than": ("gt", "a number above {}"),
    "greater_than_equal": ("ge", "a number of at least {}"),
    "less_than": ("lt", "a number below {}"),
    "less_than_equal": ("le", "a number of at most {}"),
    "too_short": ("min_length", "at least {} of them"),
    "too_long": ("max_length", "at most {} of them"),
}


def is_echo(details: ErrorDetails) -> bool:
    """Tell whether an error only repeats one inside: a list is "too short" once entries are refused."""
    came = details["input"]
    least = details.get("ctx", {}).get("min_length", 0)
    return details["type"] == "too_short" and isinstance(came, list | tuple) and len(came) >= least


def fault_of(details: ErrorDetails, raw: object, *, root: type[BaseModel] = Site) -> Fault:
    """One error of pydantic as a fault of the site file.

    Parameters
    ----------
    details : ErrorDetails
        From `ValidationError.errors()`, for a `Site`.
    raw : object
        The mapping that was validated.
    """
    loc, model = _place(details["loc"], root)
    kind, context = details["type"], details.get("ctx", {})
    if kind == "extra_forbidden":
        return _unknown_key(loc, model)
    if (kind == "missing" and isinstance(loc[-1], int)) or kind in ("too_long", "too_short", "tuple_type"):
        loc = loc[:-1] if kind == "missing" else loc
        if shape := SHAPES.get(_last_key(loc)):
            return Fault(loc, _value(raw, loc), shape)
    if kind == "union_tag_not_found":
        return _no_type(loc, raw)
    if kind == "missing":
        return Fault(loc, NOTHING, _wanted(model, str(loc[-1])), "This key is needed.")
    return Fault(loc, _value(raw, loc), _allowed(model, kind, context, details["msg"], loc))


def _limits(owner: type[BaseModel], loc: Loc) -> str:
    """Both ends of what a number may be, where its field states them."""
    field = owner.model_fields.get(_last_key(loc))
    words = {"gt": "above {:g}", "ge": "at least {:g}", "lt": "below {:g}", "le": "at most {:g}"}
    limits = [
        words[key].format(bound)
        for constraint in (field.metadata if field else ())
        for key in words
        if (bound := getattr(constraint, key, None)) is not None
    ]
    return f"a number {' and '.join(limits)}" if limits else ""


def _allowed(owner: type[BaseModel], kind: str, context: Mapping[str, Any], message: str, loc: Loc) -> str:
    if kind == "string_type" and loc == ("crs",):
        return "text such as EPSG:32632"
    if kind == "literal_error":
        return str(context["expected"]).replace("'", "")
    if kind in BOUNDS:
        return _limits(owner, loc) or BOUNDS[kind][1].format(f"{context[BOUNDS[kind][0]]:g}")
    if kind == "model_type" and _last_key(loc) == "instrument":
        return "a name from the catalogue, or a mapping with the instrument's own numbers"
    return ALLOWED.get(kind, message)


def _unknown_key(loc: Loc, model: type[BaseModel]) -> Fault:
    known = list(model.model_fields)
    question = did_you_mean(str(loc[-1]), known)
    text = f"this key is not known here; allowed: {', '.join(known)}. {question}"
    return Fault(loc, NOTHING, "", text.strip())


def _no_type(loc: Loc, raw: object) -> Fault:
    value = _value(raw, loc)
    if not isinstance(value, Mapping):
        return Fault(loc, value, "a mapping of keys and values that has a `type`")
    kinds = get_args(scan_plans.ScanType)
    came = value.get("type", NOTHING)
    hint = did_you_mean(came, list(kinds)) if isinstance(came, str) else "This key is needed."
    return Fault((*loc, "type"), came, ", ".join(kinds), hint)


def _wanted(model: type[BaseModel], key: str) -> str:
    """What a key that is missing would take."""
    if key in SHAPES:
        return SHAPES[key]
    if inner := _model_in(model.model_fields[key].annotation):
        return f"a mapping with {', '.join(inner.model_fields)}"
    annotation = model.model_fields[key].annotation
    if choices := [choice for choice in get_args(annotation) if isinstance(choice, str)]:
        return ", ".join(choices)
    return {float: "a number", int: "a whole number", str: "text"}.get(annotation, "a list")  # type: ignore[arg-type]


def _place(loc: tuple[int | str, ...], root: type[BaseModel]) -> tuple[Loc, type[BaseModel]]:
    """The place in the file, without the tags of unions, and the noun that the last key belongs to."""
    model = root
    owner = model
    place: list[int | str] = []
    for part in loc:
        if isinstance(part, str) and part in TAGGED:
            model = TAGGED[part] or model
            continue
        place.append(part)
        owner = model
        if isinstance(part, str) and part in model.model_fields:
            model = _model_in(model.model_fields[part].annotation) or model
    return tuple(place), owner


def _model_in(annotation: object) -> type[BaseModel] | None:
    """The noun inside an annotation such as `tuple[Lidar, ...]` or `Wind | None`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((model for part in get_args(annotation) if (model := _model_in(part))), None)


def _last_key(loc: Loc) -> str:
    return next((part for part in reversed(loc) if isinstance(part, str)), "")


def _value(raw: object, loc: Loc) -> object:
    for part in loc:
        try:
            raw = raw[part]  # type: ignore[index]
        except (KeyError, IndexError, TypeError):
            return NOTHING
    return raw
