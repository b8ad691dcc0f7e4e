"""HDF5 files that hold all that they show.

A dataset may be a link to another file, be put together of parts of others, or have its numbers in
a file of any kind. Then a file that is looked at reads whatever file of the reader's it names, and
shows it as numbers. What Particell writes has nothing of that, so it is refused.
"""

from __future__ import annotations

import h5py

from particell.errors import ParticellError


class ForeignPart(ParticellError, ValueError):  # noqa: N818 - what it is, not what went wrong
    """A part of an HDF5 file that is read from another file."""


def check_contained(file: h5py.File) -> None:
    """Refuse a file of which a part is elsewhere.

    Raises
    ------
    ForeignPart
        Naming the part, and where it would be read from.
    """

    linked: list[bytes] = []
    named: list[bytes] = []
    # nothing may be asked of the library, nor raised, within its own visits

    def look_at_link(name: bytes, link: h5py.h5l.LinkInfo) -> None:
        if link.type == h5py.h5l.TYPE_EXTERNAL:
            linked.append(name)

    file.id.links.visit(look_at_link, info=True)
    for name in linked:
        other, _ = file.id.links.get_val(name)
        raise ForeignPart(f"'{_text(name)}' is read from another file, {_text(other)}")
    h5py.h5o.visit(file.id, named.append)
    for name in named:
        item = h5py.h5o.open(file.id, name)
        if isinstance(item, h5py.h5d.DatasetID):
            _check_dataset(_text(name), item.get_create_plist())


def check_no_links(file: h5py.File) -> None:
    """Refuse soft links, which may lead in circles.

    Raises
    ------
    ForeignPart
        Naming the link.
    """
    found: list[bytes] = []

    def look_at_link(name: bytes, link: h5py.h5l.LinkInfo) -> None:
        if link.type != h5py.h5l.TYPE_HARD:
            found.append(name)

    file.id.links.visit(look_at_link, info=True)
    if found:
        raise ForeignPart(f"'{_text(found[0])}' is a link and no part of its own")


def _check_dataset(name: str, layout: h5py.h5p.PropDCID) -> None:
    if layout.get_layout() == h5py.h5d.VIRTUAL:
        raise ForeignPart(f"'{name}' is put together of parts of other files")
    if layout.get_external_count():
        raise ForeignPart(f"'{name}' is read from another file, {_text(layout.get_external(0)[0])}")


def _text(name: bytes) -> str:
    return name.decode(errors="replace")
