"""Sphinx: ./fx python3 -m sphinx docs docs/_build"""

project, author, copyright = "formingx", "the formingx authors", "the formingx authors"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath"]
exclude_patterns = ["_build"]
html_theme = "alabaster"
autodoc_member_order = "bysource"
autodoc_typehints = "description"
