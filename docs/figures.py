"""For every page: figures have what they show written below them, as a caption."""

from __future__ import annotations

import re

#: Paragraphs of pictures alone; one that a line in italics follows has its caption there.
_PICTURES = re.compile(r"<p>((?:<img [^>]*>\s*)+)</p>(?!\s*<p><em>)")
_PICTURE = re.compile(r'<img (?=[^>]*\balt="([^"]*)")[^>]*>')


def on_page_content(html: str, **options: object) -> str:
    """Make figures of pictures (mkdocs calls this for every page)."""
    return _PICTURES.sub(lambda m: _PICTURE.sub(_figure, m.group(1)), html)


def _figure(found: re.Match[str]) -> str:
    picture, caption = found.group(0), found.group(1)
    return f"<figure>{picture}<figcaption>{caption}</figcaption></figure>"
