"""What scope of key each operation needs. What only reads needs the least."""

from __future__ import annotations

from collections.abc import Mapping

from service.keys.scope import Scope

OPEN = frozenset({"sign_in", "read_sign_in", "openapi", "read_page", "read_asset"})
"""For whoever has no key yet: the page's own files, the document, and the door itself."""

_STOPS = (
    *("abort_rig", "cancel_capture", "cancel_rig_test"),
    *("cancel_design", "cancel_study", "cancel_plan", "cancel_evaluation"),
    *("cancel_calibration", "cancel_check", "cancel_acceptance"),
    *("cancel_reconstruction", "cancel_comparison"),
)
"""Whoever sees that something goes wrong may stop it."""

_READS = (*_STOPS, "verify_session_files", "read_study_files", "sign_out")
_CONFIGURES = (
    *(
        "add_scan",
        "remove_scan",
        "add_target_set",
        "add_target_file",
        "propose_target_set",
        "remove_target_set",
    ),
    *("add_picture_set", "remove_picture_set", "add_design", "remove_design"),
    *("add_study", "remove_study"),
    *("add_plan", "remove_plan", "add_evaluation", "remove_evaluation"),
    *("add_calibration", "remove_calibration", "add_check", "remove_check"),
    *("add_acceptance", "remove_acceptance", "remove_capture", "remove_rig_test"),
    *("remove_session", "restore_session", "erase_session"),
    *("reject_pictures", "accept_pictures"),
    *("add_reconstruction", "remove_reconstruction", "add_comparison", "remove_comparison"),
)
_FIRES = ("add_capture", "add_rig_test", "reset_rig")

CHANGING: Mapping[str, Scope] = {
    **dict.fromkeys(_READS, Scope.READ),
    **dict.fromkeys(_CONFIGURES, Scope.CONFIGURE),
    **dict.fromkeys(_FIRES, Scope.HARDWARE),
}
"""By the name of the operation, for all that are not GET."""


def needed_scope(method: str, operation: str) -> Scope:
    """The least scope that may ask for an operation; an unknown one is for the greatest."""
    if method == "GET":
        return Scope.READ
    return CHANGING.get(operation, Scope.HARDWARE)
