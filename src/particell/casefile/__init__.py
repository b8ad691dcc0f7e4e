"""Case files: a whole simulation described in TOML, with units, and nothing in it executed.

The tables of a file are pydantic models (:mod:`.domain`, :mod:`.shapes`, :mod:`.fills`,
:mod:`.phases`, :mod:`.schemes`, :mod:`.chemistry`, :mod:`.boundaries`, :mod:`.running`), one for
each public constructor, with its names, defaults and descriptions; :class:`.FileCase` holds them
and is a case like any other.
"""
