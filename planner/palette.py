"""One visual language for every picture: colours and text sizes of scenes, figures and the report.

Each lidar keeps its colour from the plan map to the 3-D scene. The lidars' colours are those of Okabe and Ito
(2008), "Color Universal Design": they stay apart for the common kinds of colour blindness. Yellow is left
out, because it vanishes on a light background, and black, because text and masts have it.
"""

LIDARS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")

INK = "#1f2933"  # text, north arrow, scale bar
INK_SOFT = "#52606d"  # second-rank text, leader lines
PAPER = "#ffffff"
SKY = "#f4f7fa"  # background of a scene
GROUND = "#e7e9e0"
GRID = "#b9beb0"
TERRAIN = "#cfd5bf"

MAST = "#3b3f45"
TURBINE = "#8d99a6"
OBSTACLE = "#a1887f"
WAKE = "#7b5ea7"
EXCLUDED = "#b5474d"
FREE = "#2f7f9e"
CROSSING = "#111111"

ERROR = "#b3261e"
WARNING = "#8a5300"
INFO = "#2b5c8a"

FONT_FAMILY = "DejaVu Sans, Verdana, Arial, sans-serif"
TITLE_PX = 24
LABEL_PX = 17
LEGEND_PX = 15
NOTE_PX = 13

WAKE_DIAMETERS = 8  # how much of a wake is drawn, in rotor diameters; a wake goes on


def lidar_colour(index: int) -> str:
    """Give the colour of the lidar with this index in the site file; after the sixth they repeat.

    Parameters
    ----------
    index
        Position of the lidar in the site file, from 0.

    Returns
    -------
    str
        Colour as `#rrggbb`.

    Examples
    --------
    >>> lidar_colour(0), lidar_colour(6)
    ('#0072b2', '#0072b2')
    """
    return LIDARS[index % len(LIDARS)]


def rgb(colour: str) -> tuple[float, float, float]:
    """Give red, green and blue of `#rrggbb`, each from 0 to 1.

    Examples
    --------
    >>> rgb("#ff0033")
    (1.0, 0.0, 0.2)
    """
    red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue


def mixed(colour: str, opacity: float, under: str = SKY) -> str:
    """Give the opaque colour that a see-through one has over another: for renderers that blend lines badly.

    Examples
    --------
    >>> mixed("#000000", 0.5, "#ffffff")
    '#808080'
    """
    parts = (opacity * a + (1 - opacity) * b for a, b in zip(rgb(colour), rgb(under), strict=True))
    return "#" + "".join(f"{int(255 * part + 0.5):02x}" for part in parts)


def css(colour: str, opacity: float) -> str:
    """Write a colour with its opacity the way a style sheet reads it.

    Examples
    --------
    >>> css("#0072b2", 0.25)
    'rgba(0,114,178,0.25)'
    """
    red, green, blue = (round(255 * part) for part in rgb(colour))
    return f"rgba({red},{green},{blue},{opacity:g})"
