"""Numbers with a derivative, for which numba compiles the kernel a second time.

A complex number represents a value and, in its imaginary part, `TINY` times a derivative of it:
products and quotients of complex numbers then follow the rules of differentiation up to the square
of `TINY`, which is far below rounding. This module adds what numba lacks for complex numbers:
comparison by value, and functions with their derivatives. It works in compiled code.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

from numba import types
from numba.extending import lower_builtin, overload

from castfem.base.compiled import compiled

TINY = 2.0**-200  # a power of 2, so that multiplication is exact
DUAL = types.complex128


@compiled
def fill(row, values, changes, i, j):  # type: ignore[no-untyped-def]
    """Write values of a point, row i, with their derivative j."""
    for m in range(row.shape[1]):
        row[0, m] = complex(values[i, m], TINY * changes[j, i, m])


COMPARED: dict[Any, Callable[..., Any]] = {
    operator.lt: lambda a, b: a.real < b.real,
    operator.le: lambda a, b: a.real <= b.real,
    operator.gt: lambda a, b: a.real > b.real,
    operator.ge: lambda a, b: a.real >= b.real,
}


def _exp(a):  # type: ignore[no-untyped-def]
    value = math.exp(a.real)
    return complex(value, value * a.imag)


def _log(a):  # type: ignore[no-untyped-def]
    return complex(math.log(a.real), a.imag / a.real)


def _expm1(a):  # type: ignore[no-untyped-def]
    return complex(math.expm1(a.real), math.exp(a.real) * a.imag)


def _log1p(a):  # type: ignore[no-untyped-def]
    return complex(math.log1p(a.real), a.imag / (1.0 + a.real))


def _sqrt(a):  # type: ignore[no-untyped-def]
    value = math.sqrt(max(a.real, 0.0))  # `a` is a sum of squares, 0 up to the square of `TINY`
    return complex(value, 0.5 * a.imag / value if value > 0.0 else 0.0)


def _hypot(a, b):  # type: ignore[no-untyped-def]
    value = math.hypot(a.real, b.real)
    along = a.real * a.imag + b.real * b.imag
    return complex(value, along / value if value > 0.0 else 0.0)


def _of_one(function: Any, written: Callable[..., Any]) -> None:
    overload(function, strict=False)(lambda a: written if a == DUAL else None)


def _of_two(function: Any, written: Callable[..., Any]) -> None:
    overload(function, strict=False)(lambda a, b: written if DUAL in (a, b) else None)


for _comparison, _compare in COMPARED.items():
    _of_two(_comparison, _compare)
_of_two(math.hypot, _hypot)
for _function, _written in (
    (math.exp, _exp), (math.log, _log), (math.expm1, _expm1), (math.log1p, _log1p),
    (math.sqrt, _sqrt),
):  # fmt: skip
    _of_one(_function, _written)


@lower_builtin(operator.lt, DUAL, DUAL)  # type: ignore[untyped-decorator]
def _less(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    """Comparison used by `min`."""
    return context.compile_internal(builder, COMPARED[operator.lt], signature, args)


@lower_builtin(operator.gt, DUAL, DUAL)  # type: ignore[untyped-decorator]
def _greater(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    """Comparison used by `max`."""
    return context.compile_internal(builder, COMPARED[operator.gt], signature, args)
