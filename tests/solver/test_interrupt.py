"""Ctrl-C while the compiled loop runs: the clock, the state and the sums agree afterwards."""

import signal
import threading

import numpy as np
import pytest

from sph_gym import Simulation, scenes


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers on this platform")
@pytest.mark.skipif(
    threading.current_thread() is not threading.main_thread(), reason="signals need the main thread"
)
def test_time_and_state_agree_after_ctrl_c(monkeypatch):
    broken, whole = (Simulation(scenes.make("relaxation", dx=0.02)) for _ in range(2))
    for sim in (broken, whole):
        sim.controls = sim.controls._replace(dt=1e-6)
        sim.advance(1e-6)
    previous = signal.signal(signal.SIGALRM, signal.default_int_handler)
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    try:
        with pytest.raises(KeyboardInterrupt):
            broken.advance(100.0)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)
    assert broken.time > 1e-6
    whole.advance(broken.time - whole.time)
    assert broken.last_report.n_substeps == whole.last_report.n_substeps
    scale = np.abs(whole.x).max()
    assert np.abs(broken.x - whole.x).max() < 1e-10 * scale
    assert broken.max_speed == pytest.approx(np.hypot(*broken.v.T).max())
    assert np.abs(broken.rho - whole.rho).max() < 1e-10 * whole.rho.max()
