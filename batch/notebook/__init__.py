"""In a notebook: `data.met` of what xarray has opened, a Dataset or a DataTree.

    accessor     what there is, and of which archive
    selection    cases by what is varied in them, with units; by their names; by how they ended
    grid         a metric over the parameters that are varied
    frames       where the links are
    quantities   numbers with units, as somebody types them; variables in other units
    table        what of an archive's variables says which case is which
    source       the archive that the numbers came from

`batch.open` imports this; who opens an archive by xarray alone imports it for `data.met`.
"""

from __future__ import annotations

import xarray

from batch.notebook.accessor import DatasetAccessor, TreeAccessor

NAME = "met"

xarray.register_dataset_accessor(NAME)(DatasetAccessor)
xarray.register_datatree_accessor(NAME)(TreeAccessor)
