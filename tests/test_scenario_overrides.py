"""Changes from the command line."""

from __future__ import annotations

import pytest
from scenario_text import SMALL, small

from dem_cli.errors import ScenarioError
from dem_cli.scenario import Scenario, Shake, parse_scenario

STRONG = {"kind": "shake", "name": "strong", "amplitude": "800 gal", "frequency": "5 Hz", "cycles": 3}
TWO_SHAKES = small({"stage": [*SMALL["stage"], STRONG]})


def load(*overrides: str, text: str = "") -> Scenario:
    return parse_scenario(text or small(), origin="a.toml", overrides=overrides)


def refused(*overrides: str, text: str = "") -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        load(*overrides, text=text)
    return str(caught.value).splitlines()


def test_values_are_toml_or_text() -> None:
    scenario = load(
        "contact.friction = 0.5", "container.width=40 cm", 'title="x y"', "container.height=2 m", "container.lid=true"
    )
    assert (scenario.contact.friction, scenario.container.width, scenario.title) == (0.5, 0.4, "x y")
    assert (scenario.container.lid, scenario.container.height) == (True, 2.0)
    tracks = load("output.tracks.grains=[1, 2]", "output.tracks.interval=2 ms").output.tracks
    assert tracks is not None
    assert (tracks.grains, tracks.interval) == ((1, 2), 0.002)
    assert load("title=a = b").title == "a = b"


def test_same_as_in_the_file() -> None:
    by_hand = parse_scenario(small({"contact.friction": 0.5, "output.frames": "1 s"}))
    changed = load("contact.friction=0.5", "output.frames=1 s")
    assert (changed, changed.hash) == (by_hand, by_hand.hash)


def test_later_ones_win() -> None:
    assert load("seed=4", "seed=5").seed == 5


def test_inner_keys_of_short_forms() -> None:
    assert load("contact.damping_ratio.normal=0.3").contact.damping() == (0.3, 1.0)
    walls = load("contact.wall_friction.bottom=0.9").contact.wall_friction
    assert (walls.left, walls.bottom) == (0.25, 0.9)


def test_a_key_displaces_those_that_exclude_it() -> None:
    assert load("contact.restitution=0.5").contact.damping_ratio is None
    radius = load("grains.radius.fixed=7 mm").grains.radius
    assert radius is not None
    assert (radius.fixed, radius.uniform) == (0.007, None)
    shake = load("stage.cycles=7").stages[1]
    assert isinstance(shake, Shake)
    assert (shake.cycles, shake.duration) == (7.0, None)
    scenario = load("material.normal_stiffness=1e8 N/m", "material.tangential_stiffness=5e7 N/m")
    assert scenario.stiffness == (1e8, 5e7)


def test_stages() -> None:
    def amplitudes(scenario: Scenario) -> list[float]:
        return [stage.amplitude for stage in scenario.stages if isinstance(stage, Shake)]

    assert amplitudes(load("stage.amplitude=200 gal")) == [2.0]
    assert amplitudes(load("stage.3.amplitude=200 gal", text=TWO_SHAKES)) == [4.0, 2.0]
    assert amplitudes(load("stage.strong.amplitude=200 gal", text=TWO_SHAKES)) == [4.0, 2.0]
    assert amplitudes(load("stage.shake.amplitude=200 gal", text=TWO_SHAKES)) == [2.0, 2.0]
    (line,) = refused("stage.amplitude=200 gal", text=TWO_SHAKES)
    assert line.endswith("may mean several stages. Write stage.2.amplitude or stage.3.amplitude")
    assert load("stage.settle.damping.local=0.3").stages[0].damping.local == 0.3  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("contact.frction=1", 'unknown key. Did you mean "contact.friction"?'),
        ("contct.friction=1", 'unknown key. Did you mean "contact.friction"?'),
        ("contact.damping_ratio.norml=1", 'Did you mean "contact.damping_ratio.normal"?'),
        ("contact.friction.left=1", "contact.friction is a value, not a table. Leave out .left"),
        ("stage.amplitud=1 gal", 'Did you mean "stage.amplitude"?'),
        ("stage.2.amplitud=1 gal", 'Did you mean "stage.2.amplitude"?'),
        ("stage.3.amplitude=1 gal", "there is no stage 3"),
        ("stage.1.amplitude=1 gal", "unknown key"),
        ("stage.2=1", "names a stage, but no key of it"),
        ("zzzz=1", "unknown key. Known here: title"),
        ("friction", "is not KEY=VALUE"),
        ("=5", "is not KEY=VALUE"),
        ("contact..friction=5", "is not KEY=VALUE"),
    ],
)
def test_refused(override: str, words: str) -> None:
    (line,) = refused(override)
    assert line.startswith(f"--set {override}: ")
    assert words in line


def test_mistakes_of_overrides_and_scenario_come_together() -> None:
    lines = refused("contact.frction=1", "seed=-1", text=small({"depth": 1}))
    assert len(lines) == 3


def test_source_is_the_text_as_given() -> None:
    """The change is in the resolved form."""
    scenario = load("seed=99")
    assert "99" not in scenario.source
    assert "seed = 99" in scenario.resolved_toml()
