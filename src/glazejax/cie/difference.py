"""CIEDE2000: how different two colours look."""

import numpy as np
from jaxtyping import Float

# The seventh power of 25, about where the formula bends for grey and for saturated colours.
_BEND = 25.0**7


def ciede2000(
    lab1: Float[np.ndarray, "*#batch 3"], lab2: Float[np.ndarray, "*#batch 3"]
) -> Float[np.ndarray, "*batch"]:
    """Colour difference of Lab colours, (..., 3) each, which broadcast; all parametric factors are
    1.

    Source: CIE 142:2001; G. Sharma, W. Wu, E. N. Dalal, Color Research and Application 30 (2005)
    21, eqs (2)-(22).
    """
    lightness1, a1, b1 = (lab1[..., i] for i in range(3))
    lightness2, a2, b2 = (lab2[..., i] for i in range(3))
    mean_chroma = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2
    # a is stretched near the neutral axis (eqs 4 to 6), so that greys differ as they look.
    stretch = 1 + (1 - np.sqrt(mean_chroma**7 / (mean_chroma**7 + _BEND))) / 2
    chroma1 = np.hypot(stretch * a1, b1)
    chroma2 = np.hypot(stretch * a2, b2)
    # Hues and the turn from one to the other, by the shorter way (eqs 7 to 11).
    hue1, hue2 = (np.degrees(np.arctan2(b, stretch * a)) % 360 for a, b in ((a1, b1), (a2, b2)))
    grey = chroma1 * chroma2 == 0
    turn = np.where(grey, 0.0, hue2 - hue1)
    turn = np.where(turn > 180, turn - 360, np.where(turn < -180, turn + 360, turn))
    by_lightness = lightness2 - lightness1
    by_chroma = chroma2 - chroma1
    by_hue = 2 * np.sqrt(chroma1 * chroma2) * np.sin(np.radians(turn / 2))
    lightness = (lightness1 + lightness2) / 2
    chroma = (chroma1 + chroma2) / 2
    # The mean of two hues lies on the shorter arc between them.
    total = hue1 + hue2
    far = np.where(total < 360, total + 360, total - 360)
    hue = np.where(grey, total, np.where(np.abs(hue1 - hue2) > 180, far, total) / 2)
    # How much a step in hue counts depends on the hue (eq. 15).
    weight = (
        1
        - 0.17 * np.cos(np.radians(hue - 30))
        + 0.24 * np.cos(np.radians(2 * hue))
        + 0.32 * np.cos(np.radians(3 * hue + 6))
        - 0.20 * np.cos(np.radians(4 * hue - 63))
    )
    # Steps count less where lightness is far from 50 and where chroma is large (eqs 18 to 20).
    middle = (lightness - 50) ** 2
    by_lightness = by_lightness / (1 + 0.015 * middle / np.sqrt(20 + middle))
    by_chroma = by_chroma / (1 + 0.045 * chroma)
    by_hue = by_hue / (1 + 0.015 * chroma * weight)
    # In blue, chroma and hue do not add up independently (eqs 16, 17 and 21).
    blue = 30 * np.exp(-(((hue - 275) / 25) ** 2))
    rotation = -2 * np.sqrt(chroma**7 / (chroma**7 + _BEND)) * np.sin(np.radians(2 * blue))
    return np.asarray(
        np.sqrt(by_lightness**2 + by_chroma**2 + by_hue**2 + rotation * by_chroma * by_hue)
    )
