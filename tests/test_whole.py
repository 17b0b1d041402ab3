"""A file that cannot be written to its end leaves what stood in its place."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dem_cli.errors import ResultsError
from dem_cli.report.export import write_tables
from dem_cli.report.look import new_figure, save
from dem_cli.report.page.model import Page
from dem_cli.report.page.render import write_page
from dem_cli.whole import whole

WRITERS: dict[str, Callable[[Path], object]] = {
    "a.png": lambda path: save(new_figure(2.0, 1.0), path, 50),
    "a.html": lambda path: write_page(Page("new"), path),
    "a.csv": lambda path: write_tables({path.name: iter([["x"], [1.0]])}, path.parent, True),
}


def fails(*_: Any, **__: Any) -> None:
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize("name", WRITERS)
def test_what_was_there_is_kept_on_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    path = tmp_path / name
    path.write_text("mine")
    monkeypatch.setattr("os.replace", fails)
    with pytest.raises(ResultsError, match="No space left on device"):
        WRITERS[name](path)
    assert [one.name for one in tmp_path.iterdir()] == [name]
    assert path.read_text() == "mine"


def half(path: Path) -> None:
    with whole(path) as work:
        work.write_text("half")
        raise RuntimeError


def test_half_a_file_goes(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError):
        half(tmp_path / "a.txt")
    assert list(tmp_path.iterdir()) == []


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    real, link = tmp_path / "real.txt", tmp_path / "link.txt"
    real.write_text("old")
    link.symlink_to(real)
    with whole(link) as work:
        work.write_text("new")
    assert link.is_symlink()
    assert real.read_text() == "new"
