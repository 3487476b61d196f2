"""Blow-ups in plain words, for all parts that tell about one."""

from sph_gym.solver.report import Report

# Explanation and remedy of each cause.
CAUSES = {
    "cfl": ("the time step was too long", "a smaller dt helps"),
    "stiffness": (
        "the time step was too long for the sound waves of so stiff a fluid",
        "a smaller dt or a smaller stiffness helps",
    ),
    "clumping": (
        "two particles had come together at one place",
        "a matched kernel (wendland_c2) keeps particles apart",
    ),
    "tunnelling": ("fluid got into a wall", "a smaller dt or thicker walls help"),
    "energy": (
        "the fluid gained energy that nothing gave to it",
        "a smaller dt or more viscosity helps",
    ),
    "nan": ("a value is no longer a finite number", "look at the numbers around this particle"),
}


def explain(report: Report) -> str:
    """Return what happened, where it showed first and what helps, for a report that diverged."""
    what, remedy = CAUSES[report.cause]
    return (
        f"the run blew up: {what} (cause {report.cause}). It showed first at particle "
        f"{report.bad_particle}, in the link {report.link!r}; {remedy}"
    )
