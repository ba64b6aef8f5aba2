"""``reachmap empty``: simulate picking heaps until nothing more can be reached."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from reachmap.cli.options import (
    INPUT_FILE,
    OUTPUT_PATH,
    json_option,
    output_option,
    overwrite_option,
    seed_option,
    unused,
)
from reachmap.cli.quantities import FINITE, PART
from reachmap.cli.terminal import print_answer


@click.command()
@click.argument("bin_map", metavar="BIN_MAP", type=INPUT_FILE)
@click.option(
    "--part",
    type=PART,
    metavar="PART",
    help="A box (60x40x20mm), a cylinder (d30x80mm) or a mesh file in metres; "
    "cylinders and meshes count as their bounding boxes. Default: the cell's part.",
)
@click.option(
    "--fill",
    type=FINITE,
    default=0.9,
    show_default=True,
    metavar="SHARE",
    help="Mean height of the heap as a share of the bin's depth.",
)
@click.option(
    "--heaps",
    type=int,
    default=3,
    show_default=True,
    metavar="N",
    help="Number of heaps, with consecutive seeds.",
)
@click.option(
    "--order",
    type=click.Choice(["highest", "rank"]),
    default="highest",
    show_default=True,
    help="Which uncovered part to pick next: the highest, or the one of least cost.",
)
@output_option(
    holds=".json", help="Also write the pose and the outcome of every part (JSON)."
)
@click.option(
    "--picture",
    type=OUTPUT_PATH,
    metavar="PATH",
    help="Also draw the parts that remain (.png or .svg).",
)
@seed_option
@overwrite_option
@json_option
def command(
    bin_map: Path,
    part: tuple[float, float, float] | Path | None,
    fill: float,
    heaps: int,
    order: Literal["highest", "rank"],
    output: Path | None,
    picture: Path | None,
    seed: int | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Fill a bin with parts and simulate emptying it.

    Parts are dropped at random positions and come to rest on those below. A part that
    no other covers is picked at the centre of its top face, along the face's normal, if
    BIN_MAP reaches more than half of the test grasps around that. Nothing is planned.

    Example: reachmap empty bin.h5 --part 60x40x20mm
    """
    if output is None and picture is None:
        unused("overwrite", because="needs --output or --picture")
    from reachmap.cli.text.emptying import emptying_lines
    from reachmap.tools.empty import empty

    answer = empty(
        bin_map,
        part=part,
        fill=fill,
        heaps=heaps,
        order=order,
        seed=seed,
        output=output,
        picture=picture,
        overwrite=overwrite,
    )
    written = [str(path) for path in (output, picture) if path is not None]
    print_answer(
        answer.facts(),
        lambda: "\n".join([*emptying_lines(answer), *written]),
        as_json=as_json,
    )
