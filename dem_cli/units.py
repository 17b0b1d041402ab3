"""Numbers with units as users write them: `parse("400 gal", "m/s^2")` is 4.0.

The units are pint's machinery over a list of our own, for three reasons: pint's `gal` is a gallon, its `rpm` is an angular
velocity that would pass for a frequency 2 pi too large, and its full list takes a second to read.
An angle counts as a dimension, so "63 rad/s" is no frequency. Numbers are decimal until the last moment: "7 cm" and "0.07 m"
are the same float.
"""

from __future__ import annotations

import difflib
import math
import re
from decimal import Decimal, InvalidOperation
from functools import cache
from typing import TYPE_CHECKING, Any

from dem_cli.errors import ScenarioError

if TYPE_CHECKING:
    import pint

# Definitions in pint's own notation. Left out on purpose: inches, pounds and all that soil mechanics in SI or CGS does not use.
DEFINITIONS = """
nano- = 1e-9 = n-
micro- = 1e-6 = µ- = μ- = u-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
kilo- = 1e3 = k-
mega- = 1e6 = M-
giga- = 1e9 = G-
meter = [length] = m = metre = meters = metres
second = [time] = s = sec = seconds
gram = [mass] = g = grams
radian = [angle] = rad
percent = 0.01 = %
degree = 3.14159265358979323846264338327950288 / 180 * radian = deg = ° = degrees
turn = 2 * 3.14159265358979323846264338327950288 * radian
minute = 60 * second = min = minutes
hour = 3600 * second = h = hours
hertz = 1 / second = Hz
rpm = hertz / 60
gal = 0.01 * meter / second ** 2 = Gal
gravity = 9.80665 * meter / second ** 2 = g0 = gn
kine = 0.01 * meter / second
tonne = 1000 * kilogram = t
newton = kilogram * meter / second ** 2 = N
dyne = 1e-5 * newton = dyn
kilogram_force = 9.80665 * newton = kgf
tonne_force = 9806.65 * newton = tf
pascal = newton / meter ** 2 = Pa
bar = 1e5 * pascal
joule = newton * meter = J
"""

# What a unit measures, by its SI unit, with a value as a user might write it.
KINDS: dict[str, tuple[str, str]] = {
    "m": ("length", "7 mm"),
    "s": ("time", "0.5 s"),
    "m/s": ("velocity", "150 m/s"),
    "m/s^2": ("acceleration", "400 gal"),
    "Hz": ("frequency", "10 Hz"),
    "1/s": ("rate", "5 1/s"),
    "rad": ("angle", "-90 deg"),
    "rad/s": ("angular velocity", "2 rad/s"),
    "kg": ("mass", "3 kg"),
    "kg/m^3": ("density", "2480 kg/m^3"),
    "N": ("force", "10 N"),
    "N/m": ("stiffness", "1e8 N/m"),
    "N s/m": ("viscosity", "1e8 N s/m"),
    "N m s": ("rotational viscosity", "1e4 N m s"),
    "Pa": ("stress", "15 kPa"),
    "J": ("energy", "1 J"),
    "": ("plain number", "0.5"),
}

