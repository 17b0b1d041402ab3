"""Numbers with units: what is read, exactly, and what is refused, with which advice."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dem_cli.units import UnitError, parse, write


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("400 gal", "m/s^2", 4.0),  # pint's own gal is a gallon
        ("400 Gal", "m/s^2", 4.0),
        ("0.3 g0", "m/s^2", 2.941995),
        ("121.5 cm", "m", 1.215),
        ("7mm", "m", 0.007),
        ("250 µm", "m", 0.00025),
        ("2.48e-3 kg/cm^3", "kg/m^3", 2480.0),
        ("2.48 g/cm³", "kg/m^3", 2480.0),
        ("2.48 t/m^3", "kg/m^3", 2480.0),
        ("1.5e5 dyn/cm^2", "Pa", 15000.0),
        ("15 kPa", "Pa", 15000.0),
        ("2 kN", "N", 2000.0),
        ("130 MN/m", "N/m", 1.3e8),
        ("600 rpm", "Hz", 10.0),  # pint's own rpm is an angular velocity, 2 pi too large
        ("10 1/s", "Hz", 10.0),
        ("-90 deg", "rad", -math.pi / 2),
        ("1 turn", "rad", 2 * math.pi),
        ("2 min", "s", 120.0),
        ("30 %", "", 0.3),
        ("0.3", "", 0.3),
        ("  1_000 mm ", "m", 1.0),
        (".5 m s^-2", "m/s^2", 0.5),
    ],
)
def test_reads(text: str, unit: str, value: float) -> None:
    assert parse(text, unit) == value


@given(st.floats(allow_nan=False, allow_infinity=False), st.sampled_from(["m", "m/s^2", "1/s", "kg/m^3", "rad"]))
def test_written_values_come_back_to_the_bit(value: float, unit: str) -> None:
    back = parse(write(value, unit), unit)
    assert math.copysign(1.0, back) == math.copysign(1.0, value) or value == 0.0
    assert back == value


@given(st.integers(-(10**6), 10**6), st.integers(0, 4))
def test_decimal_prefixes_are_exact(digits: int, places: int) -> None:
    """7 cm and 0.07 m are one float, so that both spellings of a scenario are the same run."""
    number = f"{digits / 10**places:.{places}f}"
    shifted = f"{digits}e{-places - 2}"
    assert parse(f"{number} cm", "m") == parse(f"{shifted} m", "m") == float(shifted)


@pytest.mark.parametrize(
    ("text", "unit", "words"),
    [
        ("400 gal", "m", ["acceleration", "length"]),
        ("63 rad/s", "Hz", ["angular velocity", "frequency"]),
        ("400", "m", ["no unit", '"400 mm"']),
        ("10 hz", "Hz", ['"hz"', '"Hz"']),
        ("7 mmm", "m", ['"mmm"', '"mm"']),
        ("7 furlong", "m", ["unknown", '"7 mm"']),
        ("0,5 cm", "m", ["decimal comma", '"0.5 cm"']),
        ("5 - 10 mm", "m", ["cannot be read"]),
        ("7 m;", "m", ["cannot be read"]),
        ("wide", "m", ["no number"]),
        ("1e999 m", "m", ["too large"]),
        ("", "m", ["no number"]),
        ("7 m^2", "m", ["length"]),
    ],
)
def test_refuses_with_advice(text: str, unit: str, words: list[str]) -> None:
    with pytest.raises(UnitError) as caught:
        parse(text, unit)
    for word in words:
        assert word in str(caught.value)
    assert caught.value.exit_code == 2
