"""How Sphinx makes the documents: pages in Markdown, a reference read off the code, search that works offline."""

import sys
from pathlib import Path

from firable import __version__

sys.path.insert(0, str(Path(__file__).parent / "_extensions"))

project = "firable"
author = "the authors of firable"
copyright = author  # noqa: A001 - the name that Sphinx reads
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "sphinx_click",
    "sphinx_copybutton",
    "net_keys",
    "plain_docstrings",
]
root_doc = "index"
exclude_patterns = ["_build"]

# Links between the pages are written as they work in a file browser too, headings included.
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]

# Docstrings are written with single backticks for code, as the pages are.
default_role = "code"
smartquotes = False  # which makes a dash of the hyphens of an option
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "undoc-members": False}
python_use_unqualified_type_names = True

# The commands of a session, and not what they print.
copybutton_prompt_text = "$ "
copybutton_only_copy_prompt_lines = True
copybutton_remove_prompts = True

html_theme = "furo"
html_title = f"firable {__version__}"
html_copy_source = False
html_show_sphinx = False
html_static_path: list[str] = []
