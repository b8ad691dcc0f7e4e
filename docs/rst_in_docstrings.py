"""For the reference pages: what docstrings hold of reStructuredText, as Markdown.

Docstrings follow numpydoc: mathematics as ``:math:`` and ``.. math::``, references as
``:class:`name```, tables between lines of ``=``. The site is made of Markdown. Several parameters
in one entry become entries of their own, which the reader of docstrings would give the first one's
type and default.
"""

from __future__ import annotations

import re
import textwrap

import griffe

_BLOCK = re.compile(r"^( *)\.\. math::(.*)\n((?:\1 +.*\n|\s*\n)*)", re.MULTILINE)
_INLINE = re.compile(r":math:`([^`]+)`")
_REFERENCE = re.compile(r":(?:class|func|meth|mod|attr|data):`(~?)([^`]+)`")
_TABLE = re.compile(r"^=+(?: +=+)+ *\n((?:.+\n)+?)=+(?: +=+)+ *$", re.MULTILINE)
_CODE = re.compile(r"::\n(?=\n +\S)")
_DOCTEST = re.compile(r"^( *)>>> .*\n(?:\1\S.*\n)*", re.MULTILINE)
_PARAMETERS = re.compile(r"^(?:Other )?Parameters\n-+\n((?:(?!^.+\n-+\n).*\n)*)", re.MULTILINE)
_TOGETHER = re.compile(r"^([*\w]+(?:, [*\w]+)+)\n((?:(?: .*)?\n)+)", re.MULTILINE)


def _math(found: re.Match[str]) -> str:
    indent, first, rest = found.groups()
    body = " ".join((first + "\n" + textwrap.dedent(rest)).split())
    return f"\n{indent}$$ {body} $$\n\n"


def _reference(found: re.Match[str]) -> str:
    short, name = found.groups()
    shown = name.rsplit(".", 1)[-1] if short else name
    if "." not in name:
        return f"`{shown}`"
    return f'<autoref identifier="{name}" optional><code>{shown}</code></autoref>'


def _table(found: re.Match[str]) -> str:
    rule = found.group(0).splitlines()[0]
    begins = [m.start() for m in re.finditer("=+", rule)]
    ends = [*begins[1:], None]
    rows = [
        " | ".join(line[a:b].strip() for a, b in zip(begins, ends, strict=True))
        for line in found.group(1).splitlines()
    ]
    empty, dashes = " | ".join(" " for _ in begins), " | ".join("---" for _ in begins)
    return "\n".join(f"| {row} |" for row in (empty, dashes, *rows))


def _doctest(found: re.Match[str]) -> str:
    indent = found.group(1)
    lines = re.sub(r"[ \t]*# doctest:.*", "", found.group(0))
    return f"{indent}```pycon\n{lines}{indent}```\n"


def _one_by_one(found: re.Match[str]) -> str:
    names, description = found.groups()
    return "".join(f"{name}\n{description}" for name in names.split(", "))


def markdown(text: str) -> str:
    """A docstring's text with its reStructuredText replaced by Markdown."""
    text = _PARAMETERS.sub(lambda m: _TOGETHER.sub(_one_by_one, m.group(0)), text + "\n")
    text = _DOCTEST.sub(_doctest, text)
    text = _BLOCK.sub(_math, text)
    text = _TABLE.sub(_table, text)
    text = _INLINE.sub(lambda m: f"${' '.join(m.group(1).split())}$", text)
    text = _REFERENCE.sub(_reference, text)
    return _CODE.sub(":\n", text).rstrip("\n")


class Rst(griffe.Extension):
    """Rewrites every docstring before it is parsed."""

    def on_object(self, *, obj: griffe.Object, **options: object) -> None:
        """See :func:`markdown`."""
        if obj.docstring:
            obj.docstring.value = markdown(obj.docstring.value)
