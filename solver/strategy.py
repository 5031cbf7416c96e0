"""Where the starts of a design come from: a choice of the user's."""

from __future__ import annotations

from enum import StrEnum


class Strategy(StrEnum):
    """Where starts come from.

    ``EXCHANGE``, the default: networks searched among candidate poses, each then moved a little.
    ``K_MEANS``: the source paper's clusters, the best strip, and clusters jittered; also tried
    where no network of the search meets the limits, or limits are on that it does not know.
    """

    EXCHANGE = "exchange"
    K_MEANS = "k-means"
