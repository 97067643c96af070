"""How the documentation site is built: `make docs`. Its source is the root of the project."""

from __future__ import annotations

import sys
from importlib.metadata import version as version_of
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

project = "smartmot"
author = "the authors of smartmot"
project_copyright = "the authors of smartmot; Apache-2.0"
version = release = version_of("smartmot")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "made_pages"]

# Links between docs/, reports/ and files of code then lead to the same place on the site and in the files.
root_doc = "docs/index"
include_patterns = ["docs/**", "reports/**.md", "CHANGELOG.md", "CONTRIBUTING.md"]

myst_heading_anchors = 4
myst_enable_extensions = ["deflist"]

default_role = "code"
autodoc_default_options = {"members": True, "imported-members": True}
autodoc_typehints = "none"
autodoc_member_order = "alphabetical"
napoleon_use_ivar = True
napoleon_attr_annotations = False

highlight_language = "text"

html_theme = "pydata_sphinx_theme"
html_title = "smartmot"
html_copy_source = False
html_show_sourcelink = False
html_static_path = ["static"]
html_css_files = ["smartmot.css"]
html_extra_path = ["root"]
# pages that are no part of a section have nothing to list beside them
html_sidebars = {
    page: []
    for page in (
        *(f"docs/{name}" for name in ("index", "start", "gallery", "glossary", "sources")),
        "CHANGELOG",
        "CONTRIBUTING",
    )
}
html_theme_options = {
    "logo": {"text": "smartmot"},
    "header_links_before_dropdown": 7,
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "show_toc_level": 2,
    "show_prev_next": True,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
