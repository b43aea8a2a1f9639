"""From A to B on a confidence grid: routes, or reasons why there is none.

The names are those of `planners.public`, which is loaded when the first is asked for: the command
line handles Ctrl-C before that, as loading takes a second. No module of the package may be called
like one of them, since Python would then show the module instead.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from planners.public import *  # noqa: F403  # what `__getattr__` returns
    from planners.public import __all__ as __all__


def __getattr__(name: str) -> Any:
    if name.startswith("_") and name != "__all__":  # what Python and its tools look for
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    public = import_module("planners.public")
    if name != "__all__" and name not in public.__all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(public, name)
    return value


def __dir__() -> list[str]:
    return [*globals(), *import_module("planners.public").__all__]
