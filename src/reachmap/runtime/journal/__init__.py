"""The file that finished units are kept in until the artefact is written."""
