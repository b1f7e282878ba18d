"""Packages that only some tasks need, and the extra of glazejax that installs each: one place, one
sentence.
"""

from importlib.metadata import PackageNotFoundError, distribution

# Extra -> names to import of the packages that it brings.
_EXTRAS = {
    "commands": "typer rich",
    "plots": "matplotlib corner jinja2",
    "formats": "python_calamine",
    "arviz": "arviz h5py",
    "scene": "trimesh embreex OpenEXR",
    "cube": "xarray pandas zarr dask distributed h5netcdf tifffile PIL threadpoolctl filelock",
    "studio": "starlette uvicorn websockets anywidget",
    "test": "selenium",
    "render": "mitsuba",
}
_EXTRA_OF = {module: extra for extra, modules in _EXTRAS.items() for module in modules.split()}
# Names to install that differ from those to import.
_PACKAGES = {"python_calamine": "python-calamine", "PIL": "pillow"}


def advice(module: str | None) -> str | None:
    """One sentence on how to install a package that was not found; None if no extra brings it.

    Args:
        module: what could not be imported, such as `ModuleNotFoundError.name`; a submodule counts
            as its package.
    """
    name = (module or "").partition(".")[0]
    if name not in _EXTRA_OF:
        return None
    return (
        f"this needs the package {_PACKAGES.get(name, name)}, which is not installed; install it "
        f'with: pip install "glazejax[{_EXTRA_OF[name]}]"'
    )


def require(*modules: str) -> None:
    """Refuse a task before it starts, if a package that it needs is not installed.

    The packages are looked up, not imported: colour-science puts empty stand-ins in the place of a
    missing matplotlib, which would draw nothing and say nothing.

    Args:
        modules: names to import, such as ``matplotlib``.

    Raises:
        ModuleNotFoundError: one of them is not installed; the message says how to install it.
    """
    for module in modules:
        try:
            distribution(_PACKAGES.get(module, module))
        except PackageNotFoundError:
            raise ModuleNotFoundError(advice(module), name=module) from None
