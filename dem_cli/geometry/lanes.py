"""Four numbers at once: a vector type for kernels, so that one formula serves a single contact and four of them.

`Lanes` holds four doubles in one register. It knows + - * /, comparison, and the functions below; those for numbers also take
plain floats, so a law written with them compiles for both. Rows lie in flat float64 arrays. Nothing checks bounds here: the
callers pad their lists to a multiple of WIDTH. The code is portable LLVM, not tied to one processor. A lane never enters another
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
_VECTOR = ir.VectorType(_DOUBLE, WIDTH)
_FLAGS = ("contract",)


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
        super().__init__(manager, kind, _VECTOR)


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.VectorType(ir.IntType(1), WIDTH))


def _spread(builder: Any, value: Any) -> Any:
    """A scalar in all lanes; a vector as it is."""
    if value.type == _VECTOR:
        return value
    undefined = ir.Constant(_VECTOR, ir.Undefined)
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


_define(operator.add, lanes, lambda b, x, y: b.fadd(x, y, flags=_FLAGS))
_define(operator.sub, lanes, lambda b, x, y: b.fsub(x, y, flags=_FLAGS))
_define(operator.mul, lanes, lambda b, x, y: b.fmul(x, y, flags=_FLAGS))
_define(operator.truediv, lanes, lambda b, x, y: b.fdiv(x, y, flags=_FLAGS))
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
        kind, name = (_VECTOR, f"llvm.sqrt.v{WIDTH}f64") if sig.return_type == lanes else (_DOUBLE, "llvm.sqrt.f64")
        function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(kind, [kind]), name)
        return builder.call(function, [args[0]])

    return x(x), emit


@intrinsic
def spread(_typing, x):
    """The float x in all lanes."""

    def emit(_context, builder, _sig, args):
        return _spread(builder, args[0])

    return lanes(x), emit


# -- memory ---------------------------------------------------------------------------------------------------------


def _data(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    return context.make_array(kind)(context, builder, value).data


def _read(builder: Any, data: Any, index: Any) -> Any:
    return builder.load(_pointer(builder, data, index), align=8)


def _write(builder: Any, value: Any, data: Any, index: Any) -> None:
    builder.store(value, _pointer(builder, data, index), align=8)


def _pointer(builder: Any, data: Any, index: Any) -> Any:
    return builder.bitcast(builder.gep(data, [index], inbounds=True), _VECTOR.as_pointer())


def _word(value: int) -> Any:
    return ir.Constant(ir.IntType(64), value)


def _offsets(builder: Any, list_data: Any, k: Any) -> list[Any]:
    """Entries k..k+3 of an int32 list of offsets."""
    at = (builder.gep(list_data, [builder.add(k, _word(lane))], inbounds=True) for lane in range(WIDTH))
    return [builder.zext(builder.load(pointer), ir.IntType(64)) for pointer in at]


def _shuffle(builder: Any, x: Any, y: Any, order: list[int]) -> Any:
    return builder.shuffle_vector(x, y, ir.Constant(ir.VectorType(ir.IntType(32), len(order)), order))


def _transpose(builder: Any, rows: list[Any], columns: int = WIDTH) -> list[Any]:
    """Four rows of four -> their first `columns` columns."""
    halves = []
    for order in ([0, 4, 2, 6], [1, 5, 3, 7]):
        halves.append([_shuffle(builder, rows[k], rows[k + 1], order) for k in (0, 2)])
    out = [_shuffle(builder, top, bottom, [0, 1, 4, 5]) for top, bottom in halves]
    if columns == WIDTH:
        out += [_shuffle(builder, top, bottom, [2, 3, 6, 7]) for top, bottom in halves]
    return out


@intrinsic
def load(_typing, array, k):
    """array[k:k+4]."""

    def emit(context, builder, sig, args):
        return _read(builder, _data(context, builder, sig.args[0], args[0]), args[1])

    return lanes(array, types.intp), emit


@intrinsic
def store(_typing, array, k, value):
    """array[k:k+4] = value."""

    def emit(context, builder, sig, args):
        _write(builder, args[2], _data(context, builder, sig.args[0], args[0]), args[1])
        return context.get_dummy_value()

    return types.void(array, types.intp, value), emit


@intrinsic
def load_rows(_typing, array, start, stride):
    """Four columns of the four rows that begin at start, start + stride, ..."""

    def emit(context, builder, sig, args):
        data = _data(context, builder, sig.args[0], args[0])
        rows = [_read(builder, data, at) for at in _strided(builder, args[1], args[2])]
        return context.make_tuple(builder, sig.return_type, _transpose(builder, rows))

    return types.UniTuple(lanes, 4)(array, types.intp, types.intp), emit


@intrinsic
def store_rows(_typing, array, start, stride, a, b, c, d):
    """Write four columns back to the rows that `load_rows` reads."""

    def emit(context, builder, sig, args):
        data = _data(context, builder, sig.args[0], args[0])
        rows = _transpose(builder, list(args[3:]))
        for at, row in zip(_strided(builder, args[1], args[2]), rows, strict=True):
            _write(builder, row, data, at)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp, a, b, c, d), emit


def _strided(builder: Any, start: Any, stride: Any) -> list[Any]:
    return [builder.add(start, builder.mul(stride, _word(lane))) for lane in range(WIDTH)]


def _chunks(context: Any, builder: Any, sig: Any, args: Any) -> tuple[Any, list[Any], list[Any]]:
    """Data of `rows`, and where the chunk at `column` of first's and second's rows begins: arguments rows, first, second, k, column."""
    data, one, two = (_data(context, builder, sig.args[n], args[n]) for n in range(3))
    first, second = (
        [builder.add(offset, args[4]) for offset in _offsets(builder, part, args[3])] for part in (one, two)
    )
    return data, first, second


def _gathering(operation: str, columns: int) -> Any:
    def typed(_typing: Any, rows: Any, first: Any, second: Any, _k: Any, _column: Any) -> Any:
        def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            data, i, j = _chunks(context, builder, sig, args)
            combine = getattr(builder, operation)
            parts = [
                combine(_read(builder, data, to), _read(builder, data, of), flags=_FLAGS)
                for of, to in zip(i, j, strict=True)
            ]
            return context.make_tuple(builder, sig.return_type, _transpose(builder, parts, columns))

        return types.UniTuple(lanes, columns)(rows, first, second, types.intp, types.intp), emit

    return typed


@intrinsic
def gather_difference(typing, rows, first, second, k, column):
    """Four columns from `column` on of second's rows less first's, for the pairs k..k+3 of two int32 lists of offsets."""
    return _gathering("fsub", 4)(typing, rows, first, second, k, column)


@intrinsic
def gather_sum(typing, rows, first, second, k, column):
    """Two columns from `column` on of second's rows plus first's, for the pairs k..k+3 of two int32 lists of offsets."""
    return _gathering("fadd", 2)(typing, rows, first, second, k, column)


@intrinsic
def gather_column(_typing, rows, offsets, k, column):
    """One column of the rows at the entries k..k+3 of an int32 list of offsets."""

    def emit(context, builder, sig, args):
        data, list_data = (_data(context, builder, sig.args[n], args[n]) for n in range(2))
        out = ir.Constant(_VECTOR, ir.Undefined)
        for lane, offset in enumerate(_offsets(builder, list_data, args[2])):
            value = builder.load(builder.gep(data, [builder.add(offset, args[3])], inbounds=True))
            out = builder.insert_element(out, value, ir.Constant(ir.IntType(32), lane))
        return out

    return lanes(rows, offsets, types.intp, types.intp), emit


@intrinsic
def gather_thirds(_typing, fours, offsets, k):
    """The four columns of rows of four, for the entries k..k+3 of an int32 list of offsets of rows of twelve."""

    def emit(context, builder, sig, args):
        data, list_data = (_data(context, builder, sig.args[n], args[n]) for n in range(2))
        three = ir.Constant(ir.IntType(64), 3)
        rows = [_read(builder, data, builder.udiv(at, three)) for at in _offsets(builder, list_data, args[2])]
        return context.make_tuple(builder, sig.return_type, _transpose(builder, rows))

    return types.UniTuple(lanes, 4)(fours, offsets, types.intp), emit


def _add_to_rows(context: Any, builder: Any, sig: Any, args: Any, reactions: Any, actions: Any) -> Any:
    """Add reactions to first's and actions to second's four columns from args[4] on, pair after pair."""
    data, i, j = _chunks(context, builder, sig, args)
    for m in range(WIDTH):
        for row, value in ((i[m], reactions[m]), (j[m], actions[m])):
            _write(builder, builder.fadd(_read(builder, data, row), value), data, row)
    return context.get_dummy_value()


@intrinsic
def scatter_action(_typing, rows, first, second, k, column, x, y, turn):
    """Action and reaction of the pairs k..k+3: (x, y, 0, turn) is added to the four columns of second's row from `column` on,
    (-x, -y, 0, turn) to those of first's.
    """

    def emit(context, builder, sig, args):
        zero = ir.Constant(_VECTOR, [0.0] * WIDTH)
        actions = _transpose(builder, [args[5], args[6], zero, args[7]])
        integers = ir.VectorType(ir.IntType(64), WIDTH)
        signs = ir.Constant(integers, [-(1 << 63), -(1 << 63), 0, 0])
        reactions = [
            builder.bitcast(builder.xor(builder.bitcast(action, integers), signs), _VECTOR) for action in actions
        ]
        return _add_to_rows(context, builder, sig, args, reactions, actions)

    return types.void(rows, first, second, types.intp, types.intp, x, y, turn), emit


@intrinsic
def scatter_wrench(_typing, rows, first, second, k, column, x, y, turn_first, turn_second):
    """Like `scatter_action`, with a turn of its own for each of the two."""

    def emit(context, builder, sig, args):
        zero = ir.Constant(_VECTOR, [0.0] * WIDTH)
        actions = _transpose(builder, [args[5], args[6], zero, args[8]])
        reactions = _transpose(builder, [builder.fneg(args[5]), builder.fneg(args[6]), zero, args[7]])
        return _add_to_rows(context, builder, sig, args, reactions, actions)

    return types.void(rows, first, second, types.intp, types.intp, x, y, turn_first, turn_second), emit


@intrinsic
def pack(_typing, a, b, c, d):
    """Four floats as lanes (a, b, c, d)."""

    def emit(_context, builder, _sig, args):
        out = ir.Constant(_VECTOR, ir.Undefined)
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
            return _shuffle(builder, args[0], ir.Constant(_VECTOR, [0.0] * WIDTH), order)

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
