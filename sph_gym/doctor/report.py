"""A diagnosis as a page: the verdict, the chain, and every result."""

from pathlib import Path

from sph_gym.doctor.diagnosis import LINKS, Diagnosis, shown
from sph_gym.extras import needs_extra
from sph_gym.files import atomic_write


def write_page(diagnosis: Diagnosis, path: str | Path) -> None:
    """Write the diagnosis as one self-contained HTML file.

    Raises ImportError that names the extra if jinja2 is missing.
    """
    with needs_extra("studies"):
        from jinja2 import Environment, FileSystemLoader

    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent), autoescape=True, trim_blocks=True
    )
    template = environment.get_template("report.html.j2")
    html = template.render(diagnosis=diagnosis, chain=chain(diagnosis), shown=shown)
    with atomic_write(path) as draft:
        draft.write_text(html, encoding="utf-8")


def chain(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Return each link with its state: sound, broken, unknown."""
    states = []
    for link in LINKS:
        statuses = {each.status for each in diagnosis.results if each.link == link}
        if statuses & {"fail", "error"}:
            states.append((link, "broken"))
        else:
            states.append((link, "sound" if "pass" in statuses else "unknown"))
    return states
