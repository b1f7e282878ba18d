"""Registration with Mitsuba of the BSDF ``glaze``."""

import sys
from typing import Any

from .bsdf import GlazeBSDF
from .device import renderer
from .variants import check_llvm

_callbacks: list[Any] = []


def register() -> None:
    """Make ``{"type": "glaze", ...}`` known to the variant of Mitsuba that is set, and to those set
    from now on.

    Raises:
        ModuleNotFoundError: Mitsuba is not installed.
        ValueError: no variant is set, one without spectra, or one of LLVM's where the LLVM that is
            found ends the process.
    """
    mi = renderer()[0]
    check_llvm(mi.variant())
    _attach(mi)


def _attach(mi: Any) -> None:
    _register(mi)
    if not _callbacks:
        _callbacks.append(lambda old, new: _register(mi))
        mi.detail.add_variant_callback(_callbacks[0])


def register_if_set() -> None:
    """The same, where Mitsuba is loaded with a variant that will do."""
    mitsuba = sys.modules.get("mitsuba")
    if mitsuba is not None and getattr(mitsuba, "variant", lambda: None)() is not None:
        _attach(mitsuba)


def _register(mi: Any) -> None:
    """In the current variant: one without spectra gets it too, and says at load what it lacks."""
    # Mitsuba's classes take no second base, so the methods are copied.
    methods = {
        name: attribute
        for name, attribute in vars(GlazeBSDF).items()
        if name not in ("__dict__", "__weakref__")
    }
    kind = type("Glaze", (mi.BSDF,), methods)
    mi.register_bsdf("glaze", lambda props: _make_bsdf(kind, props))


def _make_bsdf(kind: Any, props: Any) -> Any:
    """The BSDF; Mitsuba prints the whole way of an error, so that is kept short."""
    try:
        return kind(props)
    except (ValueError, OSError, ModuleNotFoundError) as error:
        problem = error
    raise problem.with_traceback(None)
