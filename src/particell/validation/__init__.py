"""``particell validate``: cases against their references, one page of numbers and figures."""

from particell.validation.rows import select
from particell.validation.runs import validate

__all__ = ["select", "validate"]
