"""How Sphinx builds the site: ``make docs``. Nothing of it is fetched when it is built or read."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "_ext"))
os.environ.setdefault("MPLBACKEND", "Agg")

from numpydoc import docscrape_sphinx  # noqa: E402

import pamid  # noqa: E402

# numpydoc makes its environment anew for every docstring, and with it its one template.
_environments: dict[type, Any] = {}
_new_environment = docscrape_sphinx.SandboxedEnvironment
docscrape_sphinx.SandboxedEnvironment = lambda loader: _environments.setdefault(
    type(loader), _new_environment(loader=loader)
)

project = "pamid"
author = "The pamid developers"
project_copyright = author
version = release = pamid.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "numpydoc",
    "sphinx_gallery.gen_gallery",
    "mathml",
    "rooms",
    "source_links",
]
if os.environ.get("PAMID_DOCS") == "short":  # for a test: the reference of what rooms show at their doors alone
    extensions.remove("sphinx.ext.viewcode")
root_doc = "index"
exclude_patterns = ["_build", "gallery", "**/*.ipynb", "sg_execution_times.rst", "auto_gallery/*.py"]
nitpicky = True
nitpick_ignore_regex = [("py:.*", r"(?!pamid).*")]  # other libraries' pages are elsewhere, and nothing is fetched
suppress_warnings = ["config.cache"]  # functions in sphinx_gallery_conf

# --- pages ----------------------------------------------------------------------------------------------------
myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 4
myst_dmath_double_inline = True
highlight_language = "text"
pygments_style = "a11y-high-contrast-light"

# --- reference ------------------------------------------------------------------------------------------------
autosummary_generate = True
autosummary_imported_members = False
autodoc_typehints = "none"  # numpydoc says what each argument is
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
numpydoc_use_plots = False

# --- gallery --------------------------------------------------------------------------------------------------
INSTALLED = """\
# This notebook needs pamid. Where it is missing: %pip install pamid, or the path of its wheel or checkout.
import pamid

pamid.__version__"""
sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "auto_gallery",
    "filename_pattern": r"[\\/]plot_",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "notebook_images": False,
    "first_notebook_cell": INSTALLED,
    "remove_config_comments": True,
    "show_memory": False,
    "show_signature": False,
    "write_computation_times": False,
    "image_scrapers": ("matplotlib", "gallery_style.displays"),
    "image_srcset": ["2x"],
    "reset_modules": ("matplotlib", "gallery_style.reset"),
    "thumbnail_size": (400, 280),
}

# --- looks ----------------------------------------------------------------------------------------------------
html_theme = "pydata_sphinx_theme"
html_title = "pamid"
html_static_path = ["_static"]
html_css_files = ["pamid.css"]
html_js_files = ["versions-switch.js"]
templates_path = ["_templates"]
html_show_sourcelink = False
html_copy_source = False
html_context = {"default_mode": "light"}
html_theme_options = {
    "logo": {"text": "pamid"},
    "navbar_end": ["version-switcher", "theme-switcher"],
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "show_prev_next": False,
    "navigation_with_keys": False,
    "header_links_before_dropdown": 6,
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
html_sidebars: dict[str, list[str]] = {"index": []}
if os.environ.get("PAMID_DOCS") == "short":  # a list of all pages beside each of hundreds takes a fifth of the build
    html_sidebars |= {"api/pamid.*": [], "api/pamid.estimators.StaticPIHM": ["sidebar-nav-bs"]}
