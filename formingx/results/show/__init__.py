"""Pictures, moving pictures and reports."""
