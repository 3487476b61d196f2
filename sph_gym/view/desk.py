"""The parts of the window and their places; no drawing here."""

from typing import NamedTuple

from sph_gym.view.layout import Area, even

# Sizes in em: width of the column of panels, heights of the panels, of the timeline and the help.
COLUMN = 21.0
CONTROLS, PARTICLE, STRIPS = 12.0, 17.5, 17.0
TIMELINE, HELP = 2.2, 2.0
# A picture has the panels beside it if it is at least so high, as a share of their height.
TALL = 0.8


class Desk(NamedTuple):
    """Places in the window [pixels]: the picture is in the upper left corner.

    size: of the window; em: size of the text.
    """

    size: tuple[int, int]
    em: int
    controls: Area
    particle: Area
    strips: Area
    timeline: Area
    help: Area


def furnish(picture: tuple[int, int], em: int) -> Desk:
    """Return the places for a picture of that size [pixels]; em: size of the text [pixels]."""
    width, height = picture
    timeline, help_ = round(TIMELINE * em), round(HELP * em)
    if height > TALL * (CONTROLS + PARTICLE + STRIPS) * em:
        column = round(COLUMN * em)
        above, picked = round(CONTROLS * em), round(PARTICLE * em)
        top = max(height, round((CONTROLS + PARTICLE + STRIPS) * em))
        controls = Area(width, 0, column, above)
        particle = Area(width, above, column, picked)
        strips = Area(width, above + picked, column, top - above - picked)
        whole = width + column
    else:
        row, third = round(PARTICLE * em), width // 3
        controls = Area(0, height, third, row)
        particle = Area(third, height, third, row)
        strips = Area(2 * third, height, width - 2 * third, row)
        top, whole = height + row, width
    whole, bottom = even(whole), top + timeline
    return Desk(
        (whole, even(bottom + help_)),
        em,
        controls,
        particle,
        strips,
        Area(0, top, whole, timeline),
        Area(0, bottom, whole, help_),
    )
