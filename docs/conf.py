"""Settings of the documentation site: `make docs` builds it into docs/_build/html."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import site_pages

import sph_gym

project = "sph_gym"
author = "the sph_gym authors"
copyright = author
version = release = sph_gym.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "examples", "generated/README.md"]
nitpicky = True
# only public names have a page; types in their signatures may be others
nitpick_ignore_regex = [("py:class", ".*")]
# docstrings put names and formulas between single backticks
default_role = "code"

# anchors of headings, as GitHub makes them
myst_heading_anchors = 4
suppress_warnings = ["config.cache"]

autodoc_default_options = {"members": True, "imported-members": True}
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
python_maximum_signature_line_length = 88

html_theme = "furo"
html_title = "sph_gym"
html_static_path = ["static"]
html_css_files = ["site.css"]
# films, to the root of the site
html_extra_path = [str(site_pages.EXTRA)]
html_show_sphinx = False
html_show_copyright = False
html_copy_source = False

sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "generated/gallery",
    "filename_pattern": r"\.py$",
    "ignore_pattern": "__init__",
    "within_subsection_order": "site_pages.example_order",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_signature": False,
    "show_memory": False,
    # the page of times fetches scripts from the network
    "write_computation_times": False,
    "min_reported_time": float("inf"),
    "image_scrapers": ("matplotlib",),
    "matplotlib_animations": False,
    "thumbnail_size": (480, 320),
    "reference_url": {"sph_gym": None},
    "doc_module": ("sph_gym",),
    "backreferences_dir": None,
    "plot_gallery": "True",
}


def setup(app):
    """Make the pages that are made from the code and from files outside of docs/."""
    site_pages.write()
    app.connect("source-read", site_pages.redirect)
    app.connect("autodoc-process-docstring", site_pages.as_rst)
    app.connect("autodoc-skip-member", site_pages.skip)
