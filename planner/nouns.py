"""What every noun of the site file is made of: frozen, no unknown key, finite numbers that are numbers."""

from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StringConstraints

# Strict: a YAML `true` or a quoted "1.5" is not a number. An integer is.
Number = Annotated[float, Field(strict=True)]
Positive = Annotated[float, Field(strict=True, gt=0)]
NonNegative = Annotated[float, Field(strict=True, ge=0)]
Share = Annotated[float, Field(strict=True, ge=0, le=1)]
Count = Annotated[int, Field(strict=True, ge=1)]
Position = tuple[Number, Number, Number]  # easting, northing, height [m]
Name = Annotated[
    str,
    StringConstraints(strip_whitespace=True, min_length=1, max_length=100, pattern=r"^[^\x00-\x1f\x7f]+$"),
]


def _name_of_true(value: object) -> object:
    """`north: true` is a boolean to YAML and the word "true" to a person."""
    return "true" if value is True else value


North = Annotated[Literal["true", "grid"], BeforeValidator(_name_of_true)]


class Noun(BaseModel):
    """A validated, unchangeable record; it knows its own fields and nothing of files or calculations."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
