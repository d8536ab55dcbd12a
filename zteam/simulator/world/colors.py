"""Colours of models: X11's names as red, green and blue."""

import re
import zlib

# X11's numbered shades of a colour: "red1" is red itself, "red4" a dark one.
_SHADES = {"1": 1.0, "2": 0.932, "3": 0.804, "4": 0.545}
_ONLY_X11 = {"lightgoldenrod": "#eedd82", "lightslateblue": "#8470ff", "navyblue": "#000080", "violetred": "#d02090"}


def find_color(name: str) -> tuple[float, float, float] | None:
    """Channels 0 to 1 of an X11 name or #rrggbb; None for an unknown name. The numbered shades are X11's rule of thumb,
    within two steps of 255 of its table."""
    from PIL import ImageColor  # imported only where the channels are needed

    plain = name.replace(" ", "").lower()
    plain = _ONLY_X11.get(plain, plain)
    if re.fullmatch("#[0-9a-f]{6}", plain) or plain in ImageColor.colormap:
        r, g, b = ImageColor.getrgb(plain)[:3]
        return r / 255, g / 255, b / 255
    if grey := re.fullmatch("gr[ae]y(100|[0-9]{1,2})", plain):
        level = int(grey[1]) / 100
        return level, level, level
    shade = re.fullmatch("(.*[a-z])([1-4])", plain)
    base = find_color(shade[1]) if shade else None
    if shade is None or base is None:
        return None
    red, green, blue = (channel * _SHADES[shade[2]] for channel in base)
    return red, green, blue


def random_color(name: str) -> str:
    """Stage's "random", but the same in every run: a bright colour from the model's name."""
    from colorsys import hsv_to_rgb

    channels = hsv_to_rgb(zlib.crc32(name.encode()) / 2**32, 0.8, 0.9)
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in channels)
