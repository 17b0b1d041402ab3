"""Tables of the scenario model that report all their mistakes at once, each with rule and remedy.

A field's type carries its unit and range, `key()` its meaning and default, `rules` what holds between keys.
"""

from __future__ import annotations

import copy
import difflib
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, NamedTuple

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    ModelWrapValidatorHandler,
    TypeAdapter,
    ValidationError,
    model_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError, core_schema

from dem_cli.scenario.quantities import JsonSchema, mistake


class Mistake(NamedTuple):
    """What is wrong at `loc` (keys from the table's own level), and what to do about it."""

    loc: tuple[str | int, ...]
    rule: str
    remedy: str


class Given(NamedTuple):
    """A table as rules see it. raw: as written. good: the valid fields by attribute name, defaults included."""

    raw: Mapping[str, Any]
    good: Mapping[str, Any]


def nearest(word: str, known: list[str]) -> str | None:
    """The known word that looks most like `word`, if any does."""
    folded = {k.lower().replace("-", "_"): k for k in known}
    found = difflib.get_close_matches(word.lower().replace("-", "_"), folded, n=1, cutoff=0.5)
    return folded[found[0]] if found else None


def did_you_mean(word: str, known: list[str]) -> str:
    near = nearest(word, known)
    return f'Did you mean "{near}"?' if near else f"Known here: {', '.join(known)}"


def misplaced(given: Given, chooser: str, owners: Mapping[str, Sequence[str]]) -> Iterator[Mistake]:
    """A mistake for each key that is written but belongs to other values of the key `chooser`; owners: key -> the values that have it."""
    chosen = given.good.get(chooser)
    for name, choices in owners.items() if chosen else ():
        if name in given.raw and chosen not in choices:
            words = " or ".join(f'"{one}"' for one in choices)
            yield Mistake(
                (name,), f'is no key of {chooser} = "{chosen}"', f"Leave it out, or write {chooser} = {words}"
            )


def key(default: Any = ..., doc: str = "", *, example: Any = None, alias: str | None = None, maker: Any = None) -> Any:
    """A key of a table: its default as a user would write it, its meaning, and an example of a value.

    maker: function of the fields before it that gives the default, in place of `default`.
    """
    extra: dict[str, Any] = {"examples": [example]} if example is not None else {}
    if maker is not None:
        return Field(default_factory=maker, description=doc, alias=alias, **extra)
    return Field(default, description=doc, alias=alias, **extra)


class Table(BaseModel):
    """A table of the scenario. All its mistakes are reported together: those of fields, and those of `rules`."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True, defer_build=True)

    # Sets of keys that exclude each other; one set of each group must be there, unless the group holds an empty set, too. An
    # override of one displaces the others.
    alternatives: ClassVar[tuple[tuple[tuple[str, ...], ...], ...]] = ()
    # Rules between keys that JSON Schema can say, beside those of `alternatives`.
    more_schema: ClassVar[JsonSchema] = {}
    # JSON Schema of the short form that `spell_out` understands.
    short_form: ClassVar[JsonSchema | None] = None
    # Keys ("height") and words ("kind=shake") that belong to another engine: its name, and what to do here.
    elsewhere: ClassVar[Mapping[str, tuple[str, str]]] = {}
    # What the manual calls it, where its type does not say.
    short_words: ClassVar[str | None] = None

    @classmethod
    def spell_out(cls, raw: Any) -> Any:
        """Turns a short form (`radius = "7 mm"`) into the table that it stands for."""
        return raw

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        """Rules between keys."""
        del given
        yield from ()

    @classmethod
    def displaced(cls, path: Sequence[str], value: Any) -> list[tuple[str, ...]]:
        """Keys, from this table's own level, that an override of the key at `path` by `value` leaves without meaning."""
        del path, value
        return []

    @classmethod
    def kinds(cls) -> list[str]:
        """Kinds of stages, where a table holds such."""
        return []

    @classmethod
    def other_engine(cls, name: str) -> tuple[str, str] | None:
        """Rule and remedy for a key or word of another engine."""
        engine, remedy = cls.elsewhere.get(name, ("", ""))
        return (f'belongs to engine = "{engine}"', remedy) if engine else None

    @model_validator(mode="wrap")
    @classmethod
    def _collect(cls, raw: Any, handler: ModelWrapValidatorHandler[Table]) -> Table:
        if isinstance(raw, cls):
            return raw
        written = raw
        raw = cls.spell_out(written)
        if not isinstance(raw, dict):
            single = "Write its name in single brackets, once" if isinstance(raw, list) else ""
            raise mistake("must be a table", single or f"Its keys are {', '.join(keys_of(cls))}")
        found: list[InitErrorDetails] = []
        table: Table | None = None
        try:
            table = handler(raw)
            good = {name: getattr(table, name) for name in cls.model_fields}
        except ValidationError as error:
            found = [said for one in error.errors(include_url=False) if (said := _in_our_words(cls, one))]
            good = _good_values(cls, raw)
        for loc, rule, remedy in (*_alternatives(cls, raw), *cls.rules(Given(raw, good))):
            if rule == "is missing" and value_at(raw, loc) is not NOTHING:
                continue  # it is there but wrong, which is said already
            found.append(InitErrorDetails(type=mistake(rule, remedy), loc=loc, input=value_at(raw, loc)))
        found = _without_echoes(found)
        if not isinstance(written, dict):  # a short form: what is wrong with it is said once, where it stands
            found = list({_said(one)[:2]: InitErrorDetails(type=one["type"], input=written) for one in found}.values())
        if found or table is None:
            raise ValidationError.from_exception_data(cls.__name__, found)
        return table

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        plain = handler.resolve_ref_schema(handler(schema))
        said = [_group_schema(group) for group in cls.alternatives] + ([cls.more_schema] if cls.more_schema else [])
        plain.update(said[0] if len(said) == 1 else {"allOf": said} if said else {})
        if cls.short_form is None:
            return plain
        about = {k: plain.pop(k) for k in ("description", "title") if k in plain}
        return about | {"anyOf": [cls.short_form, plain]}


