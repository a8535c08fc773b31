"""The documentation site: `python -m sphinx -c docs . build/site`, with warnings as errors in `.ci/run`.

The pages are those of the repository, in their places, so that a link between them leads to the same page on GitHub and
in the site.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_site"))

import coadjoint

project = "coadjoint"
author = "The coadjoint developers"
version = release = coadjoint.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "pages",
    "docstrings",
    "formulas",
    "names",
    "notebooks",
    "searching",
]
root_doc = "docs/index"
include_patterns = [
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "SECURITY.md",
    "SUPPORT.md",
]
include_patterns += ["CODE_OF_CONDUCT.md", "docs/*.md", "docs/**/*.md"]
nitpicky = True

myst_heading_anchors = 4

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings say shapes and units
autodoc_preserve_defaults = True
autodoc_inherit_docstrings = False
add_module_names = False
toc_object_entries_show_parents = "hide"
maximum_signature_line_length = 90

html_theme = "furo"
pygments_style = "a11y-light"
pygments_dark_style = "a11y-dark"
html_title = f"coadjoint {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["copy.js"]
html_favicon = "_static/favicon.svg"
html_extra_path = ["_extra"]  # index.html beside docs/ leads to the first page
html_copy_source = False
html_show_copyright = False
html_show_search_summary = False  # _site/searching.py makes them, from a disk too
html_theme_options = {"navigation_with_keys": True}
