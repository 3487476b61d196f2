"""Remedies that several checks give."""

BRUTE_FORCE = (
    "Replace the search by a loop over all pairs: if the fault is gone, it was the search. If it "
    "stays, it is the adding: in NumPy, a[i] += b keeps only one of equal indices (np.add.at or "
    "np.bincount add all). "
)
EVERY_PAIR = (
    "Compare with a loop over all pairs. Then look at the neighbour search: cells smaller than "
    "the support, cells visited twice, lists that hold too few neighbours, a rounding that puts a "
    "particle into the wrong cell."
)
SORT_ALIKE = (
    "Sort velocities, densities and all other columns by the same permutation as the positions."
)
SUPPORT_RADIUS = (
    "case.h is the SUPPORT radius, where W ends. Splines are often written with a smoothing "
    "length of a half (cubic, Wendland) or a third (quintic, Gaussian) of it: convert once, in "
    "the adapter, and use the same radius in the neighbour search."
)
OWN_SHARE = (
    "Begin each sum with the particle's own share, rho[i] = m W(0, h), before the neighbours are "
    "added: then no density is ever zero."
)
RENEW = "Renew densities in every step, from the present neighbours, before pressures and forces."
MASS = "The mass of a particle is rho0 dx^2 in 2D."
IN_2D = (
    "In 2D: poly6 4/(pi h^8), spiky 10/(pi h^5) and its slope -30/(pi h^5) (h - r)^2, cubic "
    "spline 40/(7 pi h^2), Wendland C2 7/(pi h^2), h the support."
)
TAIT_EQUATION = (
    "Tait's equation: p = B ((rho / rho0)^gamma - 1) with B = rho0 c0^2 / gamma, gamma = 7, then "
    "max(p, 0)."
)
CLAMP = "Cut pressures off at zero: p = max(0, p)."
UNIT_VECTOR = "Use the unit vector (x_i - x_j) / r, r = sqrt(dx^2 + dy^2), for both components."
