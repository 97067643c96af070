"""Values that are made when first asked for."""

from collections.abc import Callable, Iterator, Mapping
from operator import methodcaller
from typing import Generic, TypeVar, overload

_Value = TypeVar("_Value")


class Deferred(Generic[_Value]):
    """A value that is made when first asked for, and pickled as what it is then."""

    __slots__ = ("_make", "_value")

    def __init__(self, make: Callable[[], _Value]) -> None:
        """Defer a call."""
        self._make: Callable[[], _Value] | None = make

    @classmethod
    def of(cls, value: _Value) -> "Deferred[_Value]":
        """Return a value that is there already."""
        deferred = cls(lambda: value)
        deferred()
        return deferred

    def __call__(self) -> _Value:
        """Return the value."""
        if self._make is not None:
            self._value = self._make()
            self._make = None
        return self._value

    def __reduce__(self) -> "tuple[Callable[[_Value], Deferred[_Value]], tuple[_Value]]":
        """Pickle the value."""
        return Deferred.of, (self(),)


class DeferredRecords(Mapping[str, _Value]):
    """Records by id, all made when the first of them is asked for."""

    __slots__ = ("_records",)

    def __init__(self, make: Callable[[], dict[str, _Value]]) -> None:
        """Defer a call that makes them."""
        self._records = Deferred(make)

    def __getitem__(self, name: str) -> _Value:
        return self._records()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._records())

    def __len__(self) -> int:
        return len(self._records())


_details = methodcaller("details")


class Detail(Generic[_Value]):
    """A field of a record's deferred `details`, as an attribute of the record itself."""

    __slots__ = ("_name",)

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, record: None, owner: type) -> "Detail[_Value]": ...
    @overload
    def __get__(self, record: object, owner: type) -> _Value: ...
    def __get__(self, record: object, owner: type) -> "_Value | Detail[_Value]":
        if record is None:
            return self
        value: _Value = getattr(_details(record), self._name)
        return value
