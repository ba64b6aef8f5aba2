"""Heaps of parts in a bin, and simulated emptying."""
