"""What every noun of the site file is made of: frozen, no unknown key, finite numbers that are numbers."""

from dataclasses import fields
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StringConstraints

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Made = TypeVar("Made", bound=DataclassInstance)

# Strict: a YAML `true` or a quoted "1.5" is not a number. An integer is.
Number = Annotated[float, Field(strict=True)]
Positive = Annotated[float, Field(strict=True, gt=0)]
NonNegative = Annotated[float, Field(strict=True, ge=0)]
Share = Annotated[float, Field(strict=True, ge=0, le=1)]
Bearing = Annotated[float, Field(strict=True, ge=0, le=360)]
Count = Annotated[int, Field(strict=True, ge=1)]
Position = tuple[Number, Number, Number]  # easting, northing, height [m]
Name = Annotated[
    str,
    StringConstraints(strip_whitespace=True, min_length=1, max_length=100, pattern=r"^[^\x00-\x1f\x7f]+$"),
]


def name_of_true(value: object) -> object:
    """`north: true` is a boolean to YAML and the word "true" to a person."""
    return "true" if value is True else value


North = Annotated[Literal["true", "grid"], BeforeValidator(name_of_true)]


class Noun(BaseModel):
    """A validated, unchangeable record; it knows its own fields and nothing of files or calculations.

    The string under a field is what the reference pages say of its key (`planner.files.reference`).
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def made_of(noun: Noun, kind: "type[Made]", **given: object) -> "Made":
    """A dataclass of a lower room from a noun that has fields of the same names.

    Parameters
    ----------
    noun
        What the user's file said.
    kind
        The dataclass.
    given
        Fields that the noun does not have, or that are not to be taken from it.

    Returns
    -------
    Made
        Fields that neither has keep the dataclass' defaults.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> class Place(Noun):
    ...     east_m: float
    ...     name: str
    >>> @dataclass
    ... class Point:
    ...     east_m: float
    ...     north_m: float
    >>> made_of(Place(east_m=1.0, name="here"), Point, north_m=2.0)
    Point(east_m=1.0, north_m=2.0)
    """
    shared = {field.name for field in fields(kind)} & set(type(noun).model_fields)
    return kind(**{name: getattr(noun, name) for name in shared} | given)
