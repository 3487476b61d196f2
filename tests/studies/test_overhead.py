import pytest

from sph_gym.studies import overhead
from sph_gym.studies.backends import Backend


# waits for three seconds
@pytest.mark.slow
def test_the_runs_themselves_are_no_overhead(monkeypatch):
    monkeypatch.setattr(overhead, "QUICK_RUNS", 3)
    first, rest, more = overhead.measure(True, Backend("local", workers=1))
    assert first.value >= overhead.SECONDS
    assert rest.value >= 2 * overhead.SECONDS
    # to a tick of the clock
    assert more.value > -1


def test_a_running_cluster_is_refused():
    with pytest.raises(ValueError, match=r"address: expected none, got 'tcp://there:8786'"):
        next(overhead.measure(True, Backend("dask", "tcp://there:8786")))
