"""For the page on case files: a table of keys for each kind of table, made from the models."""

from __future__ import annotations

import re
import types
from collections.abc import Iterator
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

MARKER = "<!-- tables of case files -->"
#: Kinds of annotation that stand for what is in them.
_OUTER = (Annotated, Union, types.UnionType)


def on_page_markdown(markdown: str, **options: object) -> str:
    """Put the tables where the page has the marker (mkdocs calls this for every page)."""
    return markdown.replace(MARKER, tables()) if MARKER in markdown else markdown


def tables() -> str:
    """All tables of a case file as Markdown."""
    from particell.casefile.case import FileCase

    parts = []
    for name, info in FileCase.model_fields.items():
        models = list(models_of(info))
        if not models:
            continue
        listed, named = origins(info, list), origins(info, dict)
        title = f"[[{name}]]" if listed else f"[{name}.NAME]" if named else f"[{name}]"
        alone = len(models) == 1 and "type" not in models[0].model_fields
        parts.append(f"### `{title}`\n\n{'' if alone else info.description}\n")
        parts += [table(model) for model in models]
        for model in models:
            for key, inner in model.model_fields.items():
                if found := list(models_of(inner)):
                    owner = f"a {kinds(model)}" if "type" in model.model_fields else f"`{title}`"
                    parts.append(f"### `{key}` of {owner}\n\n{inner.description}\n")
                    parts += [table(one) for one in found]
    return "\n".join(parts)


def table(model: type[BaseModel]) -> str:
    """The keys of one table."""
    head = f"**`type = {kinds(model)}`**: " if "type" in model.model_fields else ""
    rows = [
        f"| `{key}` | {unit(info)} | {default(info)} | {cell(info.description or '')} |"
        for key, info in model.model_fields.items()
        if key != "type"
    ]
    return "\n".join(
        [
            f"{head}{model.__doc__}\n",
            "| key | unit | default | |",
            "| --- | --- | --- | --- |",
            *rows,
            "",
        ]
    )


def kinds(model: type[BaseModel]) -> str:
    """What ``type`` may be."""
    values = get_args(model.model_fields["type"].annotation)
    return " or ".join(f'"{value}"' for value in values)


def models_of(info: FieldInfo) -> Iterator[type[BaseModel]]:
    """The models in a field's type, in their order."""
    for part in parts_of(info.annotation):
        if isinstance(part, type) and issubclass(part, BaseModel):
            yield part


def parts_of(annotation: Any) -> Iterator[Any]:
    """An annotation and everything in it."""
    yield annotation
    if get_origin(annotation) is not Literal:
        for inner in get_args(annotation):
            yield from parts_of(inner)


def origins(info: FieldInfo, kind: type) -> bool:
    """Whether a field is a list or a dictionary."""
    return get_origin(info.annotation) is kind


def unit(info: FieldInfo) -> str:
    """The unit of a field; empty for plain numbers."""
    found = [*info.metadata, *parts_of(info.annotation)]
    units = [part.unit for part in found if isinstance(getattr(part, "unit", None), str)]
    return cell(", ".join(dict.fromkeys(u for u in units if u)))


def default(info: FieldInfo) -> str:
    """What a field is where the file does not say it."""
    if info.is_required():
        return "needed"
    if info.default_factory is not None or info.default in (None, "", ()):
        return ""
    return f"`{str(info.default).lower() if isinstance(info.default, bool) else info.default}`"


def cell(text: str) -> str:
    """Text that can stand in a table."""
    return re.sub(r"``([^`]*)``", r"`\1`", " ".join(text.split())).replace("|", "\\|")
