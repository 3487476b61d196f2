from itertools import combinations

import pytest

from sph_gym.view.desk import furnish
from sph_gym.view.layout import Area


@pytest.mark.parametrize("em", [9, 12, 16])
@pytest.mark.parametrize("picture", [(480, 200), (480, 520), (960, 300), (960, 520), (960, 770)])
def test_parts_of_the_window_share_no_pixel_and_lie_within_it(picture, em):
    desk = furnish(picture, em)
    areas = [Area(0, 0, *picture), *desk[2:]]
    for area in areas:
        assert area.width > 0
        assert area.height > 0
        assert area.left + area.width <= desk.size[0]
        assert area.top + area.height <= desk.size[1]
    for a, b in combinations(areas, 2):
        apart_x = a.left + a.width <= b.left or b.left + b.width <= a.left
        apart_y = a.top + a.height <= b.top or b.top + b.height <= a.top
        assert apart_x or apart_y
    assert all(side % 2 == 0 for side in desk.size)


def test_high_pictures_have_the_panels_beside_them():
    assert furnish((960, 770), 16).controls.left == 960
    assert furnish((960, 300), 16).controls.top == 300


def test_an_area_holds_its_first_pixel_and_not_the_one_after_its_last():
    area = Area(10, 20, 5, 5)
    assert area.holds((10, 20))
    assert area.holds((14, 24))
    assert not area.holds((15, 24))
    assert not area.holds((9, 20))
