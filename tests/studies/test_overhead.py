import pytest

from sph_gym.studies import overhead


# waits for three seconds
@pytest.mark.slow
def test_the_runs_themselves_are_no_overhead():
    first, rest, more = overhead.measure("local", 3, 1)
    assert first.value >= overhead.SECONDS
    assert rest.value >= 2 * overhead.SECONDS
    # to a tick of the clock
    assert more.value > -1
