"""Cameras, lenses and the other parts of a rig, each figure with its source.

``load_catalogue()`` reads what comes with the program and lays a user's files over it;
``catalogue_rows`` lists and searches, ``catalogue_entry`` shows one part; ``fit`` says whether a
lens goes on a body. Rig files name parts by ``[camera] model`` and ``lens``.
"""

from rig.catalogue.catalogue import Catalogue
from rig.catalogue.fitting import Fit, fit
from rig.catalogue.items import (
    Bracket,
    CatalogueCamera,
    CatalogueLens,
    Fastener,
    Head,
    LensMount,
    Part,
    Profile,
    Source,
)
from rig.catalogue.listing import catalogue_entry, catalogue_rows
from rig.catalogue.loader import load_catalogue

__all__ = [
    "Bracket",
    "Catalogue",
    "CatalogueCamera",
    "CatalogueLens",
    "Fastener",
    "Fit",
    "Head",
    "LensMount",
    "Part",
    "Profile",
    "Source",
    "catalogue_entry",
    "catalogue_rows",
    "fit",
    "load_catalogue",
]
