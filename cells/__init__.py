"""Cell descriptions shipped with reachmap, as data files."""
