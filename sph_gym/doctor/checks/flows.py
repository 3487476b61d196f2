"""Do densities change as the flow says? It matters where they are carried along (continuity)."""

import numpy as np

from sph_gym.doctor.case import C0, DX, RHO0, case, lattice
from sph_gym.doctor.findings import Finding, failed, inconclusive, passed
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.registry import check

# The block shrinks by this share of its width, so fast that sound does not cross it meanwhile.
_SHRINK = 0.02
_STEPS = 8
_SPEED = 0.3 * C0


@check("density", step=4, needs=("isolated",), shows=("rho",))
def density_in_flow(lab: Lab) -> Finding:
    """Let a block shrink by its own motion: does the density inside rise as it should?"""
    x = lattice(9, 9)
    half = x.max()
    dt = _SHRINK * half / _SPEED / _STEPS
    subject = lab.make(case(x, -_SPEED / half * x)).step(dt)
    begun, width = subject.get("rho"), np.ptp(subject.x[:, 0])
    subject.step(dt, _STEPS)
    rise, narrower = subject.get("rho") - begun, np.ptp(subject.x[:, 0]) / width
    # the nine in the middle, which no surface is near
    inside = np.abs(x).max(axis=1) < 1.5 * DX
    if not np.isfinite(rise).all():
        return inconclusive("the block is not finite, which other checks judge")
    planned = _SHRINK * _STEPS / (_STEPS + 1)
    if not 0.9 < (1 - narrower) / planned < 1.5:
        return inconclusive("the block does not shrink as it moves, which other checks judge")
    expected = RHO0 * (narrower**-2 - 1)
    share = float(np.median(rise[inside]) / expected)
    told = f"a block of 9 x 9 becomes {1 - narrower:.1%} narrower by its own motion"
    if share > 0.3:
        return passed(f"{told}: its density rises", share, 1.0, unit="of -rho div v")
    if share > -0.3:
        return inconclusive(f"{told}: its density hardly changes", share, 1.0)
    return failed(
        f"{told}: its density falls",
        "The rate of the density has the wrong sign: d rho_i/dt = sum m_j (v_i - v_j) . grad_i "
        "W_ij is positive where particles approach.",
        share,
        1.0,
        unit="of -rho div v",
        tolerance="above 0.3",
    )
