"""Where the starts of a design come from: a choice of the user's."""

from __future__ import annotations

from enum import StrEnum


class Strategy(StrEnum):
    """Where starts come from.

    ``EXCHANGE``, the default: networks searched among candidate poses, each then moved a little.
    ``K_MEANS``: the source paper's clusters, the best strip, and clusters jittered; also tried
    where no network of the search meets the limits, or limits are on that it does not know.
    ``STRIP``: conventional strips of several spans. ``NEXT_BEST_VIEW``: one network of candidates,
    each camera put where it helps those before it most. ``FILTERING``: one network, which is all
    candidates without those that are missed least.
    """

    EXCHANGE = "exchange"
    K_MEANS = "k-means"
    STRIP = "strip"
    NEXT_BEST_VIEW = "next-best-view"
    FILTERING = "filtering"

    @property
    def classical(self) -> bool:
        """Whether it begins with clusters or strips, not with candidate poses."""
        return self in {Strategy.K_MEANS, Strategy.STRIP}
