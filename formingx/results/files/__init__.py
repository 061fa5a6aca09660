"""Files that people and programs open."""

from .tabular import on_root, replace, reserve, versions, write_path, write_profile, write_rows, write_summary
