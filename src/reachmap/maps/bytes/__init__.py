"""Artefacts as bytes: HDF5 images, hashes, seals, whole-or-nothing publishing."""
