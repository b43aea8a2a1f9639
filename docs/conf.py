"""Settings of Sphinx, which `make docs` runs: the API reference is built from the docstrings."""

from importlib.metadata import version as installed_version

project = "groundmap"
author = "the groundmap developers"
release = installed_version("groundmap")

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",  # a page for each public name
    "sphinx.ext.intersphinx",
    "sphinx.ext.viewcode",
    "numpydoc",
    "myst_parser",  # the guides are Markdown
]
intersphinx_mapping: dict[str, tuple[str, None]] = {}  # a build needs no network

default_role = "py:obj"  # `GroundMapper` in a docstring links to its page
autosummary_generate = True
autosummary_imported_members = True  # the public names are imported from the modules below
autodoc_typehints = "none"  # the docstrings state types, with shapes, units and frames
autodoc_member_order = "bysource"
numpydoc_show_class_members = False  # the pages of classes list their members themselves
numpydoc_class_members_toctree = False
templates_path = ["templates"]

myst_heading_anchors = 3
html_theme = "furo"
html_title = f"groundmap {release}"
nitpicky = False
