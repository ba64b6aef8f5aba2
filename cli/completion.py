"""``reachmap completion``: completion scripts for bash, zsh and fish."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class

from reachmap.cli.options import json_option
from reachmap.cli.terminal import print_answer

VARIABLE = "_REACHMAP_COMPLETE"
GOES_ON = "    [[ ${COMPREPLY[0]} == *[.=] ]] && compopt -o nospace\n"


@click.command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
@json_option
@click.pass_context
def command(ctx: click.Context, shell: str, as_json: bool) -> None:
    """Print a shell-completion script.

    It completes commands, options, names of shipped cells and the keys of --set. Needs
    bash 4.4, zsh or fish.

    \b
    Example:
      reachmap completion bash >> ~/.bashrc
      reachmap completion zsh >> ~/.zshrc
      reachmap completion fish > ~/.config/fish/completions/reachmap.fish
    """
    kind = get_completion_class(shell)
    assert kind is not None
    script = kind(ctx.find_root().command, {}, "reachmap", VARIABLE)
    # Not source(), which runs the shell to look at its version.
    text = script.source_template % script.source_vars()
    if shell == "bash":
        # A key goes on after its dot; bash would put a space there.
        text = text.replace("    return 0\n", f"{GOES_ON}    return 0\n")
    print_answer({"shell": shell, "script": text}, lambda: text, as_json=as_json)
