"""The palette: text can be read, and lidars stay apart for colour-blind eyes."""

from itertools import combinations

import numpy as np
import pytest

from planner import palette


def linear(colour: str) -> np.ndarray:
    """sRGB to linear light, IEC 61966-2-1."""
    value = np.array(palette.rgb(colour))
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def contrast(first: str, second: str) -> float:
    """Contrast ratio of the Web Content Accessibility Guidelines 2.1, section 1.4.3."""
    light = [float(linear(colour) @ [0.2126, 0.7152, 0.0722]) for colour in (first, second)]
    return (max(light) + 0.05) / (min(light) + 0.05)


@pytest.mark.parametrize("ink", [palette.INK, palette.INK_SOFT, palette.ERROR, palette.WARNING, palette.INFO])
@pytest.mark.parametrize("paper", [palette.PAPER, palette.SKY])
def test_text_has_the_contrast_that_wcag_asks(ink: str, paper: str) -> None:
    """Level AA asks 4.5 for text."""
    assert contrast(ink, paper) >= 4.5


# Machado, Oliveira and Fernandes (2009), IEEE Trans. Vis. Comput. Graph. 15, 1291-1298, severity 1.0
BLINDNESS = {
    "none": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
}


def lab(light: np.ndarray) -> np.ndarray:
    """CIE 1976 L*a*b* of linear sRGB light, D65."""
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    x, y, z = np.cbrt(to_xyz @ np.clip(light, 1e-6, 1.0) / np.array([0.9505, 1.0, 1.089]))
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("kind", BLINDNESS)
def test_the_first_four_lidars_stay_apart_for_every_eye(kind: str) -> None:
    """A difference of 10 in L*a*b* is seen at a glance."""
    seen = [lab(BLINDNESS[kind] @ linear(colour)) for colour in palette.LIDARS[:4]]
    assert min(float(np.linalg.norm(a - b)) for a, b in combinations(seen, 2)) > 10


def test_every_lidar_colour_is_its_own() -> None:
    """No two of the six are one, and the seventh lidar starts again."""
    assert len(set(palette.LIDARS)) == len(palette.LIDARS) == 6
    assert palette.lidar_colour(6) == palette.LIDARS[0]
