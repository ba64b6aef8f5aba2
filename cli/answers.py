"""Answers on stdout, as people read them."""

from __future__ import annotations

from collections.abc import Mapping


def facts_text(facts: Mapping[str, object]) -> str:
    """One line per fact: its name, with spaces, and its value in one column."""
    width = max(len(key) for key in facts)
    return "\n".join(
        f"{key.replace('_', ' '):{width}}  {value}" for key, value in facts.items()
    )
