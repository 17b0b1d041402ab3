"""What a page is made of. Whoever has tables, figures or players for it makes parts and puts them into a section."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any, Literal

from dem_cli.report.text import Block

MOST_WARNINGS = 8  # that are shown at once


@dataclass(frozen=True)
class Drawing:
    """A picture with its heading, caption and what it says to those who cannot see it. content: of an SVG or PNG file. size:
    width and height [inch]."""

    title: str
    caption: str
    alt: str
    kind: Literal["svg+xml", "png"]
    content: bytes
    size: tuple[float, float]

    @property
    def width(self) -> int:
        """As it is shown where there is room [pixels of 1/96 inch]."""
        return round(96.0 * self.size[0])

    @property
    def wide(self) -> bool:
        """Too wide to be read in half of the page."""
        return self.size[0] > max(7.5, 1.7 * self.size[1])

    @property
    def address(self) -> str:
        """The picture itself, as an address."""
        return f"data:image/{self.kind};base64,{base64.b64encode(self.content).decode('ascii')}"


@dataclass(frozen=True)
class Player:
    """Frames that the page shows in motion. facts: what player.js has to know, as JSON; data: packed by `codes.Packer`; note: how many of
    how many frames."""

    title: str
    facts: dict[str, Any]
    data: str
    note: str


@dataclass(frozen=True)
class Listing:
    """A text as it is, folded away behind its title."""

    title: str
    text: str


@dataclass(frozen=True)
class Note:
    """A line of running text."""

    text: str


Part = Block | Drawing | Player | Listing | Note


@dataclass(frozen=True)
class Section:
    """Parts under a heading, in order; pictures that follow each other stand side by side."""

    title: str
    parts: tuple[Part, ...] = ()

    def runs(self) -> Iterator[tuple[str, list[Part]]]:
        """Parts of the same kind that follow each other: the kind's name and the parts."""
        for name, parts in groupby(self.parts, lambda part: type(part).__name__.lower()):
            yield name, list(parts)


@dataclass(frozen=True)
class Page:
    """subtitle: below the title. banners: what to know before all else (an incomplete run). warnings: lines."""

    title: str
    subtitle: str = ""
    banners: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    sections: tuple[Section, ...] = field(default=())

    def told(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Warnings that are shown at once, and those that are folded away."""
        return self.warnings[:MOST_WARNINGS], self.warnings[MOST_WARNINGS:]
