"""MemoryIntegral constitutive laws of K-BKZ type."""

from . import published

__all__ = ["published"]
