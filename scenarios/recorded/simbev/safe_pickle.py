"""Pickles of NumPy arrays and plain values, read without running anything that they name.

A pickle is a program: it names functions and calls them. Here every opcode and every name is on a list; a
name stands for a value of this module, never for the function itself, and a call only keeps its arguments.
An array is made when its shape, its type and the length of its content agree, and copies together are no
longer than the pickle, so that its memory and its time are bounded by its length. Everything else is refused
by name before anything of it is made.

Source of the opcodes: `pickletools` of Python; of the states: `ndarray.__reduce__`, `dtype.__reduce__`.
"""

from __future__ import annotations

import math
import pickle
import re
import struct
from collections.abc import Callable
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from scenarios.reading import ReadError, shown

_ONLY = "only NumPy arrays and plain values are read"
_MOST_AXES = 64
"""Of an array of NumPy 2."""
_LONGEST_AXIS = 2**31
"""More would be no array here; a product of numbers of a million digits takes hours."""

_PLAIN_DTYPE = re.compile(r"[biufcSU?][0-9]*")
"""Codes of numbers, truth values and texts; no objects, records or dates."""

_FAULTS = (ValueError, TypeError, LookupError, struct.error, RecursionError, MemoryError)
"""What a damaged pickle ends in."""


class _Dtype:
    """A type of numbers, as `numpy.dtype(code, ...)` names it."""

    __slots__ = ("code", "order")

    def __init__(self, code: object, *_: object) -> None:
        self.code, self.order = code, "="
        if code != "O8" and not (isinstance(code, str) and _PLAIN_DTYPE.fullmatch(code)):
            raise ReadError(f"a dtype {shown(code)}: {_ONLY}")

    def build(self, state: object) -> None:
        """Take the byte order; a plain type has no fields and no shape."""
        if not isinstance(state, tuple) or len(state) < 5 or any(part is not None for part in state[2:5]):
            raise ReadError(f"a dtype with fields: {_ONLY}")
        if state[1] not in ("<", ">", "|", "="):
            raise ReadError(f"a dtype of byte order {shown(state[1])}")
        self.order = state[1]

    def plain(self) -> np.dtype[Any]:
        """The type.

        Raises:
            ReadError: it is that of objects.
        """
        if self.code == "O8":
            raise ReadError(f"a value of dtype object: {_ONLY}")
        return np.dtype(f"{self.order}{self.code}")


class PickledArray:
    """An array whose content follows its making.

    Attributes:
        value: the array; a list where its dtype is object.
    """

    __slots__ = ("value",)

    def __init__(self) -> None:
        self.value: NDArray[Any] | list[Any] | None = None

    def build(self, state: object) -> None:
        """Take version, shape, type, order and content."""
        if not isinstance(state, tuple) or len(state) != 5:
            raise ReadError("an array without shape, dtype and content")
        _, shape, dtype, is_fortran, content = state
        if isinstance(dtype, _Dtype) and dtype.code == "O8":
            # the outermost array of a file; what is in it has passed the same list
            if not isinstance(content, list) or shape != (len(content),):
                raise ReadError(f"an object array of shape {shown(shape)} and other content")
            self.value = content
        else:
            self.value = _array(content, dtype, shape, "F" if is_fortran is True else "C")


def _array(content: object, dtype: object, shape: object, order: object) -> NDArray[Any]:
    """An array, if its parts agree; nothing is allocated before."""
    if not isinstance(dtype, _Dtype) or not isinstance(content, bytes) or order not in ("C", "F"):
        raise ReadError(f"an array of {shown(type(dtype).__name__)} with {type(content).__name__}")
    if not isinstance(shape, tuple) or len(shape) > _MOST_AXES:
        raise ReadError(f"an array of shape {shown(shape)}")
    if not all(type(n) is int and 0 <= n <= _LONGEST_AXIS for n in shape):
        raise ReadError(f"an array of shape {shown(shape)}")
    plain = dtype.plain()
    if math.prod(shape) * plain.itemsize != len(content) or not plain.itemsize:
        raise ReadError(f"an array of shape {shown(shape)} and dtype {plain} in {len(content)} bytes")
    return np.frombuffer(content, plain).reshape(shape, order="F" if order == "F" else "C")


