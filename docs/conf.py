"""How the documentation is built; `make docs` turns every warning into an error."""

import sys
from pathlib import Path

from reachmap import __version__

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "reachmap"
author = "The reachmap developers"
copyright = "2026, The reachmap developers"
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_click",
    "cell_fields",
    "plain_help",
    "plain_types",
]
exclude_patterns = ["_build", "images/README.md"]
myst_enable_extensions = ["colon_fence", "deflist", "fieldlist"]
myst_heading_anchors = 3
smartquotes = False  # it would turn --option into a dash

# numpydoc sections; attributes as a field list, since records are documented there.
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_class_signature = "separated"
autodoc_default_options = {"exclude-members": "__new__"}

html_theme = "furo"
html_title = f"reachmap {release}"
html_show_sourcelink = False
html_theme_options = {"navigation_with_keys": True}
