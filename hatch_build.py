"""The README as package indexes show it: there, links into the repository lead nowhere.

With a ``Repository`` (or ``Source``) among the project's URLs, relative links and pictures are made
absolute; without one, pictures are left out and links are their words alone.
"""

from __future__ import annotations

import re
from pathlib import Path

try:
    from hatchling.metadata.plugin.interface import MetadataHookInterface
except ImportError:  # in tests, which look at the text only
    MetadataHookInterface = object

_LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^()\s]+)\)")


def for_index(text: str, repository: str = "") -> str:
    """The text of a README without a relative link."""

    def absolute(found: re.Match[str]) -> str:
        picture, words, target = found.groups()
        if re.match(r"[a-z]+:|#", target):
            return found[0]
        if not repository:
            return "" if picture else words
        kind = "raw" if picture else "blob"
        return f"{picture}[{words}]({repository.rstrip('/')}/{kind}/HEAD/{target})"

    return re.sub(r"\n{3,}", "\n\n", _LINK.sub(absolute, text))


class ReadmeHook(MetadataHookInterface):
    """Gives hatchling the README."""

    def update(self, metadata: dict) -> None:
        """See hatchling."""
        urls = metadata.get("urls", {})
        repository = urls.get("Repository", urls.get("Source", ""))
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {
            "content-type": "text/markdown",
            "text": for_index(text, repository),
        }
