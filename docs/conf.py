"""Sphinx: ./fx python3 -m sphinx docs docs/_build"""

from pathlib import Path

import formingx

release = formingx.__version__
project, author, copyright = "formingx", "the formingx authors", "the formingx authors"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath"]
exclude_patterns = ["_build"]
html_theme, html_title = "furo", "formingx"
html_static_path = ["static"]
html_css_files = ["formingx.css"]
mathjax_path = "mathjax/tex-svg-full.js"                      # MathJax 3.2.2: equations are drawn without the internet
autodoc_member_order = "bysource"
autodoc_typehints = "description"
napoleon_use_ivar = True                                      # fields are documented once, by their own lines


def notebooks_as_pages(app):
    """Write each notebook of docs/notebooks, with the output that it holds, as Markdown beside it."""
    from nbconvert import MarkdownExporter
    for file in Path(app.srcdir).glob("notebooks/*.ipynb"):
        options = {"unique_key": file.stem, "output_files_dir": "output"}
        text, resources = MarkdownExporter().from_filename(file, options)
        for name, data in resources["outputs"].items():
            (file.parent / name).parent.mkdir(exist_ok=True)
            (file.parent / name).write_bytes(data)
        file.with_suffix(".md").write_text(f"{text}\nThis page is {{download}}`a notebook <{file.name}>`.\n", "utf-8")


def setup(app):
    """Convert the notebooks when Sphinx has read its configuration."""
    app.connect("config-inited", lambda app, config: notebooks_as_pages(app))
