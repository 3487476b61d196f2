import math
from dataclasses import replace

from sph_gym.studies.accuracy import gains, luck, points, problems, tables
from sph_gym.studies.accuracy.settings import nominal

DROP = replace(problems.problem("elliptical_drop"), sizes=(6, 8, 10), nominal=8)


def drop(**changes):
    return nominal(DROP)._replace(**changes)


def made_up(setting, error, **known):
    """A point that wasn't run."""
    plain = points.Point(
        "elliptical_drop", "", setting, 0.1, error, "", 1, 9, 9, 9, 1, 1, 1, 1, 1, 0, 0, "", 1
    )
    return plain._replace(key=str(setting), **known)


def test_luck_does_not_count():
    runs = [drop(across=n) for n in (6, 8, 10)] + [drop(kernel="spiky")]
    found = [made_up(s, e) for s, e in zip(runs, [0.03, 0.001, 0.01, 0.002], strict=True)]
    assert [point.error for point in luck.sober(found)] == [0.03, 0.01, 0.01]
    assert luck.sober(found[1:]) == []
    blown = found[0]._replace(error=math.nan, cause="blew up")
    assert luck.sober([blown, *found[1:]]) == []


def test_a_line_that_ends_before_the_finest_resolution_does_not_count():
    own = [made_up(drop(across=n), 0.1 / n, knob="nominal") for n in (6, 8, 10, 14)]
    lucky = [made_up(drop(across=n, kernel="spiky"), 1e-4) for n in (6, 8, 10)]
    assert luck.sober([*own, *lucky]) == own
    unlucky = made_up(drop(across=14, kernel="spiky"), 0.05)
    counted = luck.sober([*own, *lucky, unlucky])
    assert [point.error for point in counted[4:]] == [0.05] * 4


def test_errors_within_their_scatter_have_no_front():
    def ladder(order):
        sizes = ((6, 8), (8, 6), (10, 10))
        return [
            made_up(drop(across=n), 0.1 * n**-order, knob="nominal", effort=float(n**3))
            for n, _ in sizes
        ]

    assert luck.front(ladder(0.1), "cost") == []
    assert len(luck.front(ladder(1.0), "cost")) == 3


def test_times_are_those_of_the_machine_at_its_usual_speed():
    found = [made_up(drop(across=n), 0.1, rate=r) for n, r in ((6, 2e6), (8, 1e6), (10, 5e6))]
    found.append(made_up(drop(across=14), math.nan, rate=math.nan))
    usual = luck.at_usual_speed([point._replace(effort=4e6) for point in found])
    assert [point.time for point in usual] == [2.0] * 4


def test_the_cheapest_is_told_with_the_error_that_it_has():
    errors = (0.03, 0.001, 0.01)
    own = [made_up(drop(across=n), e) for n, e in zip((6, 8, 10), errors, strict=True)]
    own = [point._replace(effort=float(point.setting.across)) for point in own]
    five, two, one, half = tables.cheapest(own)
    assert (five["across"], five["error"], five["error_without_luck"]) == (6, 0.03, 0.03)
    assert (two["across"], two["error"], two["error_without_luck"]) == (8, 0.001, 0.01)
    assert one["key"] == two["key"]
    assert not half["reached"]


def turned(order=1.0, scene="elliptical_drop"):
    """A scene's own runs, a kernel that makes an error a third, and a line that does both."""
    sizes = (8, 6, 10, 14)
    own = [made_up(drop(across=n), n**-order, knob="resolution", effort=float(n**3)) for n in sizes]
    own[0] = own[0]._replace(knob="nominal")
    third = [
        p._replace(setting=p.setting._replace(kernel="spiky"), error=p.error / 1.5, knob="kernel")
        for p in own
    ]
    found = [*own, *(p._replace(key=str(p.setting)) for p in third)]
    return [p._replace(scene=scene) for p in found]


def test_the_headline_is_never_less_than_a_knob_alone():
    found = turned()
    alone = gains.best(found, "kernel", "cost")
    assert alone.bound == ""
    best = luck.headline(found, "cost")
    assert best == (alone.gain, "")
    # error and time as a power law has them
    assert abs(best.gain - 1.5**3) < 0.1
    # known at a few resolutions only: not on the front, and yet not better than the best
    few = [p for p in found if p.knob != "kernel" or p.setting.across < 14]
    assert luck.headline(few, "cost").gain >= gains.best(few, "kernel", "cost").gain > 2


def test_where_chance_decides_there_is_neither_front_nor_headline():
    for found in (turned(0.05), turned(scene="hydrostatic_tank"), turned(scene="droplet")):
        assert luck.chance(found)
        assert luck.front(found, "cost") == []
        assert math.isnan(luck.headline(found, "cost").gain)
    assert not luck.chance(turned())
    assert luck.front(turned(), "cost")