def _group_schema(group: tuple[tuple[str, ...], ...]) -> JsonSchema:
    """JSON Schema of one group of alternatives."""
    options: list[JsonSchema] = [{"required": list(option)} for option in group if option]
    if () not in group:
        return {"oneOf": options}
    return {"oneOf": [*options, {"not": {"anyOf": options}}]}


def keys_of(table: type[Table]) -> list[str]:
    """The keys of a table as the TOML spells them."""
    return [field.alias or name for name, field in table.model_fields.items()]


class _Nothing:
    """Stands for the value of a key that is not there."""


NOTHING = _Nothing()


def value_at(raw: Any, loc: tuple[str | int, ...]) -> Any:
    """What TOML data hold at a place; NOTHING if there is no such."""
    for part in loc:
        try:
            raw = raw[part]
        except (KeyError, IndexError, TypeError):
            return NOTHING
    return raw


def _alternatives(cls: type[Table], raw: Mapping[str, Any]) -> Iterator[Mistake]:
    for group in cls.alternatives:
        present = [options for options in group if any(k in raw for k in options)]
        names = " or ".join(" + ".join(options) for options in group if options)
        if not present and () not in group:
            yield Mistake((group[0][0],), "is missing", f"Give one of: {names}")
        for options in present[1:]:
            other = next(k for k in present[0] if k in raw)
            yield Mistake((next(k for k in options if k in raw),), f"contradicts {other}", f"Give only one of: {names}")
        for options in present[:1] if len(present) == 1 else []:
            for k in options:
                if k not in raw:
                    yield Mistake((k,), "is missing", f"Give all of: {', '.join(options)}")


def _good_values(cls: type[Table], raw: Mapping[str, Any]) -> dict[str, Any]:
    """The fields that are valid by themselves, or once their wrong keys are left out, for the rules of a table that is not."""
    good: dict[str, Any] = {}
    for name, field in cls.model_fields.items():
        alias = field.alias or name
        if alias not in raw and field.is_required():
            continue
        kind: Any = field.annotation
        for extra in field.metadata:
            kind = Annotated[kind, extra]
        try:
            value = raw[alias] if alias in raw else field.get_default(call_default_factory=True, validated_data=good)
            good[name] = _valid(TypeAdapter(kind), value)
        except (ValidationError, KeyError):
            continue
    return good


def _valid(adapter: TypeAdapter[Any], value: Any) -> Any:
    """The value as the model holds it. Wrong keys of a table are left out, as far as it can do without them."""
    try:
        return adapter.validate_python(value)
    except ValidationError as error:
        if not isinstance(value, dict):
            raise
        wrong = [one["loc"] for one in error.errors(include_url=False, include_input=False)]
    pruned = copy.deepcopy(value)
    for loc in wrong:
        table = value_at(pruned, loc[:-1])
        if loc and isinstance(table, dict):
            table.pop(str(loc[-1]), None)
    return adapter.validate_python(pruned)


