"""A page as one HTML file: template, style and script in one, with a policy that forbids it to fetch anything."""

from __future__ import annotations

import base64
import hashlib
import json
from importlib.resources import files
from pathlib import Path
from typing import Any

from dem_cli import __version__
from dem_cli.errors import ResultsError, ScenarioError
from dem_cli.report.page.model import Page
from dem_cli.whole import whole

ENDINGS = (".html", ".htm")
SCRIPTS = ("codec.js", "colors.js", "contacts.js", "grains.js", "bodies.js", "controls.js", "player.js", "page.js")


def check_page(path: Path, force: bool) -> None:
    """Raise ScenarioError if `path` has another ending than ENDINGS, ResultsError if it would be overwritten without
    `force` or its folder is missing."""
    if path.suffix.lower() not in ENDINGS:
        raise ScenarioError(f"{path}: a page's name must end in {' or '.join(ENDINGS)}")
    if not path.parent.is_dir():
        raise ResultsError(f"{path}: there is no folder {path.parent}")
    if path.is_dir():
        raise ResultsError(f"{path}: is a folder; choose another name")
    if path.exists() and not force:
        raise ResultsError(f"{path} exists; choose another name or add --force")


def write_page(page: Page, path: Path) -> None:
    """Write it; the same page gives the same bytes. ResultsError if that is not possible."""
    text = html(page)
    try:
        with whole(path) as work:
            work.write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise ResultsError(f"{path}: cannot be written: {error.strerror}") from None


def html(page: Page) -> str:
    """The page's text. What comes from files is escaped; scripts and styles are the program's own, and the policy knows their hashes."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    folder = files("dem_cli.report.page")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["facts"] = lambda tree: Markup(facts(tree))
    environment.filters["arrows"] = lambda cell: cell.replace("->", "\N{RIGHTWARDS ARROW}").replace("+-", "±")
    style = _asset(folder, "page.css")
    script = "\n".join(_asset(folder, name) for name in SCRIPTS)
    return environment.from_string(_asset(folder, "page.html.j2")).render(
        page=page,
        version=__version__,
        style=Markup(style),
        script=Markup(script),
        style_hash=Markup(_hash(style)),
        script_hash=Markup(_hash(script)),
    )


def facts(tree: Any) -> str:
    """JSON that may stand in a script element whatever it holds."""
    text = json.dumps(tree, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for sign in "<>&\u2028\u2029":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text


def _asset(folder: Any, name: str) -> str:
    return str(folder.joinpath(name).read_text(encoding="utf-8")).strip()


def _hash(text: str) -> str:
    """As a content security policy names it."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")
