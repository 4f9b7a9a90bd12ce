"""Sphinx's settings for the manual: `make docs` writes it to build/docs."""

import os
import re
import shutil
from pathlib import Path

from docutils import nodes
from sphinx.errors import ConfigError

import castfem

project = "castfem"
author = "the authors of castfem"
version = release = castfem.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "sphinx.ext.napoleon"]
exclude_patterns = ["data", "**.py"]
default_role = "code"
highlight_language = "none"  # of blocks that name none: what a command prints
myst_heading_anchors = 4  # those of a forge, so that a link holds in both places
myst_enable_extensions = ["dollarmath"]
myst_dmath_allow_space = False  # two prices in a sentence are no formula
myst_fence_as_directive = ["math"]  # a forge draws such blocks, too
myst_update_mathjax = False  # it knows MathJax 3 alone; Debian has 2

# The part of MathJax that draws TeX as SVG: paths need no fonts, which browsers refuse to files.
MATHJAX = Path(os.environ.get("MATHJAX", "/usr/share/javascript/mathjax"))
MATHJAX_PARTS = (
    "MathJax.js",
    "extensions",
    "jax/element",
    "jax/input/TeX",
    "jax/output/SVG/autoload",
    "jax/output/SVG/config.js",
    "jax/output/SVG/fonts/TeX",
    "jax/output/SVG/jax.js",
)
mathjax_path = "mathjax/MathJax.js"  # below _static; never a server's
mathjax2_config = {
    "v1.0-compatible": False,  # no configuration but this one
    "jax": ["input/TeX", "output/SVG"],
    "extensions": ["tex2jax.js", "AssistiveMML.js"],
    "TeX": {"extensions": ["AMSmath.js", "AMSsymbols.js"], "TagSide": "right"},
    "tex2jax": {"ignoreClass": ".*", "processClass": "math"},
    "SVG": {"font": "TeX", "EqnChunk": 1000},
    "showMathMenu": False,
    "messageStyle": "none",
}

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


def keep_equations(app, doctree):
    """Hand an equation on as it is written, with its number beside it.

    Sphinx would put one of several lines into `split`; MathJax would draw the number where the edge
    of the window is just then, which on paper is another place.
    """
    for node in list(doctree.findall(nodes.math_block)):
        text, number = node.astext(), re.search(r"\\tag\{(.+?)\}", node.astext())
        if number:
            text = text.replace(number[0], "")
            beside = nodes.container(classes=["numbered"])
            node.replace_self(beside)
            beside += [node, nodes.paragraph("", f"({number[1]})")]
        node.children = [nodes.Text(f"\\[{text}\\]")]
        node["nowrap"] = True


def spare_mathjax(app, pagename, templatename, context, doctree):
    """Leave MathJax out of a page without equations; what is for screen readers fails there."""
    if 'class="math' not in context.get("body", ""):
        files = context["script_files"]
        context["script_files"] = [file for file in files if mathjax_path not in str(file.filename)]


def copy_mathjax(app, error):
    """Put MathJax beside the pages, which then need no network."""
    target = Path(app.outdir, "_static", "mathjax")
    if error or app.builder.format != "html" or (target / "MathJax.js").exists():
        return
    for part in MATHJAX_PARTS:
        source, copy = MATHJAX / part, target / part
        copy.parent.mkdir(parents=True, exist_ok=True)
        (shutil.copytree if source.is_dir() else shutil.copyfile)(source, copy)


def setup(app):
    """Connect them."""
    if not (MATHJAX / "MathJax.js").is_file():
        raise ConfigError(
            f"no MathJax 2 in {MATHJAX}: install libjs-mathjax, or set MATHJAX to its folder"
        )
    app.connect("autodoc-process-docstring", link_pages)
    app.connect("doctree-read", keep_equations)
    app.connect("html-page-context", spare_mathjax, priority=900)  # after Sphinx' own
    app.connect("build-finished", copy_mathjax)
