"""Samples that several tests share, made once a session."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest
from engine_samples import settle
from hypothesis import settings

from dem_cli.state import Grains

# the same examples in every run; `--hypothesis-profile=default` draws new ones
settings.register_profile("repeatable", derandomize=True, print_blob=True)
settings.load_profile("repeatable")

SettledBox = Callable[[int, int], Grains]


@pytest.fixture(scope="session")
def settled_box() -> SettledBox:
    """settled_box(n, seed): n grains at rest in a box 16 cm wide, see `engine_samples.settle`. Not to be changed."""
    return cache(settle)
