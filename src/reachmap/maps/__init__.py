"""The artefacts: records, their HDF5 form, provenance, checksums."""
