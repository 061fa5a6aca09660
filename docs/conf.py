"""Sphinx: ./fx python3 -m sphinx docs docs/_build"""

project, author, copyright = "formingx", "the formingx authors", "the formingx authors"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath"]
exclude_patterns = ["_build"]
html_theme = "alabaster"
html_theme_options = {"description": "How polymers are formed, simulated", "page_width": "1180px",
                      "body_max_width": "900px", "sidebar_width": "230px", "fixed_sidebar": True, "font_size": "16px"}
html_sidebars = {"**": ["about.html", "searchfield.html", "navigation.html"]}
html_static_path = ["static"]
html_css_files = ["formingx.css"]
autodoc_member_order = "bysource"
autodoc_typehints = "description"
