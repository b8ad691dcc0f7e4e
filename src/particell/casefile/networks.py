"""Tables of networks: species, reactions and initial values that an SBML file has."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, GetJsonSchemaHandler, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import core_schema

from particell.casefile.scope import Scope
from particell.casefile.table import ByGroup, Name, Table, describes
from particell.chemistry.sbml import SBMLModel, parse_sbml, read_sbml, sbml_text

_Groups = Name | tuple[Name, ...]


class _BySpecies(ByGroup):
    """A number with a unit, one for each species, or for each species and group."""

    def convert(self, value: Any) -> Any:
        """The same in SI units."""
        if isinstance(value, Mapping):
            return {str(name): super(_BySpecies, self).convert(v) for name, v in value.items()}
        return super().convert(value)

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        one = super().__get_pydantic_json_schema__(schema, handler)
        table = {"type": "object", "additionalProperties": one}
        return {"anyOf": [*one["anyOf"], table], "x-unit": self.unit}


@describes(read_sbml)
class SBMLTable(Table):
    """Species, reactions and initial concentrations from an SBML file (levels 2 and 3, core)."""

    path: Annotated[str, Field(min_length=1, max_length=1000)]
    """The file, from the directory of the case file."""
    diffusivity: Annotated[Any, _BySpecies("m^2/s")]
    molecules: bool | Name | tuple[Name, ...]
    only_in: dict[Name, _Groups] | None
    units: dict[Literal["substance", "volume", "time"], str] | None
    volumes: dict[Name, float | str] | None
    text: str | None = None
    """What is in the file. It is put here when it is read, so that a run's own description of
    itself is whole."""

    @model_validator(mode="after")
    def _with_text(self) -> SBMLTable:
        if self.text is None:
            self.text = sbml_text(self.path)
        return self

    def build(self) -> SBMLModel:
        """The network."""
        assert self.text is not None
        return parse_sbml(self.text, self.path, **self.given("text", "path"))

    def check_groups(self, scope: Scope) -> None:
        """Refuse groups of particles that are not described."""
        for groups in (self.only_in or {}).values():
            scope.known_group("only_in", groups)
        if isinstance(self.diffusivity, Mapping):
            for name, value in self.diffusivity.items():
                if isinstance(value, Mapping):
                    scope.known_group(f"diffusivity of {name}", tuple(value))


def located(content: Mapping[str, Any], directory: Path) -> dict[str, Any]:
    """A file's content with the paths in it from its directory on, whatever else is wrong."""
    tables = content.get("sbml")
    if not isinstance(tables, list):
        return dict(content)
    found = [
        {**table, "path": str(directory / table["path"])}
        if isinstance(table, Mapping) and isinstance(table.get("path"), str) and table["path"]
        else table
        for table in tables
    ]
    return {**content, "sbml": found}
