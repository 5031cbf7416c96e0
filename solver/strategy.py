"""Where the starts of a design come from: a choice of the user's."""

from __future__ import annotations

from enum import StrEnum


class Strategy(StrEnum):
    """Where starts come from.

    ``EXCHANGE``: networks searched among candidate poses, each then moved a little; where none
    of them meets the limits, or limits are on that the search does not know, also ``K_MEANS``:
    the source paper's clusters, the best strip, and clusters jittered.
    """

    EXCHANGE = "exchange"
    K_MEANS = "k-means"
