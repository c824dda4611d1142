"""Senders without a key that send and are not heard, as the operator's page shows them; which may be accepted. Pure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipeline.live import health
from pipeline.live.events import Offer

if TYPE_CHECKING:
    from pipeline.live.run_state import StudyRun


def shown(run: StudyRun) -> list[dict[str, object]]:
    """All of them; `accepted` is the address of the sender that its stream has already, if one was accepted."""
    return [{"id": _id(one), **vars(one), "accepted": run.accepted.get(one.stream)} for one in run.offers]


def named(run: StudyRun, offer_id: str) -> Offer | None:
    """The one with that id; None where it does not send any more."""
    return next((one for one in run.offers if _id(one) == offer_id), None)


def refusal(run: StudyRun, offer_id: str, at_ns: int) -> str | None:
    """Why it cannot be accepted, in a sentence with the remedy; None where it can."""
    offer = named(run, offer_id)
    if offer is None:
        return "This sender is silent now. Turn it on again, then accept it."
    accepted = run.accepted.get(offer.stream)
    if accepted is not None:
        return (
            f"{offer.stream} comes from {accepted} until the end of this run. To change that, start the recorder anew."
        )
    if not health.is_silent(run.health[offer.stream], at_ns):
        return f"{offer.stream} comes from another sender already. Turn that one off, then accept this one."
    return None


def _id(offer: Offer) -> str:
    return f"{offer.stream} {offer.source}"