def _scalar(dtype: object, content: object) -> Any:
    return _array(content, dtype, (), "C")[()]


def _bytes(text: object, encoding: object) -> bytes:
    if not isinstance(text, str) or encoding != "latin1":
        raise ReadError(f"bytes in {shown(encoding)}")
    return text.encode("latin1")


class _Call:
    """What an allowed name stands for: how its arguments become a value.

    Args:
        make: makes it.
    """

    __slots__ = ("make",)

    def __init__(self, make: Callable[..., Any]) -> None:
        self.make = make


_NDARRAY = _Call(lambda *_: _refuse("numpy.ndarray is called"))
_ALLOWED = {
    ("numpy", "ndarray"): _NDARRAY,
    ("numpy", "dtype"): _Call(_Dtype),
    ("_codecs", "encode"): _Call(_bytes),  # bytes of protocol 2
    ("__builtin__", "bytes"): _Call(lambda: b""),
} | {
    (f"numpy.{core}.{module}", name): _Call(make)
    for core in ("core", "_core")  # of NumPy 1 and 2
    for module, name, make in (
        ("multiarray", "_reconstruct", lambda *_: PickledArray()),
        ("multiarray", "scalar", _scalar),
        ("numeric", "_frombuffer", _array),  # protocol 5
    )
}


def _refuse(what: str) -> NoReturn:
    raise ReadError(f"{what}: {_ONLY}")


_STOP, _MEMOIZE = pickle.STOP[0], pickle.MEMOIZE[0]
_CONSTANTS: dict[int, object] = {
    pickle.NONE[0]: None,
    pickle.NEWTRUE[0]: True,
    pickle.NEWFALSE[0]: False,
}
_NUMBERS = {
    code[0]: struct.Struct(form)
    for code, form in (
        (pickle.BININT, "<i"),
        (pickle.BININT1, "<B"),
        (pickle.BININT2, "<H"),
        (pickle.BINFLOAT, ">d"),
    )
}
_LENGTHS = {4: struct.Struct("<I"), 8: struct.Struct("<Q")}
_COUNTED: dict[int, tuple[int, Callable[[bytes], object]]] = {
    pickle.SHORT_BINUNICODE[0]: (1, bytes.decode),
    pickle.BINUNICODE[0]: (4, bytes.decode),
    pickle.BINUNICODE8[0]: (8, bytes.decode),
    pickle.SHORT_BINBYTES[0]: (1, bytes),
    pickle.BINBYTES[0]: (4, bytes),
    pickle.BINBYTES8[0]: (8, bytes),
    pickle.BYTEARRAY8[0]: (8, bytes),
    pickle.LONG1[0]: (1, pickle.decode_long),
    pickle.LONG4[0]: (4, pickle.decode_long),
}
"""Values that follow their length: its bytes, and how they become a value."""

_TUPLES = {pickle.EMPTY_TUPLE[0]: 0, pickle.TUPLE1[0]: 1, pickle.TUPLE2[0]: 2, pickle.TUPLE3[0]: 3}
_PUT = {pickle.BINPUT[0]: 1, pickle.LONG_BINPUT[0]: 4}
_GET = {pickle.BINGET[0]: 1, pickle.LONG_BINGET[0]: 4}

_NAME_OF_OPCODE = {
    getattr(pickle, name)[0]: name
    for name in pickle.__all__
    if name.isupper() and isinstance(getattr(pickle, name), bytes)
}


