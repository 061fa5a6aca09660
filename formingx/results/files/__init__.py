"""Files of results: tables, fields for ParaView, solids, shell elements, checkpoints."""

from ...io.output import replace
from .tabular import named, on_root, versions, write_path, write_profile, write_rows, write_summary
