"""Pictures one after the other, as one file that any browser plays."""

from collections.abc import Sequence
from io import BytesIO

FRAME_MS, LAST_MS = 900, 2500
COLOURS = 128  # of a frame: lines and letters stay clean


def animated(frames: Sequence[bytes]) -> bytes:
    """PNG pictures as an animated GIF that begins anew after the last.

    Parameters
    ----------
    frames
        Pictures; those that are smaller than the largest get white paper at the right and below.

    Returns
    -------
    bytes
        The GIF. Each picture stands for 0.9 s, the last for 2.5 s.
    """
    from PIL import Image

    pictures = [Image.open(BytesIO(frame)).convert("RGB") for frame in frames]
    size = (max(picture.width for picture in pictures), max(picture.height for picture in pictures))
    sheets = []
    for picture in pictures:
        sheet = Image.new("RGB", size, "white")
        sheet.paste(picture, (0, 0))
        sheets.append(sheet.quantize(COLOURS))
    buffer = BytesIO()
    sheets[0].save(
        buffer,
        format="GIF",
        save_all=True,
        append_images=sheets[1:],
        duration=[FRAME_MS] * (len(sheets) - 1) + [LAST_MS],
        loop=0,
        disposal=2,
    )
    return buffer.getvalue()