def _in_our_words(cls: type[Table], error: Any) -> InitErrorDetails | None:
    """One of pydantic's own errors as a mistake with rule and remedy; None for the consequence of another one."""
    kind, loc, value, ctx = error["type"], tuple(error["loc"]), error["input"], error.get("ctx", {})
    if kind == "mistake":
        return InitErrorDetails(type=mistake(ctx["rule"], ctx["remedy"]), loc=loc, input=value)
    if kind == "default_factory_not_called":
        return None
    rule, remedy = "is not valid", str(error["msg"])
    if kind == "tuple_type" and loc[-1:] == ("stage",):
        rule, remedy = "must be a list of tables", "Head each stage with [[stage]], in double brackets"
    elif kind == "tuple_type" and loc[-1:] in (("grains",), ("plane",)):
        rule, remedy = (
            "must be a table, or a list of tables",
            f"Head it with [{loc[-1]}], or each one with [[{loc[-1]}]]",
        )
    elif kind in _PLAIN:
        rule, remedy = _PLAIN[kind]
    elif kind == "extra_forbidden":
        rule, remedy = cls.other_engine(str(loc[-1])) or ("unknown key", did_you_mean(str(loc[-1]), keys_of(cls)))
    elif kind == "missing" and isinstance(loc[-1], int):
        rule, remedy, value = "is missing", "Give both values" if loc[-1] < 2 else "Give all values", NOTHING
    elif kind == "missing":
        rule, remedy, value = "is missing", _example_of(cls, str(loc[-1])), NOTHING
    elif kind == "literal_error" and (other := cls.other_engine(f"{loc[-1]}={value}")):
        rule, remedy = other
    elif kind == "literal_error":
        words = [w.strip("' ") for w in str(ctx["expected"]).replace(" or ", ",").split(",")]
        rule, remedy = (
            f"must be {'one of ' if len(words) > 1 else ''}{', '.join(words)}",
            did_you_mean(str(value), words),
        )
    elif kind == "too_long":
        rule, remedy = f"has too many values, {ctx['max_length']} are wanted", "Leave the others out"
    elif kind == "too_short":
        rule, remedy = "has too few values", f"Give at least {ctx['min_length']}"
    elif kind in ("union_tag_invalid", "union_tag_not_found"):
        kinds = [w.strip("' ") for w in str(ctx["expected_tags"]).split(",")] if "expected_tags" in ctx else cls.kinds()
        said = value.get("kind") if isinstance(value, dict) else value
        rule = f"must be one of {', '.join(kinds)}" if kind == "union_tag_invalid" else "is missing"
        remedy = (
            did_you_mean(str(said), kinds) if kind == "union_tag_invalid" else f"Write kind = one of {', '.join(kinds)}"
        )
        rule, remedy = cls.other_engine(f"kind={said}") or (rule, remedy)
        loc, value = (*loc, "kind"), NOTHING if said is None else said
    return InitErrorDetails(type=mistake(rule, remedy), loc=loc, input=value)


def _without_echoes(found: list[InitErrorDetails]) -> list[InitErrorDetails]:
    """Leaves out that a key is missing where an unknown key is taken for it: that is one slip, not two."""
    meant = {remedy.split('"')[1] for rule, remedy, _ in map(_said, found) if rule == "unknown key" and '"' in remedy}
    return [one for one in found if not (_said(one)[0] == "is missing" and _said(one)[2] in [(m,) for m in meant])]


def _said(one: InitErrorDetails) -> tuple[str, str, tuple[str | int, ...]]:
    kind = one["type"]
    ctx = kind.context if isinstance(kind, PydanticCustomError) else None
    return (ctx["rule"], ctx["remedy"], one.get("loc", ())) if ctx else ("", "", ())


_PLAIN: dict[str, tuple[str, str]] = {
    "string_type": ("must be text in quotes", 'Write for example "a name"'),
    "bool_type": ("must be true or false", "Write true or false, without quotes"),
    "tuple_type": ("must be a list", "Write it in square brackets"),
    "model_attributes_type": ("must be a table", "Give it keys and values"),
}


def _example_of(cls: type[Table], name: str) -> str:
    for attribute, field in cls.model_fields.items():
        if name == (field.alias or attribute):
            if field.examples:
                return f"Add for example {name} = {toml_text(field.examples[0])}"
            if isinstance(field.annotation, type) and issubclass(field.annotation, Table):
                return f"Add the table [{name}]"
    return 'Add [[stage]] with kind = "settle"' if name == "stage" else "Add it"


def toml_text(value: Any) -> str:
    """A value as TOML writes it inline."""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {toml_text(v)}" for k, v in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml_text(v) for v in value) + "]"
    return repr(value)
