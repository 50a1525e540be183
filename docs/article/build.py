"""Write docs/article.html, one file that opens from disk, and its picture for the README, still and moving.

    make article

The same command gives the same bytes. The site takes the file apart again (docs/extensions/article.py), so both show
the same article.
"""

import json
import re
import sys
from pathlib import Path

import yaml
from stills import moving, stills

from data import cuts, longer, parts, policies
from vsp import VoronoiPolicy
from vsp.run import atomic
from vsp.show import style
from vsp.show.explorer import STYLE
from vsp.show.explorer.explorer import SECURITY

FOLDER = Path(__file__).parent
TITLE = "A network in a few equations"
LONGER = 45_000  # more iterations in section 4: with them ten times as many
LIMITS = {
    "split": "max_pol_loss", "merge": "min_param_distance", "distance": "min_pol_distance", "n_split": "n_split",
    "n_merge": "n_merge",
}  # fmt: skip
ABOUT = "400 walkers led by a network, and by three equations that one can read, drag and prove: the method runs live."
PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
{security}
<title>{title}</title>
<meta name="description" property="og:description" content="{about}">
<meta property="og:title" content="{title}"><meta property="og:image" content="article.png">
<style>
:root {{ color-scheme: light dark }}
body {{ max-width: 84rem }}
h1 {{ max-width: 68rem; margin-inline: auto }}
@media (min-width: 85em) {{ h1 {{ max-width: none }} }}
{style}</style></head>
<body class="vsp-page"><main>
<h1>{title}</h1>
<div class="vsp-article">
{text}</div>
</main>
{data}
<script type="module" id="vsp-script">
{script}
begin()
</script>
</body></html>
"""


def text(scene: dict, run: dict, pictures: dict[str, tuple[bytes, str]]) -> str:
    """Return the article's HTML with its numbers, each computed, and its pictures."""
    still = {
        name: f'<figure class="still">{style.embedded(png, alt, width=460)}</figure>'
        for name, (png, alt) in pictures.items()
    }
    limits = {short: run["config"][name] for short, name in LIMITS.items()}
    numbers = {**scene["says"], **limits, "card": card(policies()["faithful_3"])}
    numbers |= {"longer": LONGER, "longer_failures": longer(LONGER), "cite": citation(), "cut": cut()}
    written = (FOLDER / "text.html").read_text("utf-8").format(**numbers, still=still)
    return re.sub(r"(?<=[\s>])-(?=\d)", "−", written)


def citation() -> str:
    """Return how to cite this article, as HTML."""
    about = yaml.safe_load((atomic.ROOT / "CITATION.cff").read_text("utf-8"))
    return f"{about['authors'][0]['name']}, <cite>{about['title']}</cite>, version {about['version']}"


def card(policy: VoronoiPolicy) -> str:
    """Return the equations of all cells as HTML, each beside the colour of its cell."""
    lines = ""
    for cell, (codeword, colour) in enumerate(zip(policy.codewords, style.CELLS)):
        near = ", ".join(f"{value:.2f}" for value in codeword)
        equations = " ".join(f"<code>{one.replace('-', '−')}</code>" for one in policy.equations(cell))
        lines += f'<p style="--tint: {colour}"><b>Nearest to ({near})</b> {equations}</p>'
    return lines


def cut() -> str:
    """Return pictures of how a proof cuts the square of starts, as SVG: one stage after the other."""
    drawn = ""
    for i, pieces in enumerate(cuts()):
        paths, words = "", f"{len(pieces)} piece{'s' * (len(pieces) > 1)}"
        for cell, corners in pieces:
            way = " ".join(f"{100 * x:.1f} {100 - 100 * y:.1f}" for x, y in corners)
            paths += f'<path fill="{style.CELLS[cell]}" d="M{way}z"/>'
        about = f'role="img" aria-label="The square, cut into {words}."'
        drawn += f'<span style="--at: {i}"><svg viewBox="0 0 100 100" {about}>{paths}</svg>{words}</span>'
    caption = "<figcaption>The square of starts, and after 1, 2, 3 steps.</figcaption>"
    return f'<figure class="cut">{drawn}{caption}</figure>'


def page(data: dict[str, dict], pictures: dict[str, tuple[bytes, str]]) -> str:
    """Return the whole file."""
    said = text(data["scene"], data["run"], pictures)
    named = [{"id": name, **policy} for name, policy in data["scene"]["policies"].items()]
    scene = {name: part for name, part in data["scene"].items() if name != "says"} | {"policies": named}
    data = data | {"scene": scene}
    stored = "\n".join(
        f'<script type="application/json" id="article-{name}">{json.dumps(part, separators=(",", ":"))}</script>'
        for name, part in data.items()
    )
    look, script = ((FOLDER / f"article.{name}").read_text("utf-8") for name in ("css", "bundle.js"))
    parts = {"style": STYLE + look, "text": said, "data": stored, "script": script, "security": SECURITY}
    return PAGE.format(title=TITLE, about=ABOUT, **parts)


if __name__ == "__main__":
    pictures = stills()
    docs = Path(sys.argv[1]) / "docs"
    atomic.write_text(docs / "article.html", page(parts(), pictures))
    atomic.write_bytes(docs / "article.png", pictures["opening"][0])
    atomic.write_bytes(docs / "article.gif", moving())
