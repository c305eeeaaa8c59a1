"""The site: `make docs` builds it from these pages, the parser of the command line and the docstrings."""

project = "viewcell"
copyright = "The viewcell authors"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_argparse_cli"]
# In docstrings, as in pages, backticks are code.
default_role = "code"
html_theme = "furo"
html_title = "viewcell"
exclude_patterns = ["bench/*.json"]
# Anchors as GitHub makes them.
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]
autodoc_typehints = "description"
autodoc_member_order = "bysource"