_STRAY = re.compile(r"[^\w%°·*/^.() ⁰¹²³⁴⁻-]")  # characters that have no place in a unit
_NUMBER = re.compile(r"\s*([+-]?(?:\d+(?:_\d+)*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.DOTALL)


class UnitError(ScenarioError):
    """A value with a wrong or missing unit. `rule` says what is wrong, `remedy` what to write."""

    def __init__(self, rule: str, remedy: str) -> None:
        super().__init__(f"{rule}. {remedy}")
        self.rule = rule
        self.remedy = remedy


def parse(text: str, unit: str, example: str | None = None) -> float:
    """The value of `text`, for example "400 gal", in `unit`, for example "m/s^2"; exact to the last bit of a float.

    `example` is what errors suggest to write. UnitError: no number, no unit, an unknown unit, another dimension, not finite.
    """
    kind, usual = KINDS.get(unit, (f"value in {unit}", f"1 {unit}"))
    remedy = f'Write for example "{example or usual}"'
    match = _NUMBER.fullmatch(text)
    if match is None:
        raise UnitError(f"is no number with a unit, {article(kind)} is wanted", remedy)
    number, name = match.groups()
    if not name and unit:
        hint = (example or usual).split(maxsplit=1)[1]
        raise UnitError(f"has no unit, {article(kind)} is wanted", f'Write for example "{number} {hint}"')
    if name.startswith(","):
        raise UnitError("has a decimal comma", f'Write a point: "{text.replace(",", ".", 1).strip()}"')
    try:
        value = float(Decimal(number) * _factor(name, unit, remedy))
    except InvalidOperation:
        value = math.inf
    if not math.isfinite(value):
        raise UnitError("is too large for a number", remedy)
    return value


def write(value: float, unit: str) -> str:
    """`value` with its unit such that `parse` gives back the same float."""
    return f"{value!r} {unit}"


def human(value: float, unit: str, digits: int = 4) -> str:
    """A value with a prefix that suits its size: 0.005 m is 5 mm."""
    if unit in ("m", "s", "B", "Pa"):
        for prefix, factor in (("G", 1e9), ("M", 1e6), ("k", 1e3), ("", 1.0), ("m", 1e-3), ("µ", 1e-6)):
            if abs(value) >= factor and (unit in ("B", "Pa") or factor <= 1.0):
                return f"{float(f'{value / factor:.{digits}g}'):g} {prefix}{unit}"
    return f"{value:.{digits}g} {unit}"


def dimension(unit: str) -> str:
    """The name of what `unit` measures, for example "length"."""
    return KINDS[unit][0]


@cache
def _registry() -> pint.UnitRegistry[Any]:
    import pint  # 0.3 s: only once a value with a unit is met

    registry: pint.UnitRegistry[Any] = pint.UnitRegistry(None, non_int_type=Decimal)
    registry.load_definitions(DEFINITIONS.strip().splitlines())
    return registry


@cache
def _factor(name: str, unit: str, remedy: str) -> Decimal:
    """How many `unit` one `name` is."""
    import pint

    registry = _registry()
    target = registry.parse_units(unit)
    try:
        if _STRAY.search(name):
            raise ValueError(name)
        given = registry.parse_units(name)
    except pint.errors.UndefinedUnitError:
        near = [n for n in _names() if n.lower() == name.lower()] or difflib.get_close_matches(
            name, _names(), n=1, cutoff=0.7
        )
        advice = f'Did you mean "{near[0]}"?' if near else remedy
        raise UnitError(f'has the unknown unit "{name}"', advice) from None
    except Exception:  # pint's parser lets tokenizer, syntax, type and attribute errors through
        raise UnitError(f'has a unit that cannot be read, "{name}"', remedy) from None
    if given.dimensionality != target.dimensionality:
        kinds = (k for u, (k, _) in KINDS.items() if registry.parse_units(u).dimensionality == given.dimensionality)
        is_kind = next(kinds, f"value of dimension {given.dimensionality}")
        wanted = KINDS.get(unit, (f"value in {unit}", ""))[0]
        raise UnitError(f"is {article(is_kind)}, {article(wanted)} is wanted", remedy)
    return Decimal(registry.convert(Decimal(1), given, target))


@cache
def _names() -> list[str]:
    """Names that a mistyped unit is compared with."""
    plain = [n.strip() for line in DEFINITIONS.strip().splitlines() for n in re.split(r"=", line) if "-" not in n]
    names = [n for n in plain if re.fullmatch(r"[A-Za-z%°_]+0?", n)]
    return [*names, *(p + u for p in "mck" for u in ("m", "g", "s", "N", "Pa", "Hz")), *(u for u in KINDS if "/" in u)]


def article(noun: str) -> str:
    """The noun with "a" or "an"."""
    return f"an {noun}" if noun[0] in "aeiou" else f"a {noun}"
