"""Files that people and programs open."""

from .tabular import named, on_root, replace, reserve, versions, write_path, write_profile, write_rows, write_summary
