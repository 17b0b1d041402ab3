"""Four numbers at once: a vector type for kernels, so that one formula serves a single contact and four of them.

`Lanes` holds four doubles in one register. It knows + - * /, comparison, and the functions below; those for numbers also take
plain floats, so a law written with them compiles for both. The code is portable LLVM, not tied to one processor. A lane never enters another
one's sum but at the end, in order, so results do not depend on the processor's vectors.
"""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, register_model

WIDTH = 4
_DOUBLE = ir.DoubleType()
VECTOR = ir.VectorType(_DOUBLE, WIDTH)
FLAGS = ("contract",)


class LanesType(types.Type):
    """Numba type of four doubles."""

    def __init__(self) -> None:
        super().__init__(name="Lanes")


class MaskType(types.Type):
    """Numba type of four truth values, made by comparing lanes."""

    def __init__(self) -> None:
        super().__init__(name="LanesMask")


lanes = LanesType()
mask = MaskType()


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, VECTOR)


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.VectorType(ir.IntType(1), WIDTH))


def _spread(builder: Any, value: Any) -> Any:
    """A scalar in all lanes; a vector as it is."""
    if value.type == VECTOR:
        return value
    undefined = ir.Constant(VECTOR, ir.Undefined)
    first = builder.insert_element(undefined, value, ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(first, undefined, zeros)


_MIXED = ((lanes, lanes), (lanes, types.float64), (types.float64, lanes))


def _define(operation: Any, result: types.Type, emit: Any) -> None:
    """Teach Numba `operation` on lanes; a float beside lanes is spread over them."""

    class Template(ConcreteTemplate):
        cases = [signature(result, *pair) for pair in _MIXED]  # noqa: RUF012 (Numba's protocol)

    infer_global(operation)(Template)
    for pair in _MIXED:

        @lower_builtin(operation, *pair)  # type: ignore[untyped-decorator]
        def lower(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
            return emit(builder, _spread(builder, args[0]), _spread(builder, args[1]))


_define(operator.add, lanes, lambda b, x, y: b.fadd(x, y, flags=FLAGS))
_define(operator.sub, lanes, lambda b, x, y: b.fsub(x, y, flags=FLAGS))
_define(operator.mul, lanes, lambda b, x, y: b.fmul(x, y, flags=FLAGS))
_define(operator.truediv, lanes, lambda b, x, y: b.fdiv(x, y, flags=FLAGS))
_define(operator.gt, mask, lambda b, x, y: b.fcmp_ordered(">", x, y))
_define(operator.lt, mask, lambda b, x, y: b.fcmp_ordered("<", x, y))


@infer_global(operator.neg)
class _Negative(ConcreteTemplate):
    cases = [signature(lanes, lanes)]  # noqa: RUF012


@lower_builtin(operator.neg, lanes)  # type: ignore[untyped-decorator]
def _negative(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
    return builder.fneg(args[0])


def _common(x: types.Type, y: types.Type) -> types.Type:
    return lanes if lanes in (x, y) else types.float64


def _operands(context: Any, builder: Any, sig: Any, args: Any) -> list[Any]:
    """Arguments as the result's kind: all lanes, or all doubles."""
    out = []
    for value, kind in zip(args, sig.args, strict=True):
        if kind is not lanes:
            value = context.cast(builder, value, kind, types.float64)
        out.append(_spread(builder, value) if sig.return_type == lanes else value)
    return out


def _selection(sign: str) -> Any:
    def typed(_typing: Any, x: Any, y: Any) -> Any:
        def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            x, y = _operands(context, builder, sig, args)
            return builder.select(builder.fcmp_ordered(sign, x, y), x, y)

        return _common(x, y)(x, y), emit

    return typed


@intrinsic
def maximum(typing, x, y):
    """The larger one; `y` where either is NaN."""
    return _selection(">")(typing, x, y)


@intrinsic
def minimum(typing, x, y):
    """The smaller one; `y` where either is NaN."""
    return _selection("<")(typing, x, y)


@intrinsic
def where(_typing, condition, x, y):
    """`x` where the condition holds, else `y`."""

    def emit(context, builder, sig, args):
        x, y = _operands(context, builder, sig.return_type(*sig.args[1:]), args[1:])
        return builder.select(args[0], x, y)

    return _common(x, y)(condition, x, y), emit


@intrinsic
def root(_typing, x):
    """Square root."""

    def emit(_context, builder, sig, args):
        kind, name = (VECTOR, f"llvm.sqrt.v{WIDTH}f64") if sig.return_type == lanes else (_DOUBLE, "llvm.sqrt.f64")
        function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(kind, [kind]), name)
        return builder.call(function, [args[0]])

    return x(x), emit


@intrinsic
def spread(_typing, x):
    """The float x in all lanes."""

    def emit(_context, builder, _sig, args):
        return _spread(builder, args[0])

    return lanes(x), emit


def shuffle(builder: Any, x: Any, y: Any, order: list[int]) -> Any:
    return builder.shuffle_vector(x, y, ir.Constant(ir.VectorType(ir.IntType(32), len(order)), order))


@intrinsic
def pack(_typing, a, b, c, d):
    """Four floats as lanes (a, b, c, d)."""

    def emit(_context, builder, _sig, args):
        out = ir.Constant(VECTOR, ir.Undefined)
        for lane, value in enumerate(args):
            out = builder.insert_element(out, value, ir.Constant(ir.IntType(32), lane))
        return out

    return lanes(*[types.float64] * 4), emit


@intrinsic
def unpack(_typing, x):
    """The four floats of lanes."""

    def emit(context, builder, sig, args):
        parts = [builder.extract_element(args[0], ir.Constant(ir.IntType(32), lane)) for lane in range(WIDTH)]
        return context.make_tuple(builder, sig.return_type, parts)

    return types.UniTuple(types.float64, WIDTH)(x), emit


def _moved_halves(order: list[int]) -> Any:
    def typed(_typing: Any, x: Any) -> Any:
        def emit(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
            return shuffle(builder, args[0], ir.Constant(VECTOR, [0.0] * WIDTH), order)

        return lanes(x), emit

    return typed


@intrinsic
def first_half_last(typing, x):
    """(a, b, c, d) -> (0, 0, a, b)."""
    return _moved_halves([4, 4, 0, 1])(typing, x)


@intrinsic
def last_half_first(typing, x):
    """(a, b, c, d) -> (c, d, 0, 0)."""
    return _moved_halves([2, 3, 4, 4])(typing, x)
