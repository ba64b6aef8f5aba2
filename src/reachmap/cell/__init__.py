"""The robot cell as data: typed description, YAML with line numbers, file look-up."""
