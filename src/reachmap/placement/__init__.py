"""Where the bin goes, and the configuration it is imaged from."""
