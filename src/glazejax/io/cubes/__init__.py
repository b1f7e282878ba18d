"""Images of spectra of any size, opened without being read: ENVI, zarr, NetCDF, HDF5, TIFF, .npy.

`open_cube` gives one lazy `xarray.DataArray` with dims y, x, wavelength whatever the file is;
`CubeSource` is the same as a thing that can be sent to other processes, which open the file
themselves. Each kind of file has a module that gives a `RawCube`, the file's own numbers; `lazy`
turns these into reflectance, a window at a time.
"""
