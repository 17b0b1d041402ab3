"""Four rows at a time between memory and `lanes`: rows of four columns are read at once and turned into four Lanes.

Rows lie in flat float64 arrays. Nothing checks bounds here: the callers pad their lists to a multiple of WIDTH.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from dem_cli.geometry.lanes import FLAGS, VECTOR, WIDTH, lanes, shuffle


def _data(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    return context.make_array(kind)(context, builder, value).data


def _read(builder: Any, data: Any, index: Any) -> Any:
    return builder.load(_pointer(builder, data, index), align=8)


def _write(builder: Any, value: Any, data: Any, index: Any) -> None:
    builder.store(value, _pointer(builder, data, index), align=8)


def _pointer(builder: Any, data: Any, index: Any) -> Any:
    return builder.bitcast(builder.gep(data, [index], inbounds=True), VECTOR.as_pointer())


def _word(value: int) -> Any:
    return ir.Constant(ir.IntType(64), value)


def _offsets(builder: Any, list_data: Any, k: Any) -> list[Any]:
    """Entries k..k+3 of an int32 list of offsets."""
    at = (builder.gep(list_data, [builder.add(k, _word(lane))], inbounds=True) for lane in range(WIDTH))
    return [builder.zext(builder.load(pointer), ir.IntType(64)) for pointer in at]


def _transpose(builder: Any, rows: list[Any], columns: int = WIDTH) -> list[Any]:
    """Four rows of four -> their first `columns` columns."""
    halves = []
    for order in ([0, 4, 2, 6], [1, 5, 3, 7]):
        halves.append([shuffle(builder, rows[k], rows[k + 1], order) for k in (0, 2)])
    out = [shuffle(builder, top, bottom, [0, 1, 4, 5]) for top, bottom in halves]
    if columns == WIDTH:
        out += [shuffle(builder, top, bottom, [2, 3, 6, 7]) for top, bottom in halves]
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
                combine(_read(builder, data, to), _read(builder, data, of), flags=FLAGS)
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
        out = ir.Constant(VECTOR, ir.Undefined)
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
        zero = ir.Constant(VECTOR, [0.0] * WIDTH)
        actions = _transpose(builder, [args[5], args[6], zero, args[7]])
        integers = ir.VectorType(ir.IntType(64), WIDTH)
        signs = ir.Constant(integers, [-(1 << 63), -(1 << 63), 0, 0])
        reactions = [
            builder.bitcast(builder.xor(builder.bitcast(action, integers), signs), VECTOR) for action in actions
        ]
        return _add_to_rows(context, builder, sig, args, reactions, actions)

    return types.void(rows, first, second, types.intp, types.intp, x, y, turn), emit


@intrinsic
def scatter_wrench(_typing, rows, first, second, k, column, x, y, turn_first, turn_second):
    """Like `scatter_action`, with a turn of its own for each of the two."""

    def emit(context, builder, sig, args):
        zero = ir.Constant(VECTOR, [0.0] * WIDTH)
        actions = _transpose(builder, [args[5], args[6], zero, args[8]])
        reactions = _transpose(builder, [builder.fneg(args[5]), builder.fneg(args[6]), zero, args[7]])
        return _add_to_rows(context, builder, sig, args, reactions, actions)

    return types.void(rows, first, second, types.intp, types.intp, x, y, turn_first, turn_second), emit
