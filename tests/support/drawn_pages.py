"""Pages with figures, unpacked: as they are once a browser has them."""

from __future__ import annotations

import base64
import gzip
import re

PACKED = re.compile(r'<script type="text/plain" id="(plotly|packed)">([A-Za-z0-9+/=]*)</script>')

FIGURES = r'id="figures">(.*?)</script>'


def parts(page: str) -> dict[str, str]:
    """The texts that a page carries packed, by their id."""
    found = {
        i: gzip.decompress(base64.b64decode(text)).decode() for i, text in PACKED.findall(page)
    }
    assert set(found) == {"plotly", "packed"}
    return found


def without_plotly(page: str) -> str:
    """A page's own text, its figures in a plain element of their own, without plotly."""
    from plotly.offline import get_plotlyjs

    found = parts(page)
    assert found["plotly"] == get_plotlyjs()
    figures = found["packed"].replace("<", "\\u003c")
    plain = f'<script type="application/json" id="figures">{figures}</script>'
    return PACKED.sub(lambda one: "<script></script>" if one[1] == "plotly" else plain, page)
