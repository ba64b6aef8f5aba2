"""``reachmap info``: any artefact or journal in a few numbers."""

from __future__ import annotations

from pathlib import Path

import click

from reachmap.cli.options import INPUT_FILE, json_option
from reachmap.cli.terminal import print_answer


@click.command()
@click.argument("artefact", metavar="FILE", type=INPUT_FILE)
@json_option
def command(artefact: Path, as_json: bool) -> None:
    """Summarise an artefact or a journal.

    A workspace map: reachability and counts by level, why frames are not reached and
    which bodies are in the way, and the planning effort behind the verdicts. A bin map:
    reachability after one attempt, two, … with intervals, causes, quadrants, lengths
    and times. A placement: pose, score, margin, runner-up. A study: variants, main
    effects, the best variant. Each with its cell, settings and run. A journal is
    summarised as far as it has got.

    Example: reachmap info bin.h5
    """
    from reachmap.cli.text.info import info_text
    from reachmap.tools.info import info

    found = info(artefact)
    print_answer(found.facts(), lambda: info_text(found), as_json=as_json)
