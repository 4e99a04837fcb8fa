"""Archives: results as HDF5 files that xarray opens directly."""
