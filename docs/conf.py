"""The site, for Sphinx: `make site` gathers pages and executed notebooks in build/site-work/source and calls it."""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "docs" / "extensions")]

project = "vsp"
author = "the vsp authors"
language = "en"
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "mathematics",
    "outputs",
    "docstrings",
    "pages",
    "tables",
    "article",
    "explorer",
    "folding",
    "sphinx_copybutton",
]
exclude_patterns = ["README.md", "data/README.md"]  # they are included in the pages

# Notebooks: shown as they were executed
nb_execution_mode = "off"
nb_ipywidgets_js = {}  # the default asks another host for its scripts
nb_output_stderr = "show"
copybutton_selector = "div.cell_input pre, section > div[class^=highlight-] pre"  # no outputs
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3

# API: docstrings are prose in which `name` is code, and a link where there is such a name
default_role = "py:obj"
add_module_names = False
autodoc_mock_imports = ["torch"]  # its few users here are documented where it is not installed
autodoc_inherit_docstrings = False  # Gymnasium has its own pages
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_typehints = "signature"
python_use_unqualified_type_names = True
maximum_signature_line_length = 80

html_theme = "sphinx_book_theme"
html_title = "Voronoi state partitioning"
html_baseurl = os.environ.get("SITE_URL", "")  # where it will be, with a slash at its end: previews of links ask for it
html_extra_path = ["article.png"]
html_favicon = html_logo = "static/logo.svg"
EXPLORER = [f"../vsp/show/explorer/explorer.{name}" for name in ("bundle.js", "css")]
html_static_path = ["static", "article/article.css", *EXPLORER]
html_css_files = ["site.css", "explorer.css", "article.css"]
html_js_files = ["site.js"]
templates_path = ["templates"]
html_math_renderer = "mathml"
html_copy_source = True  # for the button that downloads a notebook
html_last_updated_fmt = None  # the same bytes on every day
html_show_copyright = False
html_context = {"default_mode": "light"}  # without a script; else as the reader's system says: templates/layout.html
html_use_index = html_domain_indices = False  # the search finds names
html_theme_options = {
    "logo": {"text": html_title, "alt_text": ""},  # the words beside the logo say the same
    "navbar_persistent": [],  # the search field is in the sidebar
    "show_toc_level": 2,
    "show_navbar_depth": 1,
    "toc_title": "On this page",
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
