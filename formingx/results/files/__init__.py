"""Files that people and programs open."""

from ...io.output import replace
from .tabular import named, on_root, versions, write_path, write_profile, write_rows, write_summary
