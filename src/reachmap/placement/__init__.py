"""Where to put the bin, and the configuration it is imaged from."""
