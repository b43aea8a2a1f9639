"""Planning on a confidence grid: collision-free routes, or the reason why there is none.

The public names are those of `planners.public`, which is loaded on the first access to one of them,
because loading takes a second and the command line handles Ctrl-C before. No module of the package
may have one of these names, since Python would then return the module instead.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from planners.public import *  # noqa: F403  # what `__getattr__` returns
    from planners.public import __all__ as __all__


def __getattr__(name: str) -> Any:
    if name.startswith("_") and name != "__all__":  # looked up by Python and its tools
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    public = import_module("planners.public")
    if name != "__all__" and name not in public.__all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(public, name)
    return value


def __dir__() -> list[str]:
    return [*globals(), *import_module("planners.public").__all__]
