"""YAML with places: reading, writing, overriding, and messages that say where."""