class _Machine:
    """Carries out the opcodes of a pickle.

    Args:
        content: the pickle.
    """

    def __init__(self, content: bytes) -> None:
        self._content, self._at, self._end = content, 0, len(content)
        self._stack: list[Any] = []
        self._marks: list[int] = []
        self._memo: dict[int, Any] = {}
        self._copied = 0  # bytes

    def run(self) -> Any:
        """The value at the end."""
        stack, memo = self._stack, self._memo
        while (code := self._byte()) != _STOP:
            if code in _GET:
                stack.append(memo[self._length(_GET[code])])
            elif code in _COUNTED:
                size, made_of = _COUNTED[code]
                stack.append(made_of(self._take(self._length(size))))
            elif code == _MEMOIZE:
                memo[len(memo)] = stack[-1]
            elif code in _TUPLES:
                self._push_tuple(len(stack) - _TUPLES[code])
            elif code in _STEPS:
                _STEPS[code](self)
            elif code in _CONSTANTS:
                stack.append(_CONSTANTS[code])
            elif code in _NUMBERS:
                form = _NUMBERS[code]
                stack.append(form.unpack(self._take(form.size))[0])
            elif code in _PUT:
                memo[self._length(_PUT[code])] = stack[-1]
            else:
                _refuse(f"opcode {_NAME_OF_OPCODE.get(code, code)}")
        return stack.pop()

    def _byte(self) -> int:
        at = self._at
        if at >= self._end:
            raise ReadError("cut off")
        self._at = at + 1
        return self._content[at]

    def _take(self, count: int) -> bytes:
        """The next bytes; a copy is made only of what is there."""
        end = self._at + count
        if end > self._end:
            raise ReadError("cut off")
        taken = self._content[self._at : end]
        self._at = end
        return taken

    def _length(self, size: int) -> int:
        if size == 1:
            return self._byte()
        length: int = _LENGTHS[size].unpack(self._take(size))[0]
        return length

    def _line(self) -> str:
        end = self._content.index(b"\n", self._at)
        line = self._take(end - self._at).decode()
        self._at += 1
        return line

    def _push_tuple(self, first: int) -> None:
        if first < 0:
            raise ReadError("damaged")
        items = tuple(self._stack[first:])
        self._stack[first:] = [items]

    def _since_mark(self) -> list[Any]:
        first = self._marks.pop()
        items = self._stack[first:]
        del self._stack[first:]
        return items

    def mark(self) -> None:
        self._marks.append(len(self._stack))

    def skip_protocol(self) -> None:
        self._take(1)

    def skip_frame(self) -> None:
        self._take(8)

    def push_list(self) -> None:
        self._stack.append([])

    def push_dict(self) -> None:
        self._stack.append({})

    def push_marked_tuple(self) -> None:
        self._stack.append(tuple(self._since_mark()))

    def append(self) -> None:
        self._extend([self._stack.pop()])

    def appends(self) -> None:
        self._extend(self._since_mark())

    def _extend(self, items: list[Any]) -> None:
        target = self._stack[-1]
        if type(target) is not list:
            _refuse("items of something that is no list")
        target.extend(items)

    def set_item(self) -> None:
        value, key = self._stack.pop(), self._stack.pop()
        self._set([key, value])

    def set_items(self) -> None:
        self._set(self._since_mark())

    def _set(self, items: list[Any]) -> None:
        keys, values, target = items[::2], items[1::2], self._stack[-1]
        # a tuple nested a million times would overflow the stack of the hash, and whoever writes the file
        # can choose numbers that all have the same hash
        if type(target) is not dict or not all(type(key) is str for key in keys):
            _refuse("a key that is no text")
        target.update(zip(keys, values, strict=True))

    def push_global(self) -> None:
        self._push_name(self._line(), self._line())

    def push_stacked_global(self) -> None:
        name, module = self._stack.pop(), self._stack.pop()
        self._push_name(module, name)

    def _push_name(self, module: object, name: object) -> None:
        if not isinstance(module, str) or not isinstance(name, str):
            raise ReadError("a name that is no text")
        if (module, name) not in _ALLOWED:
            _refuse(f"it names {module}.{name}")
        self._stack.append(_ALLOWED[module, name])

    def reduce(self) -> None:
        arguments, function = self._stack.pop(), self._stack[-1]
        if not isinstance(function, _Call) or not isinstance(arguments, tuple):
            _refuse(f"a call of {shown(function)}")
        self._stack[-1] = made = function.make(*arguments)
        if isinstance(made, (bytes, np.generic)):
            self._copied += made.nbytes if isinstance(made, np.generic) else len(made)
            # of one long text, named again and again
            if self._copied > self._end:
                _refuse("copies that are longer than the pickle")

    def build(self) -> None:
        state, value = self._stack.pop(), self._stack[-1]
        if not isinstance(value, (_Dtype, PickledArray)):
            _refuse(f"a state of {shown(value)}")
        value.build(state)


