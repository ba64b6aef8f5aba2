"""The words around a recorded scene: caption, colour scale, and no way out."""

from __future__ import annotations

import html
import re

from reachmap.plots.style import colour_map

STEPS = 5
# The page may run its own scripts and nothing else: no address is ever asked.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' data: blob:; "
    "style-src 'unsafe-inline' data:; img-src data: blob:; font-src data:; "
    "media-src data: blob:; worker-src data: blob:; connect-src data: blob:"
)
CAPTION = """
<style>
#reachmap-caption {{
  position: fixed; left: 14px; bottom: 58px; z-index: 30; max-width: min(440px, 60vw);
  padding: 10px 14px; border-radius: 8px; background: rgba(255, 255, 255, 0.9);
  box-shadow: 0 1px 6px rgba(0, 0, 0, 0.18); color: #1c1c1c;
  font: 13px/1.4 system-ui, "DejaVu Sans", sans-serif; pointer-events: none;
}}
#reachmap-caption b {{ display: block; font-size: 15px; }}
#reachmap-caption span {{ color: #5f5f5f; }}
#reachmap-scale {{
  height: 10px; margin-top: 8px; border-radius: 2px;
  background: linear-gradient(90deg, {stops});
}}
#reachmap-ends {{ display: flex; justify-content: space-between; color: #5f5f5f; }}
#reachmap-ends i {{ font-style: normal; }}
</style>
<div id="reachmap-caption"><b>{title}</b><span>{subtitle}</span>
{scale}</div>
"""
SCALE = """<div id="reachmap-scale"></div>
<div id="reachmap-ends"><i>0 %</i><i>{name}</i><i>100 %</i></div>
"""


def framed(page: str, *, title: str, subtitle: str, scale: str) -> str:
    """Put a caption on a viewer's page, and forbid it every address.

    Parameters
    ----------
    page : str
        HTML of a recorded scene.
    title, subtitle, scale : str
        Plain text: what is shown, of which cell, and what the colours mean; without
        a scale none is drawn.
    """
    colours = colour_map("RdYlGn")
    stops = ", ".join(
        "rgb({:.0f}, {:.0f}, {:.0f})".format(*(255.0 * v for v in colours(share)[:3]))
        for share in (step / (STEPS - 1) for step in range(STEPS))
    )
    caption = CAPTION.format(
        title=html.escape(title),
        subtitle=html.escape(subtitle),
        scale=SCALE.format(name=html.escape(scale)) if scale else "",
        stops=stops,
    )
    head = (
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        f"<title>{html.escape(title)}</title>"
    )
    # Only the viewer's own head and body, not the same words in its scripts.
    page = re.sub(r"<title>[^<]*</title>", "", page, count=1)
    start = page.index("<head>") + len("<head>")
    page = page[:start] + head + page[start:]
    end = page.rindex("</body>")
    return page[:end] + caption + page[end:]
