"""How a data set lies on disk: columns, HDF5, the records of a journal, tables as text."""