_STEPS: dict[int, Callable[[_Machine], None]] = {
    pickle.MARK[0]: _Machine.mark,
    pickle.PROTO[0]: _Machine.skip_protocol,
    pickle.FRAME[0]: _Machine.skip_frame,
    pickle.EMPTY_LIST[0]: _Machine.push_list,
    pickle.EMPTY_DICT[0]: _Machine.push_dict,
    pickle.TUPLE[0]: _Machine.push_marked_tuple,
    pickle.APPEND[0]: _Machine.append,
    pickle.APPENDS[0]: _Machine.appends,
    pickle.SETITEM[0]: _Machine.set_item,
    pickle.SETITEMS[0]: _Machine.set_items,
    pickle.GLOBAL[0]: _Machine.push_global,
    pickle.STACK_GLOBAL[0]: _Machine.push_stacked_global,
    pickle.REDUCE[0]: _Machine.reduce,
    pickle.BUILD[0]: _Machine.build,
}


def read_pickle(content: bytes) -> Any:
    """What a pickle holds: plain values, and arrays as `PickledArray`.

    Args:
        content: the pickle, of protocol 2 to 5; what follows its end is not read.

    Raises:
        ReadError: it is damaged, or holds anything else; the message has its name.
    """
    try:
        return _Machine(content).run()
    except ReadError as error:
        raise ReadError(f"pickle refused: {error}") from None
    except _FAULTS as error:
        raise ReadError(f"not a readable pickle ({shown(str(error) or type(error).__name__)})") from None


_MAGIC = b"\x93NUMPY"
_HEADER = re.compile(
    rb"\{'descr': '([ -&(-~]*)', 'fortran_order': (?:True|False), 'shape': \(([0-9, ]*)\), \} *\n"
)
"""As `numpy.lib.format` writes it, after magic, version and its length."""


def read_npy_list(content: bytes) -> list[Any]:
    """The values of a file of `numpy.save(file, numpy.array(values), allow_pickle=True)`, or of their pickle.

    Raises:
        ReadError: it is damaged, or holds anything else.
    """
    start = 0
    if content.startswith(_MAGIC):
        wide = content[len(_MAGIC) : len(_MAGIC) + 1] != b"\x01"  # from version 2 on
        header = _HEADER.match(content, len(_MAGIC) + (6 if wide else 4))
        if header is None:
            raise ReadError("not a readable array: its header is damaged")
        dtype, shape = header[1].decode(), header[2].decode()
        if shape == "0,":  # an array of no values is one of numbers
            return []
        if dtype != "|O" or not re.fullmatch(r"[0-9]+,", shape):
            raise ReadError(f"an array of shape ({shape}) and dtype {dtype}, expected a list of labels")
        start = header.end()
    values = read_pickle(content[start:])
    if isinstance(values, PickledArray):
        values = values.value
    if not isinstance(values, list):
        raise ReadError(f"expected a list of labels, got {shown(type(values).__name__)}")
    return values
