"""One function per command: paths and settings in, artefact out."""
