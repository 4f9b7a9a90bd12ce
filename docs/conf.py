"""Sphinx's settings for the manual: `make docs` writes it to build/docs."""

import re

import castfem

project = "castfem"
author = "the authors of castfem"
version = release = castfem.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["data", "**.py"]
default_role = "code"
highlight_language = "none"  # of blocks that name none: what a command prints
myst_heading_anchors = 4  # those of a forge, so that a link holds in both places

autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
napoleon_use_ivar = True
python_use_unqualified_type_names = True

html_theme = "pydata_sphinx_theme"
html_static_path = ["_static"]
html_css_files = ["manual.css"]
html_title = f"castfem {release}"
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "header_links_before_dropdown": 7,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "show_prev_next": True,
    "footer_start": ["copyright"],
    "footer_end": [],
}
html_sidebars = {"index": [], "getting_started": [], "references": []}
copyright = "castfem; free software under the LGPL-3.0-or-later"


def link_pages(app, what, name, obj, options, lines):
    """Make a link of the name of a page in a docstring."""
    lines[:] = [re.sub(r"docs/(\w+)\.md", r":doc:`\1`", line) for line in lines]


def setup(app):
    """Connect it."""
    app.connect("autodoc-process-docstring", link_pages)
