"""Packages that only some tasks need, and the extra of glazejax that installs each: one place, one
sentence.
"""

from importlib.metadata import PackageNotFoundError, distribution

# Name to import -> name to install, and the extra that brings it.
_EXTRAS = {
    "typer": ("typer", "commands"),
    "rich": ("rich", "commands"),
    "platformdirs": ("platformdirs", "commands"),
    "matplotlib": ("matplotlib", "plots"),
    "corner": ("corner", "plots"),
    "jinja2": ("jinja2", "plots"),
    "python_calamine": ("python-calamine", "formats"),
    "arviz": ("arviz", "arviz"),
    "h5py": ("h5py", "arviz"),
    "trimesh": ("trimesh", "scene"),
    "embreex": ("embreex", "scene"),
    "OpenEXR": ("OpenEXR", "scene"),
    "xarray": ("xarray", "cube"),
    "pandas": ("pandas", "cube"),
    "zarr": ("zarr", "cube"),
    "dask": ("dask", "cube"),
    "distributed": ("distributed", "cube"),
    "h5netcdf": ("h5netcdf", "cube"),
    "tifffile": ("tifffile", "cube"),
    "PIL": ("pillow", "cube"),
    "threadpoolctl": ("threadpoolctl", "cube"),
    "filelock": ("filelock", "cube"),
    "starlette": ("starlette", "studio"),
    "uvicorn": ("uvicorn", "studio"),
    "websockets": ("websockets", "studio"),
    "anywidget": ("anywidget", "studio"),
    "selenium": ("selenium", "test"),
    "mitsuba": ("mitsuba", "render"),
}


def advice(module: str | None) -> str | None:
    """One sentence on how to install a package that was not found; None if no extra brings it.

    Args:
        module: what could not be imported, such as `ModuleNotFoundError.name`; a submodule counts
            as its package.
    """
    if module is None or (entry := _EXTRAS.get(module.partition(".")[0])) is None:
        return None
    package, extra = entry
    return (
        f"this needs the package {package}, which is not installed; install it with: pip install "
        f'"glazejax[{extra}]"'
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
            distribution(_EXTRAS[module][0])
        except PackageNotFoundError:
            raise ModuleNotFoundError(advice(module), name=module) from None
